"""Stall: where a density leads nowhere, what blocks it there, and whether ρ peaks."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.density import Gauge, GoalDistance, NavigationDensity, NearClearanceSet
from densarm.density.inverse_bump import log_inverse_bump
from densarm.fields.critical_point import CriticalKind, CriticalPoint, find_critical_point

_SEARCH_STEPS = 20
_FARTHEST = 0.05  # [rad or m] from the arm's rest to the critical point that it rests at
_FLAT = 1e-6  # of the pull of the goal, or [1/rad] where that is less than one
_NAMED = 5  # blocking members at most


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
    density: NavigationDensity[GoalDistance],
    clearance_set: NearClearanceSet,
    limits: Array,
    q: Array,
) -> Stall:
    """Return why a density leads nowhere from a configuration.

    A critical point is looked for by Newton's method from there, and named by the signs of the
    eigenvalues of the Hessian of ln ρ, by central differences of its gradient.

    Args:
        density: the density; left updated to q.
        clearance_set: its geometry pairs.
        limits: sensing distances of its joint limits (nv,) [rad or m].
        q: configuration (nq,).
    """
    clearance = clearance_set.pairs.clearance
    arm = clearance.arm
    point = find_critical_point(
        _Around(density, arm, q), np.zeros(arm.nv), iterations=_SEARCH_STEPS
    )
    density.update(q)
    clearance.update(q)
    gradient = np.empty(arm.nv)
    density.write_gradient(Gauge.LOG, gradient)
    pull = _pull(density)
    blocking = sorted(_opposing(density, clearance_set, limits, q, pull), reverse=True)
    return Stall(
        angles=arm.angles(q),
        slope=float(np.linalg.norm(gradient)),
        kind=point.kind if _is_here(point, float(np.linalg.norm(pull))) else None,
        blocking=tuple(name for _, name in blocking),
    )


class _Around:
    """ln ρ in the coordinates x of q ⊕ x."""

    def __init__(self, density: NavigationDensity[GoalDistance], arm: Arm, q: Array) -> None:
        self._density, self._arm, self._q = density, arm, q

    def gradient(self, x: Array, gauge: Gauge) -> Array:
        """Return the gradient at points x (..., nv)."""
        out = np.empty_like(x)
        for at, row in zip(x.reshape(-1, self._arm.nv), out.reshape(-1, self._arm.nv), strict=True):
            self._density.update(self._arm.integrate(self._q, at))
            self._density.write_gradient(gauge, row)
        return out


def _is_here(point: CriticalPoint, pull: float) -> bool:
    near = np.abs(point.position).max() <= _FARTHEST
    return bool(near and point.slope <= _FLAT * max(1.0, pull))


def _pull(density: NavigationDensity[GoalDistance]) -> Array:
    """Return -α ∇V/V (nv,) at the last update."""
    distance = max(density.goal_distance_value, 1e-300)
    return np.asarray(-density.parameters.alpha * density.goal_distance_gradient / distance)


def _opposing(
    density: NavigationDensity[GoalDistance],
    clearance_set: NearClearanceSet,
    limits: Array,
    q: Array,
    pull: Array,
) -> Iterator[tuple[float, str]]:
    """Yield how strongly each bump opposes the pull at the last update, where it does; its name."""
    theta, clearance = density.parameters.theta, clearance_set.pairs.clearance
    for k, width in enumerate(clearance_set.sensing_distance):
        h = clearance.distance[k] - clearance_set.margin
        _, slope = log_inverse_bump(h, width, theta)
        against = -slope * float(clearance.gradient[k] @ pull)
        if against > 0.0:
            yield against, " and ".join(clearance.pairs[k])
    arm, angles = clearance.arm, clearance.arm.angles(q)
    for name, side, bound in (("lower", 1.0, arm.limits.lower), ("upper", -1.0, arm.limits.upper)):
        for j in np.flatnonzero(np.isfinite(bound) & ~arm.is_circle):
            _, slope = log_inverse_bump(side * (angles[j] - bound[j]), limits[j], theta)
            against = -slope * side * float(pull[j])
            if against > 0.0:
                yield against, f"the {name} limit of joint {arm.joint_names[j]!r}"
