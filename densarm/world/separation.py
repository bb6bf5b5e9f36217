"""Separation: lower bounds on the distance of two convex bodies, each by a plane between them."""

import math

from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part
from densarm.world.bodies import Bodies
from densarm.world.hulls import farthest_corner
from densarm.world.simplex import Integers, approach_origin

ACCURACY = 0.01
"""Share of the distance that a bound may fall short of it by."""

_ITERATIONS = 40
_CONTACT = 1e-9  # [m], closer than this no plane is looked for


@compiled_lean_part
def separation(
    bodies: Bodies,
    pose: Array,
    i: int,
    j: int,
    needed: float,
    enough: float,
    corners: Integers,
    work: Array,
    normal: Array,
) -> float:
    r"""Return a lower bound on the distance of hulls A and B, zero where they may touch.

    For every unit vector n,

    .. math:: d(A, B) \ge \min_{a \in A} n \cdot a - \max_{b \in B} n \cdot b,

    so that any n whose right-hand side is positive is a proof, however it was found. Here it is
    improved by the algorithm of Gilbert, Johnson and Keerthi until the bound is within `ACCURACY`
    of the distance, or enough, or the distance is less than what is needed. Corners are climbed to
    along edges. Radii are not taken off.

    Args:
        bodies: their `points` and `edges` are used.
        pose: of all hulls in the world (S, 12).
        i: index of A.
        j: index of B.
        needed: a distance below which the bound does not matter [m].
        enough: a bound that need not be improved [m].
        corners: pairs of corners (4, 2), -1 where there is none, whose differences span a simplex
            near the origin, at least one; a guess, such as the last call's, that is improved.
        work: space to work in (8, 4).
        normal: the plane's unit normal (3,), from B to A, is written if the bound is positive.

    Returns:
        The bound [m], >= 0.

    Source: Gilbert, Johnson, Keerthi, A Fast Procedure for Computing the Distance Between Complex
        Objects in Three-Dimensional Space, IEEE J. Robotics and Automation 1988.
    """
    simplex, system, point = work[:4], work[4:], work[4]
    count = corners.shape[0]
    while corners[count - 1, 0] < 0:
        count -= 1
    for k in range(count):
        _write_difference(bodies.points, pose, i, j, corners, k, simplex)
        simplex[k, 3] = 0.0
    simplex[0, 3] = 1.0  # all weight on the first
    best = 0.0
    for _ in range(_ITERATIONS):
        count = approach_origin(simplex, system, corners, count)
        norm = math.sqrt(point[0] * point[0] + point[1] * point[1] + point[2] * point[2])
        if count == 4 or norm < _CONTACT:  # the bodies may overlap
            count = min(count, 3)
            break
        climb(bodies, pose, i, j, corners[count - 1], point, corners[count])
        _write_difference(bodies.points, pose, i, j, corners, count, simplex)
        x, y, z = simplex[count, 0], simplex[count, 1], simplex[count, 2]
        gap = (point[0] * x + point[1] * y + point[2] * z) / norm
        if gap > best:
            best = gap
            for axis in range(3):
                normal[axis] = point[axis] / norm
        if norm <= needed or _is_known(corners, count):
            break
        simplex[count, 3] = 0.0
        count += 1
        if best >= enough or best >= (1.0 - ACCURACY) * norm:
            break
    for k in range(count, 4):
        corners[k, 0] = corners[k, 1] = -1
    return best


@compiled_lean_part
def climb(
    bodies: Bodies,
    pose: Array,
    i: int,
    j: int,
    start: Integers,
    direction: Array,
    end: Integers,
) -> float:
    """Return how far hull A is beyond hull B along a vector of the world, times its length [m].

    Corners of A and B (2,) are climbed from along edges, and those at the end are written. Other
    arguments as for `separation`.
    """
    points, edges, beyond = bodies.points, bodies.edges, 0.0
    for side in range(2):
        hull, sign, corner = (j if side else i), 2.0 * side - 1.0, start[side]
        a = b = c = at = 0.0
        for k in range(3):
            x = sign * direction[k]
            a += pose[hull, 3 * k] * x
            b += pose[hull, 3 * k + 1] * x
            c += pose[hull, 3 * k + 2] * x
            at += pose[hull, 9 + k] * x
        end[side], best = farthest_corner(points, edges, corner, a, b, c)
        beyond -= best + at
    return beyond


@compiled_lean_part
def stays_apart(gap_a: float, gap_b: float, bend: float) -> bool:
    """Return whether a plane's gaps [m] at the middle and at an end of an arc prove that half.

    On it β of the whole arc counts a quarter, since it takes half the time.
    """
    if not (gap_a > 0.0 and gap_b > 0.0):
        return False
    root = math.sqrt(gap_a) + math.sqrt(gap_b)
    return bend < 8.0 * root * root


@compiled_lean_part
def _write_difference(
    points: Array, pose: Array, i: int, j: int, corners: Integers, row: int, simplex: Array
) -> None:
    a, b = corners[row, 0], corners[row, 1]
    for k in range(3):
        difference = pose[i, 9 + k] - pose[j, 9 + k]
        for n in range(3):
            difference += pose[i, 3 * k + n] * points[a, n] - pose[j, 3 * k + n] * points[b, n]
        simplex[row, k] = difference


@compiled_lean_part
def _is_known(corners: Integers, last: int) -> bool:
    """Return whether the last pair of corners is one of those before it."""
    for k in range(last):
        if corners[k, 0] == corners[last, 0] and corners[k, 1] == corners[last, 1]:
            return True
    return False
