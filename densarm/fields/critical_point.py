"""Critical points of a density: found by Newton's method, told apart by the Hessian."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np

from densarm.arrays import Array
from densarm.density.gauge import Gauge


class LogDensity(Protocol):
    """A density on Rⁿ, or one in coordinates around a configuration."""

    def gradient(self, x: Array, gauge: Gauge) -> Array:
        """Return the gradient in a gauge at points `x` (..., n)."""
        ...


class CriticalKind(StrEnum):
    """What the signs of the Hessian's eigenvalues tell of a critical point of ρ."""

    MAXIMUM = "maximum"
    """All negative: starts around it get stuck."""
    SADDLE = "saddle"
    """Of both signs: it attracts a set of measure zero."""
    MINIMUM = "minimum"
    """All positive."""
    DEGENERATE = "degenerate"
    """Some zero to the accuracy of the differences, which leave the others possible."""


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
    density: LogDensity, guess: Array, step: float = 1e-5, iterations: int = 50
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
    hessian, coarse = log_hessian(density, x, step), log_hessian(density, x, 2.0 * step)
    values, vectors = np.linalg.eigh(hessian)
    eigenvalues: Array = values.astype(np.float64)
    error = np.abs(((coarse - hessian) @ vectors * vectors).sum(axis=0))
    slope = float(np.linalg.norm(density.gradient(x, Gauge.LOG)))
    return CriticalPoint(x, slope, eigenvalues, _kind(eigenvalues, error))


def log_hessian(density: LogDensity, x: Array, step: float = 1e-5) -> Array:
    """Return the Hessian of ln ρ at `x` (n,) by central differences of its gradient, (n, n)."""
    axes = step * np.eye(x.size)
    ahead, behind = (density.gradient(x + sign * axes, Gauge.LOG) for sign in (1.0, -1.0))
    hessian = (ahead - behind) / (2.0 * step)
    return 0.5 * (hessian + hessian.T)


def _kind(eigenvalues: Array, error: Array) -> CriticalKind:
    """Return what eigenvalues tell whose errors to first order are given."""
    zero = np.abs(eigenvalues) <= np.maximum(3.0 * error, 1e-9 * np.abs(eigenvalues).max())
    rises, falls = (eigenvalues > 0.0) & ~zero, (eigenvalues < 0.0) & ~zero
    if rises.any() and falls.any():
        return CriticalKind.SADDLE
    if zero.any():
        return CriticalKind.DEGENERATE
    return CriticalKind.MINIMUM if rises.any() else CriticalKind.MAXIMUM


LONGEST_MOVE = 0.1
"""Longest move of one iteration [m]."""
