"""RoundedHulls: convex bodies as arrays, for compiled loops."""

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.shapes import box_hull, convex_hull, extreme_points

_WIDEST = 1e3  # [m]


class RoundedHulls(NamedTuple):
    """Convex hulls of points, each enlarged by a radius, as arrays."""

    points: Array
    """Corners of all hulls, one hull after the other (P, 3) [m]."""
    first: NDArray[np.int64]
    """Index of each hull's first corner, and the number of corners (S + 1,)."""
    neighbours: NDArray[np.int64]
    """Indices of the corners that share an edge with a corner, one corner after the other (E,)."""
    first_neighbour: NDArray[np.int64]
    """Index of each corner's first neighbour, and their number (P + 1,)."""
    radius: Array
    """By which each hull is enlarged (S,) [m]."""


def rounded_hulls(shapes: Sequence[coal.CollisionGeometry]) -> RoundedHulls:
    """Return shapes that coal measures, spheres, capsules, convex hulls and half-spaces, as arrays.

    A half-space becomes a cube with a face on its surface, wider than anything reaches.
    """
    shapes = [_cube(shape) if isinstance(shape, coal.Halfspace) else shape for shape in shapes]
    points, radius, neighbours = [], [], []
    count = 0
    for shape in shapes:
        corners, reach = extreme_points(shape)
        points.append(corners)
        radius.append(reach)
        for corner in range(len(corners)):
            near = shape.neighbors(corner) if reach == 0.0 else range(len(corners))
            neighbours.append([count + other for other in near])
        count += len(corners)
    return RoundedHulls(
        points=np.vstack(points),
        first=np.concatenate([[0], np.cumsum([len(corners) for corners in points])]),
        neighbours=np.array([other for near in neighbours for other in near], dtype=np.int64),
        first_neighbour=np.concatenate([[0], np.cumsum([len(near) for near in neighbours])]),
        radius=np.array(radius),
    )


def _cube(half_space: coal.Halfspace) -> coal.ConvexBase:
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), half_space.n).toRotationMatrix()
    corners = np.array(box_hull([_WIDEST] * 3).points()) - [0.0, 0.0, 0.5 * _WIDEST]
    return convex_hull(corners @ turn.T + half_space.d * half_space.n)


@compiled
def farthest_corner(
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    pose: Array,
    hull: int,
    corner: int,
    x: float,
    y: float,
    z: float,
) -> int:
    """Return a hull's farthest corner along (x, y, z) of the world, climbed to from another."""
    a = pose[hull, 0] * x + pose[hull, 3] * y + pose[hull, 6] * z
    b = pose[hull, 1] * x + pose[hull, 4] * y + pose[hull, 7] * z
    c = pose[hull, 2] * x + pose[hull, 5] * y + pose[hull, 8] * z
    best = points[corner, 0] * a + points[corner, 1] * b + points[corner, 2] * c
    climbing = True
    while climbing:
        climbing = False
        for k in range(first_neighbour[corner], first_neighbour[corner + 1]):
            i = neighbours[k]
            value = points[i, 0] * a + points[i, 1] * b + points[i, 2] * c
            if value > best:
                best, corner, climbing = value, i, True
    return corner
