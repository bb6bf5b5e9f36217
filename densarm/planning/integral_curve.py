"""The integral curve of the density from a start along its sub-goals: the planning system."""

import math
from dataclasses import dataclass

import numpy as np

from densarm.density.navigation_density import Gauge
from densarm.density.sub_goals import SIGHT, GuidedDensity, SubGoals
from densarm.values.arrays import Array
from densarm.values.kernels import compiled
from densarm.world.separating_planes import SeparatingPlanes

_LONGEST_STEP = 0.3  # [rad]
_SMALLEST_STEP = 1e-6  # [rad], below which a step makes no progress
_ARRIVED = 1e-7  # [rad or m] from the goal in any joint
_ROOM, _ROOM_SHARE = 2e-3, 0.5  # [m], of that at sub-goals: what steps keep, to be smoothed
_GROWTH_SHARE = 0.1  # of Δᵀ∇ ln ρ, that ln ρ must grow by in a step Δ
_MOST_STEPS = 1000
_LEAVING = (0.1, 0.01, 1e-3)  # [rad] from a critical point, the longest that climbs
_SEARCHES = 40  # halvings of the interval of ln τ
_ACCURACY = 1.1  # factor within which τ is found


@dataclass(frozen=True, eq=False)
class IntegralCurve:
    """What the planning system did."""

    q: Array
    """Points of the curve (N, nq), N >= 1, from the start."""
    reached: bool
    """Whether the last point is the goal; else it is where the curve got stuck."""
    sub_goals: SubGoals
    """The sub-goals that it was led along, up to the current one."""
    remark: str = ""
    """Which critical points it left, and how; empty where it met none."""


