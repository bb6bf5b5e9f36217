"""Critical points of a density: found by Newton's method, told apart, and what blocks there."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import partial

import numpy as np
from numpy.typing import NDArray

from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.navigation_density import NavigationDensity
from densarm.density.unsafe_sets import ClearanceSet, JointLimitSet
from densarm.values.arrays import Array

LONGEST_MOVE = 0.1
"""Longest move of one iteration of Newton's method [m]."""

_SEARCH_STEPS = 8
_FARTHEST = 0.05  # [rad or m] from the arm's rest to the critical point that it rests at
_FLAT = 1e-6  # of the pull of the goal, or [1/rad] where that is less than one
_BESIDE = 1e-3  # [rad or m] from a critical point that a curve is led to
_UNTOLD = 1e-9  # slope [1/rad] at and below which ∇ ln ρ tells no side of a critical point
_NAMED = 5  # blocking members at most


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
    gradient: Callable[[Array], Array],
    guess: Array,
    step: float = 1e-5,
    iterations: int = 50,
    farthest: float = np.inf,
) -> CriticalPoint:
    r"""Solve ∇ ln ρ = 0 by Newton's method.

    .. math:: x \leftarrow x - H^{-1} \nabla\ln\rho, \qquad
        H_{ij} \approx \frac{\partial_i \ln\rho(x + \epsilon \mathbf{e}_j)
        - \partial_i \ln\rho(x - \epsilon \mathbf{e}_j)}{2 \epsilon}

    At a critical point the Hessians of ρ, ln ρ and −1/ρ are positive multiples of each other.

    Args:
        gradient: points (..., n) to ∇ ln ρ there (..., n).
        guess: where to begin, shape (n,) [m]; at most `LONGEST_MOVE` is gone in one iteration.
        step: ε [m].
        iterations: most iterations.
        farthest: from the guess, beyond which the search ends [m].

    Returns:
        The last point, whose `slope` tells whether it is critical.
    """
    x = np.array(guess, np.float64)
    for _ in range(iterations):
        move = np.linalg.lstsq(log_hessian(gradient, x, step), -gradient(x), rcond=None)[0]
        length = float(np.linalg.norm(move))
        x = x + move * min(1.0, LONGEST_MOVE / max(length, 1e-300))
        if length < 1e-14 or np.abs(x - guess).max() > farthest:
            break
    eigenvalues, _, zero = _eigensystem(gradient, x, step)
    slope = float(np.linalg.norm(gradient(x)))
    return CriticalPoint(x, slope, eigenvalues, _kind(eigenvalues, zero))


def unstable_direction(
    gradient: Callable[[Array], Array], x: Array, step: float = 1e-5
) -> Array | None:
    """Return the direction (n,) in which ∇ ln ρ leads away the fastest from a critical point.

    It is the eigenvector of the largest eigenvalue of the Hessian of ln ρ. Of both signs it has the
    one in which ρ grows, or where that is not told by ∇ ln ρ, the one that makes the first of its
    large entries positive. None where no eigenvalue is positive, as nothing leads away from a
    maximum, and where by Newton's method the point is not beside a critical one.

    Args:
        gradient: points (..., n) to ∇ ln ρ there (..., n).
        x: the point (n,) [m].
        step: of the differences [m].
    """
    eigenvalues, vectors, zero = _eigensystem(gradient, x, step)
    slope = gradient(x) @ vectors
    off = np.linalg.norm(slope[~zero] / eigenvalues[~zero])
    if zero[-1] or eigenvalues[-1] < 0.0 or off > _BESIDE:
        return None
    direction = vectors[:, -1]
    large = direction[np.abs(direction) >= 0.5 * np.abs(direction).max()]
    side = np.copysign(1.0, slope[-1] if abs(slope[-1]) > _UNTOLD else large[0])
    return np.asarray(side * direction)


def log_hessian(gradient: Callable[[Array], Array], x: Array, step: float = 1e-5) -> Array:
    """Return the Hessian of ln ρ at `x` (n,) by central differences of its gradient, (n, n)."""
    axes = step * np.eye(x.size)
    hessian = (gradient(x + axes) - gradient(x - axes)) / (2.0 * step)
    return 0.5 * (hessian + hessian.T)


