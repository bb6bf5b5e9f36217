"""The integral curve of the density from a start along its sub-goals: the planning system."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from densarm.density.navigation_density import Gauge
from densarm.density.sub_goals import SIGHT, GuidedDensity
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes

_LONGEST_STEP = 0.3  # [rad]
_SMALLEST_STEP = 1e-6  # [rad], below which a step makes no progress
_ARRIVED = 1e-7  # [rad or m] from the goal in any joint
_GROWTH_SHARE = 0.1  # of Δᵀ∇ ln ρ, that ln ρ must grow by in a step Δ
_MOST_STEPS = 1000
_SEARCHES = 40  # halvings of the interval of ln τ
_ACCURACY = 1.1  # factor within which τ is found


@dataclass(frozen=True, eq=False)
class IntegralCurve:
    """What the planning system did."""

    q: Array
    """Points of the curve (N, nq), N >= 1, from the start."""
    reached: bool
    """Whether the last point is the goal; else it is where the curve got stuck."""
    guided: GuidedDensity
    """The density that led, as it was at the last point."""

    @cached_property
    def detail(self) -> str:
        """Where it got stuck and what blocks it, looked for when first asked; empty if reached."""
        return "" if self.reached else self.guided.describe_stall(self.q[-1])


def integral_curve(guided: GuidedDensity, margin: float, start: Array) -> IntegralCurve:
    r"""Integrate the direction of q̇ = ∇ρ(q) from a start (nq,), as a curve without time.

    Beside an obstacle the flow is stiff: it falls into a valley between what repels and what
    attracts, and explicit steps cross that to and fro. These are linearly implicit,

    .. math:: (I / \tau + A(q))\, \Delta = \nabla \ln\rho(q), \qquad
        A = \sum_k -\frac{\partial^2 \ln\Psi_k}{\partial h_k^2} \nabla h_k \nabla h_k^T,

    the time τ such that ‖Δ‖ is the length wanted, which is halved until ln ρ has grown by a share
    of Δᵀ∇ ln ρ and the segment is proved clear beyond the margin [m]. A step that is long enough
    for the goal goes there, where ρ is infinite. Where nothing is sensed on the segment to a
    sub-goal, that segment is the step. A curve that can no longer climb has met a critical point.

    Source: [ZNV] eq. 11, section V-C; E. Hairer, G. Wanner, Solving Ordinary Differential
        Equations II, IV.7; J. Nocedal, S. Wright, Numerical Optimization, eq. 3.4.
    """
    guided.restart()
    climb = _Climb(guided, margin)
    goals, density = guided.sub_goals, guided.density
    points, q, length = [start], start, _LONGEST_STEP
    for _ in range(_MOST_STEPS):
        guided.update(q)
        error = density.error(q)
        if goals.is_last and np.abs(error).max() <= _ARRIVED:
            return IntegralCurve(np.array([*points[:-1], goals.q[-1]]), reached=True, guided=guided)
        if guided.is_critical():
            break
        q_next = climb.in_sight(q, error)
        if q_next is None:
            q_next = climb.step(q, error, min(_LONGEST_STEP, 2.0 * length))
            if q_next is None:
                break
            length = float(np.linalg.norm(guided.world.arm.difference(q, q_next)))
        q = q_next
        points.append(q)
    return IntegralCurve(np.array(points), reached=False, guided=guided)


class _Climb:
    """Steps up a density, each proved clear."""

    def __init__(self, guided: GuidedDensity, margin: float) -> None:
        self._guided = guided
        self._arm = guided.world.arm
        sensed = float(guided.sub_goals.sensing_distance.max(initial=0.0))
        self._clear = SeparatingPlanes(guided.world, margin)
        self._unsensed = SeparatingPlanes(guided.world, margin + sensed)
        self._gradient = np.empty(self._arm.nv)
        self._curvature = np.empty((self._arm.nv, self._arm.nv))

    def in_sight(self, q: Array, error: Array) -> Array | None:
        """Return the sub-goal if Ψ = 1 on the segment to it from q (nq,), which was updated.

        There ρ depends on V alone, and grows along the segment.
        """
        goals = self._guided.sub_goals
        if self._guided.density.log_psi < 0.0 or np.abs(error).max() > SIGHT:
            return None
        goal = np.asarray(goals.q[goals.current])
        is_unsensed = self._guided.sub_goal_in_sight(q) is not None
        return goal if is_unsensed or self._unsensed.segment_is_clear(q, goal) else None

    def step(self, q: Array, error: Array, length: float) -> Array | None:
        """Return the next point, at most so far [rad], or None where ρ grows no more."""
        density, gradient = self._guided.density, self._gradient
        left = float(np.linalg.norm(error))
        if left <= length and self._clear.segment_is_clear(q, density.goal):
            return density.goal.copy()
        density.write_gradient(Gauge.LOG, gradient)
        density.write_curvature(q, self._curvature)
        before, length = density.log_value(), min(length, left)
        stiffness, axes = np.linalg.eigh(self._curvature)
        pull = axes.T @ gradient
        while length > _SMALLEST_STEP:
            step = axes @ (pull / (_rate(pull, stiffness, length) + stiffness))
            candidate = self._arm.integrate(q, step)
            density.update(candidate)
            grown = density.log_value() - before
            if grown > _GROWTH_SHARE * float(gradient @ step) and self._clear.segment_is_clear(
                q, candidate
            ):
                return candidate
            length *= 0.5
        return None


def _rate(pull: Array, stiffness: Array, length: float) -> float:
    """Return the least 1/τ, nearly, with which a step is no longer than a length [rad]."""
    np.maximum(stiffness, 0.0, out=stiffness)  # rounding
    high = float(np.linalg.norm(pull)) / length
    low = 1e-9 * high
    for _ in range(_SEARCHES):
        middle = np.sqrt(low * high)
        if np.linalg.norm(pull / (middle + stiffness)) > length:
            low = middle
        else:
            high = middle
        if high < _ACCURACY * low:
            break
    return high
