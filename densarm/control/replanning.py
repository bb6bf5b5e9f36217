"""Replanning: a controller that plans again where its plan has lost the arm."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.control.controller import Controller, Gains, checked_state
from densarm.control.status import Fault
from densarm.control.supervisor import Supervisor
from densarm.planning.motion import Motion
from densarm.values.arrays import Array

_LOST = 0.2  # from the reference in any joint [rad or m]
_STANDING = 0.01  # [rad or m] within the patience
_AT_GOAL = 0.01  # [rad or m]
_MOST = 3  # plans after the first


class Replanning:
    """Follows a plan, and as the last resort plans again from where the arm was pushed.

    A plan has lost the arm when it is farther than 0.2 rad or m from the reference in any joint,
    or stands away from the goal with no reference left. The arm is then stopped along a straight
    line by a `Supervisor`; once it rests there is a new plan from there, up to three times.
    Nothing proves beforehand that the way to stop from a push is clear: feedback alone would chase
    the reference across whatever is between. While an arm gives way to what moves (`is_evading` of
    the controller) it is not lost, however far off it is, and is not stopped: held still it would
    be hit. Where it stands for as long as the patience there is a new plan at once, and without one
    it goes on as it does. The call of `torque` that plans takes as long as planning does, with the
    arm at rest.

    Args:
        arm: the arm.
        goal: configuration to reach (nq,).
        controller: along the first plan; its attribute `motion`, if it has one, tells how long its
            reference moves.
        plan_again: from a configuration at rest (nq,) to a controller along a new plan, or None.
        patience: how long the arm may stand away from the goal [s].
        gains: hold the arm while it is at rest.
        period: time between two calls [s].
    """

    def __init__(
        self,
        arm: Arm,
        goal: Array,
        controller: Controller,
        plan_again: Callable[[Array], Controller | None],
        patience: float,
        gains: Gains,
        period: float,
    ) -> None:
        self._arm = arm
        self.goal = goal
        self._supervisor = Supervisor(arm, controller, period, tolerances=None, gains=gains)
        self._plan_again = plan_again
        self._patience = patience
        self._began = 0.0
        self._stood: tuple[float, Array] | None = None
        self._gave_up = False
        self.replanned_at: tuple[float, ...] = ()
        """Times of the plans after the first [s]."""

    @property
    def tracking_error(self) -> float | None:
        """As `Supervisor.tracking_error`, of the controller along the plan."""
        return self._supervisor.tracking_error

    @property
    def motion(self) -> Motion | None:
        """As `Supervisor.motion`."""
        return self._supervisor.motion

    @property
    def reference(self) -> Array | None:
        """As `Supervisor.reference`."""
        return self._supervisor.reference

    @property
    def is_moving(self) -> bool | None:
        """As `Supervisor.is_moving`."""
        return self._supervisor.is_moving

    def describe_stall(self, q: Array) -> str:
        """Return why the arm rests at q (nq,), as a phrase."""
        describe = getattr(self._supervisor.controller, "describe_stall", lambda _: "")
        prefix = "no path from where the arm was stopped; " if self._gave_up else ""
        return f"{prefix}{describe(q)}"

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        if not self._gave_up and len(self.replanned_at) < _MOST:
            self._watch(t, q)
        return self._supervisor.torque(t, q, v)

    def _watch(self, t: float, q: Array) -> None:
        supervisor = self._supervisor
        acts = supervisor.status.fault == Fault.NONE
        evades = acts and bool(getattr(supervisor.controller, "is_evading", False))
        if not (self._has_lost(t, q, evades) if acts else supervisor.is_at_rest):
            return
        if acts and not evades:
            supervisor.stop()
            return
        self._stood = None
        controller = self._plan_again(q)
        if controller is None:
            self._gave_up = not evades
            return
        supervisor.resume(controller)
        self._began = t
        self.replanned_at += (t,)

    def _has_lost(self, t: float, q: Array, evades: bool) -> bool:
        motion, moves = self._supervisor.motion, self._supervisor.is_moving
        if moves is None:
            moves = motion is not None and t - self._began <= motion.duration
        if moves and not evades:
            return (self._supervisor.tracking_error or 0.0) > _LOST
        if self._stood is None or self._error(self._stood[1], q) > _STANDING:
            self._stood = t, q.copy()
        is_late = t - self._stood[0] >= self._patience
        return is_late and self._error(self.goal, q) > _AT_GOAL

    def _error(self, q_a: Array, q_b: Array) -> float:
        return float(np.abs(self._arm.difference(q_a, q_b)).max())
