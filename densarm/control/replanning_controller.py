"""ReplanningController: a controller that plans again where its plan has lost the arm."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import checked_state
from densarm.control.stoppable_controller import StoppableController
from densarm.reference.reference import Reference

_LOST = 0.2  # from the reference in any joint [rad or m]
_STANDING = 0.01  # [rad or m] within the patience
_REST = 1e-3  # [rad/s or m/s], below which a stopped arm stands
_MOST = 3  # plans after the first


@dataclass(frozen=True)
class FollowedPlan:
    """A plan from a configuration to the goal, and what drives the arm along it."""

    controller: StoppableController
    """Its time begins with the plan."""
    reference: Reference | None
    """What the controller tracks, if it does."""
    describe_stall: Callable[[Array], str]
    """From a configuration (nq,) to why the arm rests there, as a phrase."""


class ReplanningController:
    """Follows a plan, and as the last resort plans again from where the arm was pushed.

    A plan has lost the arm when it is farther than 0.2 rad or m from the reference in any joint,
    or stands away from the goal with no reference left. The arm is then braked along a straight
    line, as `StoppableController` does; once it rests there is a new plan from there, up to three
    times. Nothing proves beforehand that the brake from a push is clear: feedback alone would
    chase the reference across whatever is between. The call of `torque` that plans takes as long
    as planning does, with the arm held at rest.

    Args:
        arm: the arm.
        goal: configuration to reach (nq,).
        plan: from the start.
        plan_again: from a configuration at rest (nq,) to a new plan; None where it finds none.
        patience: how long the arm may stand away from the goal [s].
        tolerance: position error that counts as at the goal [rad or m].
    """

    def __init__(
        self,
        arm: Arm,
        goal: Array,
        plan: FollowedPlan,
        plan_again: Callable[[Array], FollowedPlan | None],
        patience: float,
        tolerance: float,
    ) -> None:
        self._arm = arm
        self._goal = goal
        self._plan = plan
        self._plan_again = plan_again
        self._patience = patience
        self._tolerance = tolerance
        self._began = 0.0
        self._stood: tuple[float, Array] | None = None
        self._gave_up = False
        self.replanned_at: tuple[float, ...] = ()
        """Times of the plans after the first [s]."""

    def describe_stall(self, q: Array) -> str:
        """Return why the arm rests at q (nq,), as a phrase."""
        if self._gave_up:
            return f"no path from where the arm was stopped; {self._plan.describe_stall(q)}"
        return self._plan.describe_stall(q)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        if not self._gave_up and len(self.replanned_at) < _MOST:
            self._watch(t, q, v)
        return self._plan.controller.torque(t - self._began, q, v)

    def _watch(self, t: float, q: Array, v: Array) -> None:
        controller = self._plan.controller
        if not controller.is_stopping:
            if self._has_lost(t, q):
                controller.stop()
        elif np.abs(v).max() <= _REST:
            plan = self._plan_again(q)
            if plan is None:
                self._gave_up = True
                return
            self._plan, self._began, self._stood = plan, t, None
            self.replanned_at += (t,)

    def _has_lost(self, t: float, q: Array) -> bool:
        reference = self._plan.reference
        if reference is not None and t - self._began <= reference.duration:
            return self._plan.controller.tracking_error > _LOST
        if self._stood is None or self._error(self._stood[1], q) > _STANDING:
            self._stood = t, q.copy()
        is_late = t - self._stood[0] >= self._patience
        return is_late and self._error(self._goal, q) > self._tolerance

    def _error(self, q_a: Array, q_b: Array) -> float:
        return float(np.abs(self._arm.difference(q_a, q_b)).max())
