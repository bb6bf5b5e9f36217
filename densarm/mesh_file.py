"""Mesh files: the convex pieces of an STL, OBJ or DAE file."""

from itertools import product
from pathlib import Path

import coal
import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.captured_stderr import captured_stderr
from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.shapes import convex_hull

MAX_BYTES = 100_000_000
"""Size of the largest mesh file that is read."""

_CONCAVITY = 0.05  # CoACD's threshold, as a part of the mesh's extent; its own default
_GROWTH = 1e-3  # of pieces, as a part of the mesh's extent; CoACD's fall short by up to 5e-5

_SIGNS = list(product((-1.0, 1.0), repeat=3))

Pieces = tuple[tuple[tuple[float, ...], ...], ...]


def convex_pieces(path: Path, scale: tuple[float, ...], convex: str) -> Pieces:
    """Return the corners of the convex hulls that stand for a mesh.

    The pieces are by CoACD, an approximate decomposition [Wei, Liu, Ling, Su, "Approximate
    Convex Decomposition for 3D Meshes with Collision-Aware Concavity and Tree Search", SIGGRAPH
    2022], which is deterministic for its fixed seed. The hull encloses the mesh. The pieces are
    grown by a thousandth of the mesh's extent to enclose it too: as CoACD returns them they leave
    out some of its surface.

    Args:
        path: STL, OBJ or DAE file.
        scale: factors x y z from its unit to metres.
        convex: "hull" or "pieces".

    Raises:
        FileContentError: no such file, not a mesh, too large, without volume, or, for pieces, not
            closed.
        InvalidValueError: pieces are asked for and CoACD is not installed.
    """
    vertices, triangles = _read(path, scale)
    try:
        whole = hull_corners(vertices)
        return (whole,) if convex == "hull" else _enclosing_pieces(vertices, triangles)
    except InvalidValueError:
        raise
    except DensarmError as error:
        raise FileContentError(path, str(error).replace("the set of points", "the mesh")) from None


def _read(path: Path, scale: tuple[float, ...]) -> tuple[Array, NDArray[np.int64]]:
    try:
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        raise FileContentError(path, getattr(error, "strerror", None) or "no such file") from None
    if not path.is_file() or size > MAX_BYTES:
        raise FileContentError(path, f"not a mesh file of at most {MAX_BYTES / 1e6:g} MB")
    try:
        with captured_stderr():
            mesh = coal.MeshLoader().load(str(path), np.array(scale))
    except (ValueError, RuntimeError):
        raise FileContentError(path, "not a mesh in STL, OBJ or DAE") from None
    triangles = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    corners = np.array([[triangle[i] for i in range(3)] for triangle in triangles], dtype=np.int64)
    return np.array(mesh.vertices()), corners


def hull_corners(points: Array) -> tuple[tuple[float, ...], ...]:
    """Return the corners of the convex hull of points (N, 3) [m].

    Raises:
        RobotDescriptionError: the points span no volume.
    """
    return tuple(tuple(point) for point in np.array(convex_hull(points).points()).tolist())


def _enclosing_pieces(vertices: Array, triangles: NDArray[np.int64]) -> Pieces:
    if not _is_closed(triangles):
        reason = "the mesh is not closed, or its faces point in and out: mend it, or use 'hull'"
        raise DensarmError(reason)
    grow = _GROWTH * float(np.ptp(vertices, axis=0).max()) * np.array(_SIGNS)
    found = _decomposition(vertices, triangles)
    pieces = tuple(hull_corners((piece[:, None] + grow).reshape(-1, 3)) for piece in found)
    if sum(convex_hull(np.array(piece)).computeVolume() for piece in pieces) < abs(
        _signed_volume(vertices, triangles)
    ):
        raise DensarmError("the mesh cannot be cut into convex pieces: use 'hull'")
    return pieces


def _signed_volume(vertices: Array, triangles: NDArray[np.int64]) -> float:
    """Return the volume of a closed mesh [m³], negative where its faces point inwards."""
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return float((a * np.cross(b, c)).sum() / 6.0)


def _is_closed(triangles: NDArray[np.int64]) -> bool:
    """Return whether each edge of a triangle is one edge, run the other way, of another."""
    edges = np.vstack([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    forth, times = np.unique(edges, axis=0, return_counts=True)
    return bool((times == 1).all()) and np.array_equal(forth, np.unique(edges[:, ::-1], axis=0))


def _decomposition(vertices: Array, triangles: NDArray[np.int64]) -> list[Array]:
    try:
        import coacd
    except ImportError:
        allowed = "'hull', or install the decomposition: pip install 'densarm[meshes]'"
        raise InvalidValueError("convex", "pieces", allowed) from None
    if _signed_volume(vertices, triangles) < 0.0:
        triangles = triangles[:, ::-1]
    coacd.set_log_level("off")
    mesh = coacd.Mesh(vertices, triangles)
    pieces = coacd.run_coacd(mesh, threshold=_CONCAVITY, preprocess_mode="off", seed=0)
    return [np.asarray(corners, dtype=np.float64) for corners, _ in pieces]
