"""Separation: lower bounds on the distance of two convex bodies, each by a plane between them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.shapes import box_hull, convex_hull, extreme_points

ACCURACY = 0.01
"""Share of the distance that a bound may fall short of it by."""

_WIDEST = 1e3  # [m]
_ITERATIONS = 40
_CONTACT = 1e-9  # [m], closer than this no plane is looked for
_NO_WEIGHT = 1e-12
_FLAT = 1e-12  # of a corner's squared distance, what may be left of it beside the others


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
    simplex, weight, v = np.empty((4, 3)), np.ones(4), np.empty(3)
    count = 0
    while count < 4 and corners[count, 0] >= 0:
        _write_difference(points, rotation, translation, corners[count], simplex[count])
        count += 1
    weight /= count
    best = 0.0
    for _ in range(_ITERATIONS):
        count = _approach_origin(simplex, corners, weight, count, v)
        norm = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        if count == 0 or norm < _CONTACT:  # the bodies may overlap
            count = max(count, 1)
            break
        start, new, w = corners[count - 1], corners[count], simplex[count]
        turned = _turned(rotation, -v[0], -v[1], -v[2])
        new[0] = _farthest(points, neighbours, first_neighbour, start[0], *turned)
        new[1] = _farthest(points, neighbours, first_neighbour, start[1], v[0], v[1], v[2])
        _write_difference(points, rotation, translation, new, w)
        best = max(best, (v[0] * w[0] + v[1] * w[1] + v[2] * w[2]) / norm)
        if _is_known(corners, count):
            break
        weight[count] = 0.0
        count += 1
        if best >= enough or best >= (1.0 - ACCURACY) * norm:
            break
    for i in range(count, 4):
        corners[i, 0] = corners[i, 1] = -1
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
def _approach_origin(
    simplex: Array, corners: NDArray[np.int64], weight: Array, count: int, out: Array
) -> int:
    """Reduce a simplex to a face whose plane is nearest to the origin inside that face.

    Args:
        simplex: its corners (4, 3), those that are kept moved to the front.
        corners: what they are differences of (4, 2), moved alike.
        weight: of the corners (4,), >= 0: the point to start from; overwritten.
        count: number of corners.
        out: the nearest point (3,), overwritten.

    Returns:
        The number of corners left; 0 if the origin is inside a tetrahedron.

    Source: Wolfe, Finding the Nearest Point in a Polytope, Mathematical Programming 1976.
    """
    affine = np.empty(4)
    before = 0
    while count != before:
        before = count
        if not _write_affine_weights(simplex, count, affine):
            count -= 1  # the newest corner depends on the others
            continue
        share = 1.0
        for i in range(count):
            if affine[i] <= 0.0:
                share = min(share, weight[i] / (weight[i] - affine[i]))
        count = 0
        for i in range(before):
            value = weight[i] + share * (affine[i] - weight[i])
            if value > _NO_WEIGHT:
                weight[count] = value
                corners[count, 0], corners[count, 1] = corners[i, 0], corners[i, 1]
                for k in range(3):
                    simplex[count, k] = simplex[i, k]
                count += 1
    for k in range(3):
        out[k] = 0.0
        for i in range(count):
            out[k] += weight[i] * simplex[i, k]
    return 0 if count == 4 else count


@compiled
def _write_affine_weights(simplex: Array, count: int, weight: Array) -> bool:
    """Write weights (count,) of the point nearest to the origin in the plane through all corners.

    Returns:
        Whether the corners are independent; else nothing is written.
    """
    n = count - 1
    system = np.empty((3, 4))  # of the normal equations, with their right-hand side
    for i in range(n):
        for j in range(n + 1):
            system[i, j] = 0.0
            for k in range(3):
                to = simplex[j, k] - simplex[n, k] if j < n else -simplex[n, k]
                system[i, j] += (simplex[i, k] - simplex[n, k]) * to
    for i in range(n):
        length = system[i, i]
        for j in range(i):
            share = system[i, j] / system[j, j]
            for k in range(j, n + 1):
                system[i, k] -= share * system[j, k]
        if not system[i, i] > _FLAT * length:
            return False
    last = 1.0
    for i in range(n - 1, -1, -1):
        value = system[i, n]
        for j in range(i + 1, n):
            value -= system[i, j] * weight[j]
        weight[i] = value / system[i, i]
        last -= weight[i]
    weight[n] = last
    return True
