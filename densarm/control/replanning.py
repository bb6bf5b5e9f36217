"""Replanning: a controller that plans again where its plan has lost the arm."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.control.controller import Controller, Gains, checked_state
from densarm.control.status import Fault
from densarm.control.supervisor import HOLDING_GAINS, Supervisor
from densarm.planning.motion import Motion, PlanningError
from densarm.values.arrays import Array
from densarm.world.world import World

_LOST = 0.2  # from the reference in any joint [rad or m]
_STANDING = 0.01  # [rad or m] within the patience
_AT_GOAL = 0.01  # [rad or m]
_MOST = 3  # plans after the first


class Planner(Protocol):
    """Plans a way on for an arm while a control loop goes on."""

    def ask(self, t: float, q: Array) -> None:
        """Begin to plan from q (nq,), where the arm stands at t [s]; what was asked is dropped."""
        ...

    def answer(self, t: float, q: Array) -> Controller | None:
        """Return what drives the arm, now at q (nq,), along the plan; None while there is none yet.

        Raises:
            PlanningError: there is no way.
        """
        ...


class PlanningInLoop:
    """Plans at once, and answers later by a stated time: for loops that are simulated.

    Args:
        world: the arm among obstacles.
        plan: from obstacles as they are predicted, and a configuration (nq,), to what drives the
            arm along a new plan from where it is then (nq,); or it raises `PlanningError`.
        planning_time: after which there is an answer [s].
    """

    def __init__(
        self,
        world: World,
        plan: Callable[[World, Array], Callable[[Array], Controller]],
        planning_time: float,
    ) -> None:
        self._world, self._plan, self._planning_time = world, plan, planning_time
        self._ready_at = 0.0
        self._found: Callable[[Array], Controller] | PlanningError

    def ask(self, t: float, q: Array) -> None:
        """Act as `Planner.ask`."""
        self._ready_at = t + self._planning_time
        predicted = World(self._world.arm, self._world.predicted(self._planning_time))
        try:
            self._found = self._plan(predicted, q)
        except PlanningError as error:
            self._found = error

    def answer(self, t: float, q: Array) -> Controller | None:
        """Act as `Planner.answer`."""
        if t < self._ready_at:
            return None
        if isinstance(self._found, PlanningError):
            raise self._found
        return self._found(q)


class Replanning:
    """Follows a plan, and as the last resort plans again from where the arm was pushed.

    A plan has lost the arm when it is farther than 0.2 rad or m from the reference in any joint,
    or stands away from the goal with no reference left. The arm is then stopped along a straight
    line by a `Supervisor`; once it rests there is a new plan from there, up to three times.
    Nothing proves beforehand that the way to stop from a push is clear: feedback alone would chase
    the reference across whatever is between. While an arm gives way to what moves (`is_evading` of
    the controller) it is not lost, however far off it is, and is not stopped: held still it would
    be hit. Where it stands for as long as the patience a new plan is asked for; until there is one,
    and without one, it goes on as it does. A plan that comes when the arm has gone on by more than
    0.2 rad or m is not taken.

    Args:
        arm: the arm.
        goal: configuration to reach (nq,).
        controller: along the first plan; its attribute `motion`, if it has one, tells how long its
            reference moves.
        planner: plans again, while this controller goes on.
        patience: how long the arm may stand away from the goal [s].
        gains: hold the arm while it is at rest.
        period: time between two calls [s].
    """

    def __init__(
        self,
        arm: Arm,
        goal: Array,
        controller: Controller,
        planner: Planner,
        patience: float = 0.5,
        gains: Gains = HOLDING_GAINS,
        period: float = 0.001,
    ) -> None:
        self._arm = arm
        self.goal = goal
        self._supervisor = Supervisor(arm, controller, period, tolerances=None, gains=gains)
        self._planner = planner
        self._asked: Array | None = None  # from where on there is to be a plan
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
        if self._asked is None:
            evades = acts and bool(getattr(supervisor.controller, "is_evading", False))
            if not (self._has_lost(t, q, evades) if acts else supervisor.is_at_rest):
                return
            if acts and not evades:
                supervisor.stop()
                return
            self._stood, self._asked = None, q.copy()
            self._planner.ask(t, q)
        try:
            controller = self._planner.answer(t, q)
        except PlanningError:
            self._asked, self._gave_up = None, not acts
            return
        if controller is None:
            return
        asked, self._asked = self._asked, None
        if self._error(asked, q) > _LOST:
            return
        if not acts or controller is not supervisor.controller:
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
