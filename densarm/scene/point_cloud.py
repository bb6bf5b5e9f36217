"""PointCloud: what a depth camera or scanner saw, each point a ball."""

import base64
import binascii
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import coal
import numpy as np
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError
from densarm.scene.cloud_file import read_points
from densarm.scene.obstacles import Obstacle
from densarm.scene.point_tree import PointTree, point_tree
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive
from densarm.values.documented import documented
from densarm.values.kernels import compiled_beside

_WIDEST = 10.0
"""Largest extent of a cloud [m]; what is wider is in another unit, or not cropped."""


@documented
@dataclass(frozen=True, kw_only=True, eq=False)
class PointCloud(Obstacle):
    """Points as a camera or scanner saw them, each the middle of a ball.

    The distance from a link is that of the nearest ball, with its gradient. What no point was seen
    of is free: behind what hides it, too.

    Points are rounded to single precision, so that a scenario's JSON form holds the same ones. Rows
    that are not finite, as cameras have them where nothing came back, are dropped.

    Raises:
        InvalidValueError: no finite point, points that are not (N, 3) numbers or extend over more
            than 10 m, or neither points nor path.
        FileContentError: a file that cannot be read.
    """

    _SIZES = ("radius",)

    points: Any = ()
    """Positions in the cloud's frame (N, 3) [m], or as `packed_points` has them; from the file
    where not given."""
    radius: float
    """Of the ball around each point: half the spacing of points at least, and their error [m]."""
    path: str | Path = ""
    """PLY, PCD, XYZ or NPY file; read unless the points are given."""
    scale: float = 1.0
    """Factor from the file's unit to metres."""
    voxel: float = 0.0
    """Side of the cubes of which each keeps one point alone; zero keeps all [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        scale = positive(f"{self.name}.scale", self.scale)
        voxel = non_negative(f"{self.name}.voxel", self.voxel)
        given = self.points
        if isinstance(given, str):
            given = _unpacked(f"{self.name}.points", given)
        elif self.path and np.size(given) == 0:
            given = scale * read_points(Path(self.path))
        points, dropped = checked_points(f"{self.name}.points", given)
        if voxel > 0.0:
            points = voxel_filter(points, voxel)
        points.flags.writeable = False
        self._store(points=points, path=str(self.path), scale=scale, voxel=voxel, _dropped=dropped)

    def __eq__(self, other: object) -> bool:
        same = type(other) is type(self) and super().__eq__(other)
        return bool(
            same
            and isinstance(other, PointCloud)
            and (self.radius, self.path, self.voxel) == (other.radius, other.path, other.voxel)
            and np.array_equal(self.points, other.points)
        )

    def __hash__(self) -> int:
        return hash((self.name, self.position, self.radius, len(self.points)))

    @property
    def dropped(self) -> int:
        """Number of rows that were left out since they were not finite."""
        return int(getattr(self, "_dropped"))  # noqa: B009  # no field: scenarios do not tell it

    @cached_property
    def tree(self) -> PointTree:
        """The points, to be searched."""
        return point_tree(self.points)

    @cached_property
    def reach(self) -> float:
        """As `Obstacle.reach`."""
        return float(np.linalg.norm(self.points, axis=1).max()) + self.radius

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return a ball, which `World` puts where the cloud is nearest to a link."""
        return (coal.Sphere(self.radius),)


def checked_points(name: str, value: ArrayLike) -> tuple[Array, int]:
    """Return finite points (N, 3) of single precision, and how many rows were not finite.

    Raises:
        InvalidValueError: as of a `PointCloud`.
    """
    try:
        points = np.asarray(value, dtype=np.float32)
    except (TypeError, ValueError):
        raise InvalidValueError(name, value, "numbers of shape (N, 3)") from None
    if points.size and (points.ndim != 2 or points.shape[1] != 3):
        raise InvalidValueError(name, points.shape, "of shape (N, 3)")
    points = points.reshape(-1, 3)
    kept, low, high = _finite(np.ascontiguousarray(points))
    if not len(kept):
        allowed = f"at least one, of {len(points)} given"
        raise InvalidValueError(f"finite points of {name}", 0, allowed)
    extent = float((high - low).max())
    if extent > _WIDEST:
        hint = "are they millimetres (scale 0.001)? Else leave out what is far from the arm"
        raise InvalidValueError(f"extent of {name} [m]", extent, f"at most {_WIDEST:g}: {hint}")
    return kept, len(points) - len(kept)


def voxel_filter(points: ArrayLike, size: float) -> Array:
    """Return the first point of each cube of a grid.

    The distance of what is left out from what is kept is below size √3: the radius of balls must
    make up for it.

    Args:
        points: (N, 3) [m].
        size: side of the cubes [m].
    """
    points = np.asarray(points, dtype=np.float64)
    cells = np.floor(points / positive("size", size)).astype(np.int64)
    cells -= cells.min(axis=0)
    rows = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    return np.asarray(points[np.sort(np.unique(rows, return_index=True)[1])])


def packed_points(points: Array) -> str:
    """Return points of single precision (N, 3) as text: base64 of what zlib makes of them."""
    content = np.asarray(points, dtype="<f4").tobytes()
    return base64.b64encode(zlib.compress(content)).decode()


def _unpacked(name: str, text: str) -> Array:
    try:
        content = zlib.decompress(base64.b64decode(text, validate=True))
        return np.frombuffer(content, dtype="<f4").reshape(-1, 3).astype(np.float64)
    except (binascii.Error, zlib.error, ValueError):
        raise InvalidValueError(name, text, "what packed_points made of points") from None


@compiled_beside
def _finite(points: Array) -> tuple[Array, Array, Array]:
    """Return the finite rows, and their least and largest coordinates."""
    kept, count = np.empty(points.shape), 0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for k in range(points.shape[0]):
        x, y, z = points[k]
        if abs(x) + abs(y) + abs(z) < np.inf:
            for axis in range(3):
                value = np.float64(points[k, axis])
                kept[count, axis] = value
                low[axis], high[axis] = min(low[axis], value), max(high[axis], value)
            count += 1
    return kept[:count].copy(), low, high
