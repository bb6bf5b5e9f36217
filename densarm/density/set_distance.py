"""Distances between sets on Rⁿ that implicit functions describe."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from densarm.arrays import Array
from densarm.density.implicit_function import ImplicitFunction


def boundary_points(function: ImplicitFunction, extent: Array, count: int, seed: int = 0) -> Array:
    """Return points of {f = 0} in a box, found from random points by Newton's method along ∇f.

    Args:
        function: f.
        extent: bounds of the box, shape (n, 2) [m].
        count: random points; some find no boundary, or find it out of the box.
        seed: of the random points.

    Returns:
        Shape (M, n), M ≤ count [m].
    """
    x = np.random.default_rng(seed).uniform(extent[:, 0], extent[:, 1], (count, len(extent)))
    longest = 0.1 * float(np.ptp(extent, axis=1).max())
    for _ in range(_ITERATIONS):
        gradient = function.gradient(x)
        square = np.maximum(np.sum(gradient**2, axis=-1, keepdims=True), 1e-300)
        move = -function(x)[:, np.newaxis] * gradient / square
        length = np.linalg.norm(move, axis=-1, keepdims=True)
        x = x + move * np.minimum(1.0, longest / np.maximum(length, 1e-300))
    inside = ((x >= extent[:, 0]) & (x <= extent[:, 1])).all(axis=1)
    # The next move tells how far off the boundary a point still is.
    found: Array = x[inside & (length[:, 0] < _TOLERANCE)]
    return found


@dataclass(frozen=True)
class Gap:
    """How far apart the nearest two of several sets are."""

    distance: float
    """Of the nearest two [m]; 0 if any two overlap, +inf of fewer than two."""
    overlaps: int
    """Pairs that overlap."""


def smallest_gap(
    pairs: Iterable[tuple[ImplicitFunction, ImplicitFunction, Array, Array]],
) -> Gap:
    r"""Find the nearest two of pairs of sets whose boundaries were sampled.

    .. math:: \min \|x - y\| \quad \text{subject to} \quad f(x) = 0,\ g(y) = 0

    by SLSQP from the nearest samples of the `POLISHED` nearest pairs: an upper bound, exact where
    those are near the nearest points of all. Two sets overlap if a sample of either lies in the
    other.

    Args:
        pairs: f, g and points of their boundaries, (M, n) and (L, n) [m].
    """
    from scipy.spatial import KDTree

    candidates, overlaps = [], 0
    for first, second, x, y in pairs:
        if min(len(x), len(y)) == 0:
            continue
        if (first(y) <= 0.0).any() or (second(x) <= 0.0).any():
            overlaps += 1
            continue
        distance, nearest = KDTree(y).query(x)
        start = int(np.argmin(distance))
        guess = np.concatenate([x[start], y[nearest[start]]])
        candidates.append((float(distance[start]), (first, second), guess))
    if overlaps:
        return Gap(0.0, overlaps)
    candidates.sort(key=lambda candidate: candidate[0])
    polished = [_polished(sets, guess, d) for d, sets, guess in candidates[:POLISHED]]
    return Gap(min(polished, default=float("inf")), 0)


POLISHED = 5
"""Pairs whose distance is made exact."""


def distance_from(point: Array, function: ImplicitFunction, boundary: Array) -> float:
    """Return the distance of a point (n,) from a set with a sampled boundary [m]; 0 inside."""
    if function(point) <= 0.0:
        return 0.0
    if len(boundary) == 0:
        return float("inf")
    distance = np.linalg.norm(boundary - point, axis=1)
    guess = np.concatenate([point, boundary[np.argmin(distance)]])
    return _polished((None, function), guess, float(distance.min()))


def _polished(
    functions: tuple[ImplicitFunction | None, ImplicitFunction], guess: Array, sampled: float
) -> float:
    """Return the least ‖x − y‖ near a guess (x, y); without a first function x is fixed."""
    from scipy.optimize import minimize

    n = guess.size // 2
    parts = (guess[:n], guess[n:])

    def split(z: Array) -> tuple[Array, Array]:
        return (parts[0], z) if functions[0] is None else (z[:n], z[n:])

    def square(z: Array) -> tuple[float, Array]:
        x, y = split(z)
        slope = 2.0 * (y - x)
        return float((x - y) @ (x - y)), z_of(-slope, slope)

    def z_of(x_part: Array, y_part: Array) -> Array:
        return y_part if functions[0] is None else np.concatenate([x_part, y_part])

    zero = np.zeros(n)
    constraints: list[dict[str, Any]] = []
    for index, function in enumerate(functions):
        if function is not None:
            scale = 1.0 / max(float(np.linalg.norm(function.gradient(parts[index]))), 1e-12)
            constraints.append(
                {
                    "type": "eq",
                    "fun": lambda z, f=function, i=index, s=scale: s * float(f(split(z)[i])),
                    "jac": lambda z, f=function, i=index, s=scale: z_of(
                        *(s * f.gradient(split(z)[i]) if i == k else zero for k in (0, 1))
                    ),
                }
            )
    found = minimize(square, z_of(*parts), jac=True, method="SLSQP", constraints=constraints)
    violation = max(abs(each["fun"](found.x)) for each in constraints)
    polished = float(np.linalg.norm(np.subtract(*split(found.x))))
    return polished if violation < 1e-6 and polished <= sampled else sampled


_ITERATIONS = 60
_TOLERANCE = 1e-9  # of points of a boundary [m]
