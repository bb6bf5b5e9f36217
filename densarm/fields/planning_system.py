"""PlanningSystem: the integral curve of the guided density, from start to goal."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.density import Gauge
from densarm.density.distance_bounds import least_room
from densarm.fields.guided_density import GuidedDensity
from densarm.proof.swept_bound import SweptBound


@dataclass(frozen=True)
class PlannedCurve:
    """What the planning system did."""

    q: Array
    """Points of the curve (N, nq), N >= 1, from the start."""
    reached: bool
    """Whether the last point is the goal; else it is where the curve got stuck."""
    detail: str
    """Where it got stuck and what blocks it; empty when reached."""


class PlanningSystem:
    """Integrates the direction of q̇ = ∇ρ(q) as a curve without time.

    Every step of length l goes up the density: it is halved until ln ρ has grown by a share of
    l ‖∇ ln ρ‖, without which steps would cross a valley of it to and fro. No step is longer than
    twice the last one, or than a share of the clearance ahead, so that none jumps through an
    obstacle.
    Where nothing is sensed on the segment to a sub-goal, that segment is the step. A curve that
    can no longer climb has met a critical point of ρ.

    Args:
        guided: the density and its sub-goals.
        bound: the bound on how far a step moves the bodies.

    Source: [ZNV] eq. 11, section V-C; J. Nocedal, S. Wright, Numerical Optimization, eq. 3.4.
    """

    STEP = 0.05
    """Longest step [rad]."""
    CLEARANCE_SHARE = 0.3
    """Share of a pair's clearance that one step may use up."""
    GROWTH_SHARE = 0.3
    """Share of l ‖∇ ln ρ‖ that ln ρ must grow by."""
    SMALLEST_STEP = 1e-7
    """A step below this length [rad] makes no progress."""
    MAX_STEPS = 20_000

    def __init__(self, guided: GuidedDensity, bound: SweptBound) -> None:
        self._guided = guided
        self._density = guided.density
        self._bound = bound
        self._arm = bound.arm
        self._gradient = np.zeros(self._arm.nv)

    def integrate(self, start: Array) -> PlannedCurve:
        """Return the curve from a collision-free start (nq,)."""
        guided = self._guided
        guided.restart()
        goal, points = guided.chain.q[-1], [start]
        q, length, has_climbed = start, self.STEP, False
        for _ in range(self.MAX_STEPS):
            if not (has_climbed and guided.chain.is_last):  # else nothing is new since the climb
                guided.update(q)
            error = guided.goal_distance.error(q)
            if guided.chain.is_last and np.abs(error).max() <= self.SMALLEST_STEP:
                return PlannedCurve(np.array([*points[:-1], goal]), reached=True, detail="")
            if guided.is_critical():
                break
            q_next = guided.sub_goal_in_sight(q)
            has_climbed = q_next is None
            if q_next is None:
                q_next = self._climb(q, min(self.STEP, 2.0 * length, float(np.linalg.norm(error))))
            if q_next is None:
                break
            length = float(np.linalg.norm(self._arm.difference(q, q_next)))
            q = q_next
            points.append(q)
        return PlannedCurve(np.array(points), reached=False, detail=guided.describe_stall(q))

    def _climb(self, q: Array, longest: float) -> Array | None:
        """Return the next point, at most so far [rad], or None where ρ grows no more."""
        self._density.write_gradient(Gauge.LOG, self._gradient)
        slope = float(np.linalg.norm(self._gradient))
        direction, before = self._gradient / slope, self._log_density()
        length = min(longest, self._clear_length(direction))
        while length > self.SMALLEST_STEP:
            candidate = self._arm.integrate(q, length * direction)
            self._density.update(candidate)
            if self._log_density() > before + self.GROWTH_SHARE * slope * length:
                return candidate
            length *= 0.5
        return None

    def _clear_length(self, direction: Array) -> float:
        rate = self._bound.motion(direction)
        return self.CLEARANCE_SHARE * least_room(self._guided.distances, self._bound.margin, rate)

    def _log_density(self) -> float:
        density = self._density
        log_distance = np.log(max(density.goal_distance_value, 1e-300))
        return float(density.log_psi - density.parameters.alpha * log_distance)
