"""The point of a box nearest to a wanted one, by rows that hold as far as they can."""

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.cholesky import factorise, solve_factorised
from densarm.values.kernels import compiled, compiled_part

_ROUNDS = 60
_SEARCHES = 30
_SHORTEST = 1e-11  # step, at which it has converged


@compiled
def nearest_in_box(
    wanted: Array, rows: Array, least: Array, low: Array, high: Array, weight: float, x: Array
) -> bool:
    r"""Write the nearest point, and return whether it was found in some 60 rounds.

    .. math::

        \min_{l \le x \le u} \tfrac12 \|x - x_{wanted}\|^2
        + \tfrac w2 \sum_k \max(0, b_k - n_k \cdot x)^2

    By Newton steps on the free coordinates, each as long as it leads down: the function is
    quadratic in pieces, so that it ends at the minimum. Its time does not grow with the number of
    rows that cannot hold, as that of a dual active-set method does.

    Args:
        wanted: (n,).
        rows: n_k, of length one (K, n).
        least: b_k (K,).
        low: l (n,).
        high: u (n,).
        weight: w of a row's lack.
        x: the point (n,), which is in the box in any case.

    Source: D. Bertsekas, Projected Newton Methods for Optimization Problems with Simple
        Constraints, SIAM J. Control and Optimization 20(2), 1982.
    """
    n, count = x.size, least.size
    hessian, gradient, step = np.empty((n, n)), np.empty(n), np.empty(n)
    spare, along, is_free = np.empty(count), np.empty(count), np.empty(n, np.bool_)
    for i in range(n):
        x[i] = min(max(wanted[i], low[i]), high[i])
    for _ in range(_ROUNDS):
        _expand(wanted, rows, least, weight, x, spare, gradient, hessian)
        longest, share = _free_step(x, low, high, gradient, hessian, is_free, step)
        if longest <= _SHORTEST:
            return True
        for k in range(count):
            along[k] = 0.0
            for i in range(n):
                along[k] += rows[k, i] * step[i]
        share = _way_down(x, wanted, step, spare, along, weight, share)
        for i in range(n):
            x[i] = min(max(x[i] + share * step[i], low[i]), high[i])
    return False


@compiled_part
def _expand(
    wanted: Array,
    rows: Array,
    least: Array,
    weight: float,
    x: Array,
    spare: Array,
    gradient: Array,
    hessian: Array,
) -> None:
    """Write n_k · x - b_k (K,), gradient (n,) and the lower triangle of the Hessian (n, n)."""
    n = x.size
    for i in range(n):
        gradient[i] = x[i] - wanted[i]
        for j in range(i):
            hessian[i, j] = 0.0
        hessian[i, i] = 1.0
    for k in range(spare.size):
        left = -least[k]
        for i in range(n):
            left += rows[k, i] * x[i]
        spare[k] = left
        if left < 0.0:
            for i in range(n):
                scaled = weight * rows[k, i]
                gradient[i] += scaled * left
                for j in range(i + 1):
                    hessian[i, j] += scaled * rows[k, j]


@compiled_part
def _free_step(
    x: Array,
    low: Array,
    high: Array,
    gradient: Array,
    hessian: Array,
    is_free: NDArray[np.bool_],
    step: Array,
) -> tuple[float, float]:
    """Write a step that leaves no bound it is at; return its longest entry, and how far it goes."""
    n = x.size
    for i in range(n):
        is_free[i] = (x[i] > low[i] or gradient[i] < 0.0) and (x[i] < high[i] or gradient[i] > 0.0)
    leaves = True
    while leaves:
        _newton_step(hessian, gradient, is_free, step)
        leaves = False
        for i in range(n):
            if (x[i] <= low[i] and step[i] < 0.0) or (x[i] >= high[i] and step[i] > 0.0):
                is_free[i], leaves = False, True
    longest, share = 0.0, 1.0
    for i in range(n):
        longest = max(longest, abs(step[i]))
        if step[i] != 0.0:
            bound = high[i] if step[i] > 0.0 else low[i]
            share = min(share, (bound - x[i]) / step[i])
    return longest, share


@compiled_part
def _way_down(
    x: Array,
    wanted: Array,
    step: Array,
    spare: Array,
    along: Array,
    weight: float,
    longest: float,
) -> float:
    """Return the share of a step, up to the longest, at which the function is least."""
    begin, end, share = 0.0, longest, longest
    for _ in range(_SEARCHES):
        slope, curve = 0.0, 0.0
        for i in range(x.size):
            slope += step[i] * (x[i] + share * step[i] - wanted[i])
            curve += step[i] * step[i]
        steepest = curve
        for k in range(spare.size):
            left = spare[k] + share * along[k]
            if left < 0.0:
                slope += weight * left * along[k]
                curve += weight * along[k] * along[k]
        if slope > 0.0:
            end = share
        elif share == longest:
            break
        else:
            begin = share
        if abs(slope) <= 1e-13 * steepest:
            break
        share -= slope / curve
        if not begin < share < end:
            share = 0.5 * (begin + end)
    return share


@compiled_part
def _newton_step(hessian: Array, gradient: Array, is_free: NDArray[np.bool_], step: Array) -> None:
    """Write the step of the free coordinates, by Cholesky's method; others stay."""
    n = step.size
    square = np.empty((n, n))
    for i in range(n):
        step[i] = -gradient[i] if is_free[i] else 0.0
        for j in range(i + 1):
            square[j, i] = 1.0 if i == j else 0.0
            if is_free[i] and is_free[j]:
                square[j, i] = hessian[i, j]
    factorise(square, square)
    solve_factorised(square, step)
