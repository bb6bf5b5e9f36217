"""Critical points of a density on Rⁿ: found by Newton's method, told apart by the Hessian."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from densarm.arrays import Array
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.gauge import Gauge


class CriticalKind(StrEnum):
    """What the signs of the Hessian's eigenvalues tell of a critical point of ρ."""

    MAXIMUM = "maximum"
    """All negative: starts around it get stuck."""
    SADDLE = "saddle"
    """Of both signs: it attracts a set of measure zero."""
    MINIMUM = "minimum"
    """All positive."""
    DEGENERATE = "degenerate"
    """Some zero to the accuracy of the differences."""


@dataclass(frozen=True)
class CriticalPoint:
    """Where Newton's method ended."""

    position: Array
    """x, shape (n,) [m]."""
    slope: float
    """‖∇ ln ρ(x)‖ [1/m]; not small where the method failed."""
    eigenvalues: Array
    """Of the Hessian of ln ρ, ascending, shape (n,) [1/m²]."""
    kind: CriticalKind
    """Their signs in a word."""


def find_critical_point(
    density: EuclideanDensity, guess: Array, step: float = 1e-5, iterations: int = 50
) -> CriticalPoint:
    r"""Solve ∇ ln ρ = 0 by Newton's method.

    .. math:: x \leftarrow x - H^{-1} \nabla\ln\rho, \qquad
        H_{ij} \approx \frac{\partial_i \ln\rho(x + \epsilon \mathbf{e}_j)
        - \partial_i \ln\rho(x - \epsilon \mathbf{e}_j)}{2 \epsilon}

    At a critical point the Hessians of ρ, ln ρ and −1/ρ are positive multiples of each other.

    Args:
        density: the density.
        guess: where to begin, shape (n,) [m]; at most `LONGEST_MOVE` is gone in one iteration.
        step: ε [m].
        iterations: most iterations.

    Returns:
        The last point, whose `slope` tells whether it is critical.
    """
    x = np.array(guess, np.float64)
    for _ in range(iterations):
        gradient = density.gradient(x, Gauge.LOG)
        move = np.linalg.lstsq(log_hessian(density, x, step), -gradient, rcond=None)[0]
        length = float(np.linalg.norm(move))
        x = x + move * min(1.0, LONGEST_MOVE / max(length, 1e-300))
        if length < 1e-14:
            break
    eigenvalues: Array = np.linalg.eigvalsh(log_hessian(density, x, step)).astype(np.float64)
    slope = float(np.linalg.norm(density.gradient(x, Gauge.LOG)))
    return CriticalPoint(x, slope, eigenvalues, _kind(eigenvalues))


def log_hessian(density: EuclideanDensity, x: Array, step: float = 1e-5) -> Array:
    """Return the Hessian of ln ρ at `x` (n,) by central differences of its gradient, (n, n)."""
    axes = step * np.eye(x.size)
    ahead, behind = (density.gradient(x + sign * axes, Gauge.LOG) for sign in (1.0, -1.0))
    hessian = (ahead - behind) / (2.0 * step)
    return 0.5 * (hessian + hessian.T)


def _kind(eigenvalues: Array) -> CriticalKind:
    if np.abs(eigenvalues).min() <= 1e-6 * np.abs(eigenvalues).max():
        return CriticalKind.DEGENERATE
    if eigenvalues[0] > 0.0:
        return CriticalKind.MINIMUM
    return CriticalKind.MAXIMUM if eigenvalues[-1] < 0.0 else CriticalKind.SADDLE


LONGEST_MOVE = 0.1
"""Longest move of one iteration [m]."""
