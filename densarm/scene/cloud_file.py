"""Files of point clouds, by maintained readers."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from densarm.errors import DensarmError, FileContentError
from densarm.values.arrays import Array

_MAX_BYTES = 500_000_000  # of the largest file that is read


def read_points(path: str | Path) -> Array:
    """Return the points of a PLY, PCD, XYZ or NPY file, a row each, in its unit.

    PLY is read by trimesh and PCD by pypcd4: ``pip install 'densarm[clouds]'``. XYZ is text with x,
    y and z first on each line, NPY an array (N, 3) that numpy saved. Rows may be not finite.

    Raises:
        FileContentError: no such file, another format, too large, or not of its format.
        DensarmError: the reader is not installed.
    """
    path = Path(path)
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise FileContentError(path, f"not a point cloud: must end in {', '.join(_READERS)}")
    try:
        size = path.stat().st_size
    except OSError as error:
        raise FileContentError(path, error.strerror or "cannot be read") from None
    if not path.is_file() or size > _MAX_BYTES:
        raise FileContentError(path, f"not a file of at most {_MAX_BYTES / 1e6:g} MB")
    try:
        points = np.asarray(read(path), dtype=np.float64)
    except ImportError:
        message = f"{path}: its reader is not installed: pip install 'densarm[clouds]'"
        raise DensarmError(message) from None
    except Exception as error:  # noqa: BLE001  # readers raise what they like
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FileContentError(path, f"cannot be read as {path.suffix[1:]}: {reason}") from None
    if points.ndim != 2 or points.shape[1] != 3:
        raise FileContentError(path, f"has an array of shape {points.shape}, not (N, 3)")
    return points


def _ply(path: Path) -> Any:
    import trimesh

    loaded: Any = trimesh.load(path, process=False)
    return loaded.vertices


def _pcd(path: Path) -> Any:
    import pypcd4

    reader: Any = pypcd4
    return reader.PointCloud.from_path(path).numpy(("x", "y", "z"))


def _xyz(path: Path) -> Any:
    return np.loadtxt(path, usecols=(0, 1, 2), ndmin=2)


def _npy(path: Path) -> Any:
    return np.load(path, allow_pickle=False)


_READERS: Mapping[str, Callable[[Path], Any]] = {
    ".ply": _ply,
    ".pcd": _pcd,
    ".xyz": _xyz,
    ".npy": _npy,
}
