"""InertiaDistance: the goal distance in the metric of an arm's inertia."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from densarm.arrays import Array
from densarm.density.goal_distance import TorusDistance

if TYPE_CHECKING:
    from densarm.arm import Arm


class InertiaDistance:
    r"""A distance whose gradient, as a torque, moves the arm straight to the goal.

    .. math::

        V = \tfrac12 s^T W s + \sum_i W_{ii} (c_i - \tfrac12 s_i^2), \qquad
        W = M(q) / \max_i M_{ii}(q_0)

    with s = sin e and c = 1 - cos e of a circle, s = e and c = e²/2 of a bounded joint. c_i ≥
    s_i²/2, so that V is positive definite. Where all joints are bounded, W⁻¹∇V = e.

    W is taken where the arm is, and ∇V at that W: V adapts to the place, which [ZNV] Remark 1
    allows, and the rest of its derivative, of the order of e², is left out. With a W that is kept
    from one sub-goal to the next, M⁻¹∇ρ turns at each of them, and the arm shakes.

    Args:
        arm: its inertia.
        goal: configuration (nq,), the first of which is q_0.
    """

    def __init__(self, arm: Arm, goal: Array) -> None:
        self._arm = arm
        self._torus = TorusDistance(arm, goal)
        self._scale = 1.0 / arm.mass_matrix(goal).diagonal().max()

    @property
    def goal(self) -> Array:
        """As `GoalDistance.goal`."""
        return self._torus.goal

    def set_goal(self, q: Array) -> None:
        """Act as `GoalDistance.set_goal`."""
        self._torus.set_goal(q)

    def error(self, q: Array) -> Array:
        """Act as `GoalDistance.error`."""
        return self._torus.error(q)

    def evaluate(self, q: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`, the gradient at the W of q."""
        e, is_circle = self.error(q), self._arm.is_circle
        s = np.where(is_circle, np.sin(e), e)
        slope = np.where(is_circle, np.cos(e), 1.0)
        rest = np.where(is_circle, 2.0 * np.sin(0.5 * e) ** 2, 0.5 * e**2) - 0.5 * s**2
        inertia = self._scale * self._arm.mass_matrix(q)
        own, pull = inertia.diagonal(), inertia @ s
        out_gradient[:] = slope * pull + (1.0 - slope) * own * s
        return float(0.5 * s @ pull + own @ rest)
