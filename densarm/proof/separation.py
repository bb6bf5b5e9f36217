"""Separation: lower bounds on the distance of two convex bodies, each by a plane between them."""

import math

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.proof.rounded_hulls import farthest_corner

ACCURACY = 0.01
"""Share of the distance that a bound may fall short of it by."""

_ITERATIONS = 40
_CONTACT = 1e-9  # [m], closer than this no plane is looked for
_NO_WEIGHT = 1e-12
_FLAT = 1e-12  # of a corner's squared distance, what may be left of it beside the others


@compiled
def separation(
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    pose: Array,
    i: int,
    j: int,
    needed: float,
    enough: float,
    corners: NDArray[np.int64],
    pair: int,
    simplex: Array,
    system: Array,
    normals: Array,
    row: int,
) -> float:
    r"""Return a lower bound on the distance of hulls A and B, zero where they may touch.

    For every unit vector n,

    .. math:: d(A, B) \ge \min_{a \in A} n \cdot a - \max_{b \in B} n \cdot b,

    so that any n whose right-hand side is positive is a proof, however it was found. Here it is
    improved by the algorithm of Gilbert, Johnson and Keerthi until the bound is within `ACCURACY`
    of the distance, or enough, or the distance is less than what is needed. Corners are climbed to
    along edges. Radii are not taken off.

    Args:
        points: corners of all hulls (P, 3) [m].
        neighbours: see `RoundedHulls` (E,).
        first_neighbour: see `RoundedHulls` (P + 1,).
        pose: of all hulls in the world (S, 12).
        i: index of A.
        j: index of B.
        needed: a distance below which the bound does not matter [m].
        enough: a bound that need not be improved [m].
        corners: of all pairs (K, 4, 2): pairs of corners, -1 where there is none, whose differences
            span a simplex near the origin, at least one; a guess, such as the last call's, that is
            improved.
        pair: which of them this is.
        simplex: space to work in (4, 4).
        system: space to work in (4, 4).
        normals: in a row of it (., 3) the plane's unit normal, from B to A, in the world, is
            written if the bound is positive.
        row: which row.

    Returns:
        The bound [m], >= 0.

    Source: Gilbert, Johnson, Keerthi, A Fast Procedure for Computing the Distance Between Complex
        Objects in Three-Dimensional Space, IEEE J. Robotics and Automation 1988.
    """
    count = _write_simplex(points, pose, i, j, corners, pair, simplex)
    best = 0.0
    for _ in range(_ITERATIONS):
        count = _approach_origin(simplex, system, corners, pair, count)
        x = y = z = 0.0
        for k in range(count):
            x += simplex[k, 3] * simplex[k, 0]
            y += simplex[k, 3] * simplex[k, 1]
            z += simplex[k, 3] * simplex[k, 2]
        norm = math.sqrt(x * x + y * y + z * z)
        if count == 4 or norm < _CONTACT:  # the bodies may overlap
            count = 3 if count == 4 else count
            break
        last = count - 1
        corners[pair, count, 0] = farthest_corner(
            points, neighbours, first_neighbour, pose, i, corners[pair, last, 0], -x, -y, -z
        )
        corners[pair, count, 1] = farthest_corner(
            points, neighbours, first_neighbour, pose, j, corners[pair, last, 1], x, y, z
        )
        _write_difference(points, pose, i, j, corners, pair, count, simplex)
        gap = (x * simplex[count, 0] + y * simplex[count, 1] + z * simplex[count, 2]) / norm
        if gap > best:
            best = gap
            normals[row, 0], normals[row, 1], normals[row, 2] = x / norm, y / norm, z / norm
        if norm <= needed or _is_known(corners, pair, count):
            break
        simplex[count, 3] = 0.0
        count += 1
        if best >= enough or best >= (1.0 - ACCURACY) * norm:
            break
    for k in range(count, 4):
        corners[pair, k, 0] = corners[pair, k, 1] = -1
    return best


@compiled
def plane_gap(
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    pose: Array,
    i: int,
    j: int,
    corner_i: int,
    corner_j: int,
    x: float,
    y: float,
    z: float,
) -> float:
    """Return how far hull i is beyond hull j along a unit vector (x, y, z) of the world [m].

    Corners to start climbing from are given; other arguments as for `separation`.
    """
    a = farthest_corner(points, neighbours, first_neighbour, pose, i, corner_i, -x, -y, -z)
    b = farthest_corner(points, neighbours, first_neighbour, pose, j, corner_j, x, y, z)
    return _height(points, pose, i, a, x, y, z) - _height(points, pose, j, b, x, y, z)


