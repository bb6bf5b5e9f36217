"""Separation: lower bounds on the distance of two convex bodies, each by a plane between them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.shapes import extreme_points

ACCURACY = 0.01
"""Share of the distance that a bound may fall short of it by."""

_ITERATIONS = 40
_CONTACT = 1e-9  # [m], closer than this no plane is looked for


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
    """Return shapes that coal measures, spheres, capsules and convex hulls, as arrays."""
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


@compiled
def separation(
    hulls: RoundedHulls,
    rotation: Array,
    translation: Array,
    enough: float,
    corners: NDArray[np.int64],
) -> float:
    r"""Return a lower bound on the distance of two hulls A and B, zero where they may touch.

    For every unit vector n,

    .. math:: d(A, B) \ge \min_{a \in A} n \cdot a - \max_{b \in B} n \cdot b,

    so that any n whose right-hand side is positive is a proof, however it was found. Here it is
    improved by the algorithm of Gilbert, Johnson and Keerthi until the bound is within `ACCURACY`
    of the distance, or enough. Corners are climbed to along edges. Radii are not taken off.

    Args:
        hulls: all hulls, those of A and B among them.
        rotation: of the frame of A in that of B (3, 3).
        translation: of the frame of A in that of B (3,) [m].
        enough: a bound that need not be improved [m].
        corners: pairs of corners (4, 2), -1 where there is none, whose differences span a simplex
            near the origin, at least one; a guess, such as the last call's, that is improved.

    Returns:
        The bound [m], >= 0.

    Source: Gilbert, Johnson, Keerthi, A Fast Procedure for Computing the Distance Between Complex
        Objects in Three-Dimensional Space, IEEE J. Robotics and Automation 1988.
    """
    points, neighbours, first_neighbour = hulls.points, hulls.neighbours, hulls.first_neighbour
    simplex = np.empty((4, 3))
    count = 0
    while count < 4 and corners[count, 0] >= 0:
        _write_difference(points, rotation, translation, corners[count], simplex[count])
        count += 1
    best = 0.0
    for _ in range(_ITERATIONS):
        count, x, y, z = _nearest(simplex, corners, count)
        norm = math.sqrt(x * x + y * y + z * z)
        if count == 0 or norm < _CONTACT:  # the bodies may overlap
            count = max(count, 1)
            break
        start, new, w = corners[count - 1], corners[count], simplex[count]
        turned = _turned(rotation, -x, -y, -z)
        new[0] = _farthest(points, neighbours, first_neighbour, start[0], *turned)
        new[1] = _farthest(points, neighbours, first_neighbour, start[1], x, y, z)
        _write_difference(points, rotation, translation, new, w)
        best = max(best, (x * w[0] + y * w[1] + z * w[2]) / norm)
        if _is_known(corners, count):
            break
        count += 1
        if best >= enough or best >= (1.0 - ACCURACY) * norm:
            break
    corners[count:] = -1
    return best


@compiled
def _farthest(
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    corner: int,
    x: float,
    y: float,
    z: float,
) -> int:
    """Return the corner that is farthest along (x, y, z), climbed to from a corner of its hull."""
    best = points[corner, 0] * x + points[corner, 1] * y + points[corner, 2] * z
    climbing = True
    while climbing:
        climbing = False
        for k in range(first_neighbour[corner], first_neighbour[corner + 1]):
            i = neighbours[k]
            value = points[i, 0] * x + points[i, 1] * y + points[i, 2] * z
            if value > best:
                best, corner, climbing = value, i, True
    return corner


@compiled
def _turned(rotation: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a vector as the turned frame sees it."""
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@compiled
def _write_difference(
    points: Array, rotation: Array, translation: Array, pair: NDArray[np.int64], out: Array
) -> None:
    a, b = pair[0], pair[1]
    x, y, z = points[a, 0], points[a, 1], points[a, 2]
    for i in range(3):
        turned = rotation[i, 0] * x + rotation[i, 1] * y + rotation[i, 2] * z
        out[i] = turned + translation[i] - points[b, i]


@compiled
def _is_known(corners: NDArray[np.int64], count: int) -> bool:
    """Return whether the pair of corners at an index is among those before it."""
    for k in range(count):
        if corners[k, 0] == corners[count, 0] and corners[k, 1] == corners[count, 1]:
            return True
    return False


