"""The integral curve of the density from a start along its sub-goals: the planning system."""

from dataclasses import dataclass

import numpy as np

from densarm.density.navigation_density import Gauge
from densarm.density.sub_goals import GuidedDensity
from densarm.values.arrays import Array
from densarm.world.active_pairs import longest_travel

_LONGEST_STEP = 0.05  # [rad]
_SMALLEST_STEP = 1e-7  # [rad], below which a step makes no progress
_CLEARANCE_SHARE = 0.3  # of a pair's, that one step may use up
_GROWTH_SHARE = 0.3  # of l ‖∇ ln ρ‖, that ln ρ must grow by in a step of length l
_MOST_STEPS = 20_000


@dataclass(frozen=True)
class IntegralCurve:
    """What the planning system did."""

    q: Array
    """Points of the curve (N, nq), N >= 1, from the start."""
    reached: bool
    """Whether the last point is the goal; else it is where the curve got stuck."""
    detail: str
    """Where it got stuck and what blocks it; empty when reached."""


def integral_curve(guided: GuidedDensity, margin: float, start: Array) -> IntegralCurve:
    """Integrate the direction of q̇ = ∇ρ(q) from a start (nq,), as a curve without time.

    Every step of length l goes up the density: it is halved until ln ρ has grown by a share of
    l ‖∇ ln ρ‖, without which steps would cross a valley of it to and fro. No step is longer than
    twice the last one, or than a share of the clearance ahead beyond the margin [m], so that none
    jumps through an obstacle.
    Where nothing is sensed on the segment to a sub-goal, that segment is the step. A curve that
    can no longer climb has met a critical point of ρ.

    Source: [ZNV] eq. 11, section V-C; J. Nocedal, S. Wright, Numerical Optimization, eq. 3.4.
    """
    guided.restart()
    arm, goals = guided.world.arm, guided.sub_goals
    goal, points = goals.q[-1], [start]
    q, length, has_climbed = start, _LONGEST_STEP, False
    for _ in range(_MOST_STEPS):
        if not (has_climbed and goals.is_last):  # else nothing is new since the climb
            guided.update(q)
        error = guided.density.error(q)
        if goals.is_last and np.abs(error).max() <= _SMALLEST_STEP:
            return IntegralCurve(np.array([*points[:-1], goal]), reached=True, detail="")
        if guided.is_critical():
            break
        q_next = guided.sub_goal_in_sight(q)
        has_climbed = q_next is None
        if q_next is None:
            longest = min(_LONGEST_STEP, 2.0 * length, float(np.linalg.norm(error)))
            q_next = _climb(guided, margin, q, longest)
        if q_next is None:
            break
        length = float(np.linalg.norm(arm.difference(q, q_next)))
        q = q_next
        points.append(q)
    return IntegralCurve(np.array(points), reached=False, detail=guided.describe_stall(q))


def _climb(guided: GuidedDensity, margin: float, q: Array, longest: float) -> Array | None:
    """Return the next point, at most so far [rad], or None where ρ grows no more."""
    world, density, gradient = guided.world, guided.density, np.empty(guided.world.arm.nv)
    density.write_gradient(Gauge.LOG, gradient)
    slope = float(np.linalg.norm(gradient))
    direction, before = gradient / slope, density.log_value()
    clear = longest_travel(guided.distances, margin, world.motion_bound(direction))
    length = min(longest, _CLEARANCE_SHARE * clear)
    while length > _SMALLEST_STEP:
        candidate = world.arm.integrate(q, length * direction)
        density.update(candidate)
        if density.log_value() > before + _GROWTH_SHARE * slope * length:
            return candidate
        length *= 0.5
    return None