class PlanningSystem:
    r"""Integrates the direction of q̇ = ∇ρ(q) from a start, as a curve without time.

    Beside an obstacle the flow is stiff: it falls into a valley between what repels and what
    attracts, and explicit steps cross that to and fro. These are linearly implicit,

    .. math:: (I / \tau + A(q))\, \Delta = \nabla \ln\rho(q), \qquad
        A = \sum_k -\frac{\partial^2 \ln\Psi_k}{\partial h_k^2} \nabla h_k \nabla h_k^T,

    the time τ such that ‖Δ‖ is the length wanted, which is halved until ln ρ has grown by a share
    of Δᵀ∇ ln ρ and the segment is proved clear, with a little room beyond the margin. A step that
    is long enough for the goal goes there, where ρ is infinite. Where nothing is sensed on the
    segment to a sub-goal, that segment is the step. A curve that can no longer climb has met a
    critical point, and leaves it along the unstable direction, where it has one.

    Args:
        guided: the density; its sub-goals may be changed between two curves.
        margin: safety margin m [m].

    Source: [ZNV] eq. 11, section V-C; E. Hairer, G. Wanner, Solving Ordinary Differential
        Equations II, IV.7; J. Nocedal, S. Wright, Numerical Optimization, eq. 3.4.
    """

    def __init__(self, guided: GuidedDensity, margin: float) -> None:
        self.guided = guided
        self._arm = guided.world.arm
        sensed = float(guided.sub_goals.sensing_distance.max(initial=0.0))
        self._margin = margin
        self._unsensed = SeparatingPlanes(guided.world, margin, sensed)
        self._gradient = np.empty(self._arm.nv)
        self._curvature = np.empty((self._arm.nv, self._arm.nv))

    def curve(self, start: Array) -> IntegralCurve:
        """Return the curve from a start (nq,) along the sub-goals, up to where it gets stuck."""
        guided = self.guided
        guided.restart()
        goals, density = guided.sub_goals, guided.density
        room = np.clip(_ROOM_SHARE * goals.distance_margin.min(axis=0), 0.0, _ROOM)
        clear = SeparatingPlanes(guided.world, self._margin, room)
        points, q, length, left = [start], start, _LONGEST_STEP, list[str]()
        guided.update(start)
        for _ in range(_MOST_STEPS):
            error = density.error(q)
            if goals.is_last and np.abs(error).max() <= _ARRIVED:
                ends = np.array([*points[:-1], goals.q[-1]])
                return IntegralCurve(ends, reached=True, sub_goals=goals, remark="; ".join(left))
            is_critical = guided.is_critical()
            q_next = None if is_critical else self._in_sight(q, error)
            if q_next is None and not is_critical:
                q_next = self._step(q, error, min(_LONGEST_STEP, 2.0 * length), clear)
                if q_next is not None:
                    length = float(np.linalg.norm(self._arm.difference(q, q_next)))
            if q_next is None:
                q_next, how = self._leave(q, clear)
                if q_next is None:
                    break
                left.append(how)
            q = q_next
            points.append(q)
            guided.advance(q)
        remark = "; ".join(left)
        return IntegralCurve(np.array(points), reached=False, sub_goals=goals, remark=remark)

    def describe_stall(self, curve: IntegralCurve) -> str:
        """Return, as a phrase, where a curve got stuck and what blocks it; empty if it reached."""
        if curve.reached:
            return ""
        self.guided.lead_along(curve.sub_goals)
        return self.guided.describe_stall(curve.q[-1])

    def _in_sight(self, q: Array, error: Array) -> Array | None:
        """Return the sub-goal, updated, if Ψ = 1 on the segment to it from q (nq,), which was.

        There ρ depends on V alone, and grows along the segment.
        """
        goals = self.guided.sub_goals
        if self.guided.density.log_psi < 0.0 or np.abs(error).max() > SIGHT:
            return None
        goal = np.asarray(goals.q[goals.current])
        is_unsensed = self.guided.sub_goal_in_sight(q) is not None
        if not is_unsensed and not self._unsensed.segment_is_clear(q, goal):
            return None
        self.guided.density.update(goal)
        return goal

    def _step(self, q: Array, error: Array, length: float, clear: SeparatingPlanes) -> Array | None:
        """Return the next point, updated, at most so far [rad], or None where ρ grows no more."""
        density, gradient = self.guided.density, self._gradient
        left = float(np.linalg.norm(error))
        if left <= length and clear.segment_is_clear(q, density.goal):
            density.update(density.goal)
            return density.goal.copy()
        density.write_gradient(Gauge.LOG, gradient)
        density.write_curvature(q, self._curvature)
        before, length = density.log_value(), min(length, left)
        stiffness, axes = np.linalg.eigh(self._curvature)
        np.maximum(stiffness, 0.0, out=stiffness)  # rounding
        pull = axes.T @ gradient
        while length > _SMALLEST_STEP:
            step = axes @ (pull / (_rate(pull, stiffness, length) + stiffness))
            candidate = self._arm.integrate(q, step)
            density.update(candidate)
            grown = density.log_value() - before
            if grown > _GROWTH_SHARE * float(gradient @ step) and clear.segment_is_clear(
                q, candidate
            ):
                return candidate
            length *= 0.5
        return None

    def _leave(self, q: Array, clear: SeparatingPlanes) -> tuple[Array | None, str]:
        """Return a point away from the critical point q (nq,), updated, if any, and how."""
        guided, density = self.guided, self.guided.density
        density.update(q)
        before, direction = density.log_value(), guided.unstable_direction(q)
        if direction is None:
            return None, ""
        for length in _LEAVING:
            candidate = self._arm.integrate(q, length * direction)
            density.update(candidate)
            if density.log_value() > before and clear.segment_is_clear(q, candidate):
                return candidate, guided.describe_departure(q, direction)
        return None, ""


@compiled
def _rate(pull: Array, stiffness: Array, length: float) -> float:
    """Return the least 1/τ, nearly, with which a step is no longer than a length [rad]."""
    high = math.sqrt((pull * pull).sum()) / length
    low = 1e-9 * high
    for _ in range(_SEARCHES):
        middle, square = math.sqrt(low * high), 0.0
        for j in range(pull.size):
            square += (pull[j] / (middle + stiffness[j])) ** 2
        if square > length * length:
            low = middle
        else:
            high = middle
        if high < _ACCURACY * low:
            break
    return high
