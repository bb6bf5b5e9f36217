"""The point of a simplex nearest to the origin, with which distances of hulls are found."""

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part

Integers = NDArray[np.int64]

_NO_WEIGHT = 1e-12
_FLAT = 1e-12  # of a corner's squared distance, what may be left of it beside the others


@compiled_lean_part
def approach_origin(simplex: Array, system: Array, corners: Integers, count: int) -> int:
    """Reduce a simplex to a face whose plane is nearest to the origin inside that face.

    Args:
        simplex: its corners and their weights >= 0 (4, 4): the point to start from; overwritten by
            the nearest point, corners that are kept moved to the front.
        system: space to work in (4, 4); the nearest point is written to its first row.
        corners: what the corners are differences of (4, 2), moved alike.
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
                share = min(share, weight / (weight - affine))
        count = 0
        for k in range(before):
            value = simplex[k, 3] + share * (system[3, k] - simplex[k, 3])
            if value > _NO_WEIGHT:
                for n in range(3):
                    simplex[count, n] = simplex[k, n]
                simplex[count, 3] = value
                corners[count, 0], corners[count, 1] = corners[k, 0], corners[k, 1]
                count += 1
    for axis in range(3):
        system[0, axis] = 0.0
        for k in range(count):
            system[0, axis] += simplex[k, 3] * simplex[k, axis]
    return count


@compiled_lean_part
def _write_affine_weights(simplex: Array, system: Array, count: int) -> bool:
    """Write weights of the point nearest to the origin in the plane through all corners.

    They go to the last row of `system`; none are written, and False is returned, where the corners
    are not independent. Arguments as for `approach_origin`.
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