@compiled
def _nearest(
    simplex: Array, corners: NDArray[np.int64], count: int
) -> tuple[int, float, float, float]:
    """Reduce a simplex to the face that holds its point nearest to the origin.

    Returns:
        The number of corners left, moved to the front, and the point; 0 corners if the origin is
        inside a tetrahedron.
    """
    if count == 1:
        return 1, simplex[0, 0], simplex[0, 1], simplex[0, 2]
    if count == 2:
        mask, x, y, z = _nearest_on_segment(simplex, 0, 1)
    elif count == 3:
        mask, x, y, z = _nearest_on_triangle(simplex, 0, 1, 2)
    else:
        mask, x, y, z = _nearest_on_tetrahedron(simplex)
    kept = 0
    for i in range(count):
        if mask & (1 << i):
            for k in range(3):
                simplex[kept, k] = simplex[i, k]
            corners[kept, 0], corners[kept, 1] = corners[i, 0], corners[i, 1]
            kept += 1
    return kept, x, y, z


@compiled
def _nearest_on_segment(s: Array, i: int, j: int) -> tuple[int, float, float, float]:
    dx, dy, dz = s[j, 0] - s[i, 0], s[j, 1] - s[i, 1], s[j, 2] - s[i, 2]
    along = -(s[i, 0] * dx + s[i, 1] * dy + s[i, 2] * dz)
    square = dx * dx + dy * dy + dz * dz
    if along <= 0.0:
        return 1 << i, s[i, 0], s[i, 1], s[i, 2]
    if along >= square:
        return 1 << j, s[j, 0], s[j, 1], s[j, 2]
    t = along / square
    return (1 << i) | (1 << j), s[i, 0] + t * dx, s[i, 1] + t * dy, s[i, 2] + t * dz


@compiled
def _nearest_on_triangle(s: Array, i: int, j: int, k: int) -> tuple[int, float, float, float]:
    """Return the corners of the nearest face of a triangle as bits, and its nearest point."""
    ux, uy, uz = s[j, 0] - s[i, 0], s[j, 1] - s[i, 1], s[j, 2] - s[i, 2]
    wx, wy, wz = s[k, 0] - s[i, 0], s[k, 1] - s[i, 1], s[k, 2] - s[i, 2]
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    square = nx * nx + ny * ny + nz * nz
    if square > 0.0:
        # Barycentric coordinates of the origin's projection.
        px, py, pz = -s[i, 0], -s[i, 1], -s[i, 2]
        b = (
            (py * wz - pz * wy) * nx + (pz * wx - px * wz) * ny + (px * wy - py * wx) * nz
        ) / square
        c = (
            (uy * pz - uz * py) * nx + (uz * px - ux * pz) * ny + (ux * py - uy * px) * nz
        ) / square
        if b >= 0.0 and c >= 0.0 and b + c <= 1.0:
            height = (s[i, 0] * nx + s[i, 1] * ny + s[i, 2] * nz) / square
            return (1 << i) | (1 << j) | (1 << k), height * nx, height * ny, height * nz
    mask, x, y, z = _nearest_on_segment(s, i, j)
    least = x * x + y * y + z * z
    for first, second in ((j, k), (k, i)):
        other, ox, oy, oz = _nearest_on_segment(s, first, second)
        value = ox * ox + oy * oy + oz * oz
        if value < least:
            mask, x, y, z, least = other, ox, oy, oz, value
    return mask, x, y, z


@compiled
def _nearest_on_tetrahedron(s: Array) -> tuple[int, float, float, float]:
    """Return the corners of the nearest face as bits, none if the origin is inside."""
    mask, x, y, z, least = 0, 0.0, 0.0, 0.0, np.inf
    for i, j, k, opposite in ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 3, 1), (1, 2, 3, 0)):
        if _is_outside(s, i, j, k, opposite):
            other, ox, oy, oz = _nearest_on_triangle(s, i, j, k)
            value = ox * ox + oy * oy + oz * oz
            if value < least:
                mask, x, y, z, least = other, ox, oy, oz, value
    return mask, x, y, z


@compiled
def _is_outside(s: Array, i: int, j: int, k: int, opposite: int) -> bool:
    """Return whether the origin is not on the same side of a face as the corner opposite to it."""
    ux, uy, uz = s[j, 0] - s[i, 0], s[j, 1] - s[i, 1], s[j, 2] - s[i, 2]
    wx, wy, wz = s[k, 0] - s[i, 0], s[k, 1] - s[i, 1], s[k, 2] - s[i, 2]
    nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
    to_origin = -(s[i, 0] * nx + s[i, 1] * ny + s[i, 2] * nz)
    to_corner = (
        (s[opposite, 0] - s[i, 0]) * nx
        + (s[opposite, 1] - s[i, 1]) * ny
        + (s[opposite, 2] - s[i, 2]) * nz
    )
    return bool(to_origin * to_corner <= 0.0)