def _eigensystem(
    gradient: Callable[[Array], Array], x: Array, step: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return eigenvalues and -vectors of the Hessian of ln ρ, and which count as zero."""
    hessian, coarse = log_hessian(gradient, x, step), log_hessian(gradient, x, 2.0 * step)
    values, vectors = np.linalg.eigh(hessian)
    error = np.abs(((coarse - hessian) @ vectors * vectors).sum(axis=0))
    zero = np.abs(values) <= np.maximum(3.0 * error, 1e-9 * np.abs(values).max())
    return values.astype(np.float64), vectors, zero


def _kind(eigenvalues: Array, zero: NDArray[np.bool_]) -> CriticalKind:
    """Return what eigenvalues tell, some of which count as zero."""
    rises, falls = (eigenvalues > 0.0) & ~zero, (eigenvalues < 0.0) & ~zero
    if rises.any() and falls.any():
        return CriticalKind.SADDLE
    if zero.any():
        return CriticalKind.DEGENERATE
    return CriticalKind.MINIMUM if rises.any() else CriticalKind.MAXIMUM


@dataclass(frozen=True)
class Stall:
    """Where an arm rests away from its goal."""

    angles: Array
    """Joint positions (nv,) [rad or m]."""
    slope: float
    """‖∇ ln ρ‖ there [1/rad or 1/m]."""
    kind: CriticalKind | None
    """Of the critical point of ρ at which or near which that is; None where none was found."""
    blocking: tuple[str, ...]
    """Pairs and joint limits whose bumps oppose the pull of the goal, the strongest first."""

    @property
    def description(self) -> str:
        """Return the stall as a phrase."""
        where = ", ".join(f"{angle:.4g}" for angle in self.angles)
        blocked = ", ".join(self.blocking[:_NAMED]) or "nothing sensed there"
        return (
            f"{_PHRASES[self.kind]} the density at joint positions ({where}), where "
            f"|grad ln rho| = {self.slope:.2g}; blocked by {blocked}"
        )


_PHRASES = {
    CriticalKind.MAXIMUM: "maximum of",
    CriticalKind.SADDLE: "saddle of",
    CriticalKind.MINIMUM: "minimum of",
    CriticalKind.DEGENERATE: "critical point (maximum or saddle: not decided) of",
    None: "no ascent (maximum or saddle: not decided) along",
}


def find_stall(
    density: NavigationDensity, clearance_set: ClearanceSet, limit_set: JointLimitSet, q: Array
) -> Stall:
    """Return why a density leads nowhere from a configuration (nq,), to which it is left updated.

    A critical point is looked for by Newton's method from there, and named by the signs of the
    eigenvalues of the Hessian of ln ρ, by central differences of its gradient. What blocks is
    looked for among the members of both unsafe sets.
    """
    arm = clearance_set.world.arm
    gradient = partial(density.log_gradients, q)
    guess = np.zeros(arm.nv)
    point = find_critical_point(gradient, guess, 1e-5, _SEARCH_STEPS, _FARTHEST)
    sample = density.evaluate(q)
    distance = max(sample.goal_distance, 1e-300)
    pull = -density.parameters.alpha * sample.goal_distance_gradient / distance
    is_here = np.abs(point.position).max() <= _FARTHEST
    is_here &= point.slope <= _FLAT * max(1.0, float(np.linalg.norm(pull)))
    theta = density.parameters.theta
    blocking = sorted(_opposing(clearance_set, limit_set, theta, q, pull), reverse=True)
    return Stall(
        angles=arm.angles(q),
        slope=float(np.linalg.norm(sample.log_gradient)),
        kind=point.kind if is_here else None,
        blocking=tuple(name for _, name in blocking),
    )


def _opposing(
    clearance_set: ClearanceSet, limit_set: JointLimitSet, theta: float, q: Array, pull: Array
) -> Iterator[tuple[float, str]]:
    """Yield how strongly each bump opposes the pull, where it does, and its name."""
    arm, sample = clearance_set.world.arm, clearance_set.world.clearance(q)
    for k, width in enumerate(clearance_set.sensing_distance):
        _, slope = log_inverse_bump(sample.distance[k] - clearance_set.margin, width, theta)
        against = -slope * float(sample.gradient[k] @ pull)
        if against > 0.0:
            yield against, " and ".join(sample.pairs[k])
    for (j, at), (bound, side, width) in zip(limit_set.index.T, limit_set.member.T, strict=True):
        _, slope = log_inverse_bump(side * (q[at] - bound), width, theta)
        against = -slope * side * float(pull[j])
        if against > 0.0:
            end = "lower" if side > 0.0 else "upper"
            yield against, f"the {end} limit of joint {arm.joint_names[j]!r}"