@compiled
def _height(
    points: Array, pose: Array, hull: int, corner: int, x: float, y: float, z: float
) -> float:
    """Return where a corner of a hull is along (x, y, z) of the world [m]."""
    height: float = pose[hull, 9] * x + pose[hull, 10] * y + pose[hull, 11] * z
    for k in range(3):
        along = pose[hull, k] * x + pose[hull, 3 + k] * y + pose[hull, 6 + k] * z
        height += along * points[corner, k]
    return height


@compiled
def _write_simplex(
    points: Array,
    pose: Array,
    i: int,
    j: int,
    corners: NDArray[np.int64],
    pair: int,
    simplex: Array,
) -> int:
    """Write the differences of a pair's corners, all weight on the first; return their number."""
    count = 0
    for k in range(4):
        if corners[pair, k, 0] >= 0:
            _write_difference(points, pose, i, j, corners, pair, k, simplex)
            simplex[k, 3] = 0.0 if k else 1.0
            count = k + 1
    return count


@compiled
def _write_difference(
    points: Array,
    pose: Array,
    i: int,
    j: int,
    corners: NDArray[np.int64],
    pair: int,
    row: int,
    simplex: Array,
) -> None:
    a, b = corners[pair, row, 0], corners[pair, row, 1]
    for k in range(3):
        difference = pose[i, 9 + k] - pose[j, 9 + k]
        for n in range(3):
            difference += pose[i, 3 * k + n] * points[a, n] - pose[j, 3 * k + n] * points[b, n]
        simplex[row, k] = difference


@compiled
def _is_known(corners: NDArray[np.int64], pair: int, count: int) -> bool:
    """Return whether the corners at an index are among those before it."""
    for k in range(count):
        if (
            corners[pair, k, 0] == corners[pair, count, 0]
            and corners[pair, k, 1] == corners[pair, count, 1]
        ):
            return True
    return False


@compiled
def _approach_origin(
    simplex: Array, system: Array, corners: NDArray[np.int64], pair: int, count: int
) -> int:
    """Reduce a simplex to a face whose plane is nearest to the origin inside that face.

    Args:
        simplex: its corners and their weights >= 0 (4, 4): the point to start from; overwritten by
            the nearest point, corners that are kept moved to the front.
        system: space to work in (4, 4).
        corners: what the corners are differences of (K, 4, 2), moved alike.
        pair: which of them this is.
        count: number of corners.

    Returns:
        The number of corners left; 4 if the origin is inside the tetrahedron.

    Source: Wolfe, Finding the Nearest Point in a Polytope, Mathematical Programming 1976.
    """
    before = 0
    while count != before:
        before = count
        if not _write_affine_weights(simplex, system, count):
            count -= 1  # the newest corner depends on the others
            continue
        share = 1.0
        for k in range(count):
            weight, affine = simplex[k, 3], system[3, k]
            if affine <= 0.0:
                part = weight / (weight - affine)
                share = min(share, part)
        count = 0
        for k in range(before):
            value = simplex[k, 3] + share * (system[3, k] - simplex[k, 3])
            if value > _NO_WEIGHT:
                for n in range(3):
                    simplex[count, n] = simplex[k, n]
                simplex[count, 3] = value
                corners[pair, count, 0] = corners[pair, k, 0]
                corners[pair, count, 1] = corners[pair, k, 1]
                count += 1
    return count


@compiled
def _write_affine_weights(simplex: Array, system: Array, count: int) -> bool:
    """Write weights of the point nearest to the origin in the plane through all corners.

    Args:
        simplex: the corners (4, 3 or more).
        system: the weights are written to its last row, the others are space to work in (4, 4).
        count: number of corners.

    Returns:
        Whether the corners are independent; else no weights are written.
    """
    n = count - 1
    for i in range(n):
        for j in range(n + 1):
            total = 0.0
            for k in range(3):
                end = simplex[j, k] if j < n else 0.0
                total += (simplex[i, k] - simplex[n, k]) * (end - simplex[n, k])
            system[i, j] = total
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
            value -= system[i, j] * system[3, j]
        system[3, i] = value / system[i, i]
        last -= system[3, i]
    system[3, n] = last
    return True
