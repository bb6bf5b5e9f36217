"""Supervisor: lets a controller act while all is well, and else stops the arm and holds it."""

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.control.controller import (
    Controller,
    Gains,
    ToldByGoal,
    checked_state,
    is_plausible,
    takes_torque,
)
from densarm.control.course import Course
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.state_observer import FARTHEST, ByPositions, StateObserver, Tolerances
from densarm.control.status import TOLD, Fault, Status, one_line
from densarm.control.stopping import StopAndHold
from densarm.planning.motion import Motion
from densarm.values.arrays import Array
from densarm.values.checks import positive

HOLDING_GAINS = Gains(position=50.0, velocity=15.0)
"""Stable with a delay of 50 ms in the state, by a phase margin of 33 degrees."""

_FASTEST = 10.0  # of the velocity limits: beyond it a number is no velocity
_UNLIMITED_FASTEST = 100.0  # [rad/s or m/s]
_LONGEST_PREDICTION = 0.25  # [s]
_SLOW = 0.01  # [rad/s or m/s], which counts as rest
_WHY = "The caller asked to stop."


class Supervisor(ToldByGoal):
    """Passes on another controller's torque while all is well, and else stops the arm.

    All is well while the state is one, the dynamics explain how it came from the last one under
    the torque between (see `StateObserver`), calls come in time, the arm keeps to the controller's
    reference if it has one (`tracking_error`), and the controller gives a finite torque within the
    limits. Else the arm stops along a straight line and holds still, until `resume` is called: a
    controller that follows a reference in time would otherwise chase what went on without it.

    A controller that can `pause`, as `DensityTracking` does, stops the arm itself when it is told
    to, and before a joint leaves the tube in which its motion is proved clear: on the motion, which
    the straight line takes over from where that goes wrong too.
    `torque` never raises, and whatever it is given its result is finite and within the torque
    limits. Without a fault it is the controller's, bit for bit.

    With `tolerances` None it is trusted that all is well, as in a simulation: the arm stops when
    told to, and what the controller raises goes through.

    What it rests on. A measured state that does not agree is left out, and the arm is braked where
    the dynamics say that it is; one that then agrees with itself for the time `delay` is believed,
    its velocity being that of the positions where the measured one is another.
    Without any believable state the arm is held by the torque that the model's gravity asks for at
    the observed rest, and by what was learned of that before. That is no feedback: what is not
    known moves the arm unseen, and an arm held upright falls in the end. Close mechanical brakes
    then (`needs_brakes`). Before the first state there is nothing to hold by, and the torque is
    zero. A state that stays the same while the arm rests, that drifts slower than `Tolerances`
    allow, or another scene is not noticed here: who watches these calls `stop` or `scene_changed`.

    Args:
        arm: the arm, as the plant is.
        controller: acts while all is well.
        period: time between two calls [s].
        tolerances: what counts as normal; None to trust state, clock and controller.
        gains: hold the arm at rest; higher ones bear less delay.
        patience: time at rest in the tube after which the controller acts again by itself [s],
            its reference going on from where it is, but where the caller stopped the arm; None
            for never.

    Attributes:
        controller: what acts while all is well.
        status: whether it acts, and if not, why.
        trusts_state: whether the last state was believed.

    Raises:
        InvalidValueError: a period that is not positive.
        RobotDescriptionError: the arm has links without a mass, so that nothing could hold it.
    """

    def __init__(
        self,
        arm: Arm,
        controller: Controller,
        period: float = 0.001,
        tolerances: Tolerances | None = Tolerances(),
        gains: Gains = HOLDING_GAINS,
        patience: float | None = None,
    ) -> None:
        arm.require_masses("a supervisor's torque")
        self.controller = controller
        self.status = Status()
        self.trusts_state = False
        self._arm = arm
        self._began: float | None = 0.0  # the controller's own time
        self._period = positive("period", period)
        self._is_trusting = tolerances is None
        self._tolerances = tolerances or Tolerances()
        self._longest_gap = max(self._tolerances.gap, 1.5 * period)
        velocity = arm.limits.velocity
        self._fastest = np.where(np.isfinite(velocity), _FASTEST * velocity, _UNLIMITED_FASTEST)
        self._gains = gains
        self._patience = math.inf if patience is None else positive("patience", patience)
        self._rested, self._pauses = 0.0, False  # whether the controller itself stops it
        self._handed_over: InverseDynamics | None = None  # what it is to go on from
        self._called = self._has_braked = False  # at this call; during this stop
        self._course = self._course_of(controller)
        self._agreed_for: float | None = None  # the candidate, if there is one
        self._tau = np.zeros(arm.nv)
        self._time: float | None = None  # of the last call
        self._last_q = b""  # as measured
        self._knows_state = self._brakes_anew = self._needs_plan = False
        self._state = arm.configuration(np.zeros(arm.nv)), np.zeros(arm.nv)
        self._by_positions = ByPositions(arm, self._fastest)
        if not self._is_trusting:  # kernels are loaded, or compiled, here rather than in a loop
            self._brake.begin(*self._state)
            takes_torque(self._tau, arm.limits.effort, self._tau)
            self._observer = StateObserver(arm, self._fastest, self._tolerances)
            self._candidate = StateObserver(arm, self._fastest, self._tolerances)
            self._measured(0.0, *self._state)

    @cached_property
    def _brake(self) -> StopAndHold:
        return StopAndHold(self._arm, self._gains, self._period)

    @property
    def goal(self) -> Array | None:
        """The controller's goal (nq,), if it has one."""
        return getattr(self.controller, "goal", None)

    @property
    def motion(self) -> Motion | None:
        """The controller's motion, if it has one."""
        return getattr(self.controller, "motion", None)

    @property
    def reference(self) -> Array | None:
        """Where the controller wants the joints (nv,) [rad or m]; None if it stops, or has none."""
        acts = self.status.fault == Fault.NONE
        return getattr(self.controller, "reference", None) if acts else None

    @property
    def is_moving(self) -> bool | None:
        """Whether the controller's reference still moves; None where it does not tell."""
        return getattr(self.controller, "is_moving", None)

    @property
    def tracking_error(self) -> float | None:
        """How far off the controller's reference the arm is [rad or m]; None if it has none.

        Zero while the arm is stopped.
        """
        error = getattr(self.controller, "tracking_error", None)
        return error if error is None or self.status.fault == Fault.NONE else 0.0

    def describe_stall(self, q: Array) -> str:
        """Return why the arm rests at q (nq,): the status, or the controller's words if it acts."""
        if self.status.fault != Fault.NONE:
            return self.status.sentence
        describe = getattr(self.controller, "describe_stall", None)
        return str(describe(q)) if describe else ""

    @property
    def is_at_rest(self) -> bool:
        """Whether the arm was stopped, and rests as far as is known."""
        if self.status.fault == Fault.NONE:
            return False
        is_stopped = self._course.is_paused if self._pauses else self._brake.is_holding
        return is_stopped and bool(np.abs(self._state[1]).max() <= _SLOW)

    @property
    def needs_brakes(self) -> bool:
        """Whether the arm rests as far as is known, but no state tells."""
        stopped = self._knows_state and self.status.fault != Fault.NONE and not self.trusts_state
        return stopped and bool(np.abs(self._state[1]).max() <= _SLOW)  # a gentle stop ends later

    def stop(self, why: str = _WHY, *, at_once: bool = False, fault: Fault = Fault.STOPPED) -> None:
        """Brake from the next call of `torque` on, and hold still.

        Args:
            why: for the status, with the fault.
            fault: what was found.
            at_once: along a straight line, even if the controller can pause on its motion.
        """
        self._stop(fault, why, pauses=not at_once)

    def scene_changed(self, how: str = "The scene has changed.") -> None:
        """Brake from the next call of `torque` on, hold still, and resume with a new plan only.

        The brake is a straight line, clear in the scene that the plan was made for.

        Args:
            how: for the status, e.g. which obstacle came or moved.
        """
        self._needs_plan = True
        self._stop(Fault.SCENE_CHANGED, how)

    def resume(self, controller: Controller | None = None) -> bool:
        """Let a controller act again, if the arm rests and the last state was believed.

        Args:
            controller: acts from now on, e.g. along a new plan, its own time beginning with the
                next call; None for the one before, which fits a law without a reference in time,
                in the scene that it was made for. The next call may have any time.

        Returns:
            Whether it acts.
        """
        acts = self.status.fault == Fault.NONE
        if not (acts or (self.is_at_rest and self.trusts_state)) or self._by_positions.replaces:
            return False
        if self._needs_plan and controller is None:
            return False
        where = None if acts or self._pauses else self._state[0]
        if not acts and controller is None and not self._course.resume(where):
            return False
        known = self._dynamics if where is None else self._brake.dynamics
        if controller is not None:
            self.controller, self._began = controller, None
            self._course = self._course_of(controller)
        self._handed_over = None if known is self._dynamics else known
        self._needs_plan = self._pauses = False
        if not self._is_trusting:
            self._observer.learns = True
        self._by_positions.clear()
        self.status, self._time, self._rested, self._has_braked = Status(), None, 0.0, False
        return True

    def _course_of(self, controller: Controller) -> Course:
        most = None if self._is_trusting else self._tolerances.tracking
        return Course(self._arm, controller, most)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`, but never raise unless it trusts: see `status`."""
        self._called = False
        if self._is_trusting and self.status.fault == Fault.NONE:
            return self._controllers_torque(t, q, v, self._period)
        dt = self._elapsed(t)
        measured = checked_state(self._arm, q, v) if self._is_trusting else self._measured(t, q, v)
        if self.status.fault != Fault.NONE and not self._is_trusting:
            measured = self._by_positions.state(measured, q, dt)
        if self._is_trusting and measured is not None:
            self._state, self._knows_state, self.trusts_state = measured, True, True
        else:
            self._observe(t, measured, dt)
        self._resume_by_itself(dt)
        acts = (self.status.fault == Fault.NONE or self._pauses) and measured is not None
        if not (acts and self._passes_on(t, *self._state, dt)):
            self._brake_or_hold(dt)
        return self._tau.copy()

    def _stop(self, fault: Fault, sentence: str, *, pauses: bool = False) -> None:
        acts = self.status.fault == Fault.NONE
        if acts:
            self.status = Status(fault, sentence)
        if not (acts or self._pauses):
            return
        pausing = self._course.pausing if pauses else None
        self._pauses = pausing is not None
        if pausing is None:
            self._brakes_anew = True
        else:
            pausing.pause()

    def _resume_by_itself(self, dt: float) -> None:
        """Let the controller act again where the arm has rested for as long as the patience."""
        rests = self.status.fault not in TOLD and self.is_at_rest and self.trusts_state
        self._rested = self._rested + dt if rests else 0.0
        if self._rested >= self._patience:
            time = self._time
            self.resume()
            self._time, self._rested = time, 0.0

    def _elapsed(self, t: float) -> float:
        """Return the time since the last call [s], a period where it is not known."""
        try:
            now = float(t)
        except (TypeError, ValueError, OverflowError):  # a caller may give anything
            now = math.nan
        last, self._time = self._time, now
        if not math.isfinite(now):
            self._time = None if last is None else last + self._period
            self._stop(Fault.CLOCK, f"The time {t!r} is not a finite number.")
            return self._period
        if last is None:
            return self._period
        if now < last:
            self._stop(Fault.CLOCK, f"The time ran back from {last:.6g} s to {now:.6g} s.")
            return self._period
        if now - last > self._longest_gap:
            late = f"The call at t = {now:.6g} s came {now - last:.3g} s after the last one"
            self._stop(Fault.LATE, f"{late}, more than {self._longest_gap:.3g} s.")
        return now - last

    def _measured(self, t: float, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array] | None:
        """Return q (nq,) and v (nv,), or None if they are no state."""
        try:
            q, v = checked_state(self._arm, q, v)
        except Exception as error:  # noqa: BLE001  # a caller may give anything
            self._stop(Fault.NOT_A_STATE, f"At t = {t} s, {one_line(error)}.")
            return None
        if is_plausible(q, v, FARTHEST, self._fastest):
            return q, v
        largest = f"velocities up to {np.abs(v).max():.3g}, positions up to {np.abs(q).max():.3g}"
        self._stop(Fault.NOT_A_STATE, f"At t = {t} s the state is beyond reason: {largest}.")
        return None

    def _observe(self, t: float, measured: tuple[Array, Array] | None, dt: float) -> None:
        """Follow the dynamics, and believe the measured state if it agrees with them."""
        self._observer.learns |= self.trusts_state and self.is_at_rest
        self._observer.advance(min(dt, _LONGEST_PREDICTION), self._period, self._tau)
        self.trusts_state, self._state = False, (self._observer.q, self._observer.v)
        if measured is None:
            self._agreed_for = None
            return
        last, self._last_q = self._last_q, measured[0].tobytes()
        repeats = last == self._last_q
        if not self._knows_state or dt > _LONGEST_PREDICTION:
            self._believe(*measured)
        elif self._observer.agrees(*measured, 0.0 if repeats else dt):
            self.trusts_state = True
            self._brakes_anew |= self._agreed_for is not None  # which may still be late
            self._agreed_for = None
        else:
            self._doubt(t, *measured, dt, repeats)
        if self.trusts_state:
            self._state = measured

    def _believe(self, q: Array, v: Array) -> None:
        self._observer.start(q, v)
        self._knows_state = self.trusts_state = self._brakes_anew = True
        self._agreed_for = None

    def _doubt(self, t: float, q: Array, v: Array, dt: float, repeats: bool) -> None:
        """Brake; believe an unexplained state only once it has agreed with itself for long."""
        position = np.abs(self._arm.difference(self._observer.q, q)).max()
        velocity = np.abs(v - self._observer.v).max()
        off = f"{position:.3g} in position and {velocity:.3g} in velocity (rad, m and s)"
        if repeats:
            why = f"the configuration has stood still, and is off by {off}"
            self._stop(Fault.FROZEN, f"At t = {t} s {why}.")
        else:
            why = f"the state is off by {off} from where the dynamics put it"
            self._stop(Fault.JUMPED, f"At t = {t} s {why}.")
        if self._agreed_for is not None and not repeats:
            self._candidate.advance(dt, self._period, self._tau)
            if self._candidate.agrees(q, v, dt):
                self._agreed_for += dt
                if self._agreed_for >= self._tolerances.delay:
                    self._believe(q, v)
                return
        if self._observer.learns:
            self._observer.doubt(self._observer)
        self._candidate.start(q, v)
        self._candidate.doubt(self._observer)
        self._agreed_for = 0.0

    def _passes_on(self, t: float, q: Array, v: Array, dt: float) -> bool:
        """Take the controller's torque over if it may be applied."""
        limit = self._arm.limits.effort
        try:
            tau = np.asarray(self._controllers_torque(t, q, v, dt), dtype=np.float64)
            off, is_astray = self._course.fault(q)
        except Exception as error:  # noqa: BLE001  # whatever fails, the arm must be stopped
            self._stop(Fault.NO_TORQUE, f"At t = {t} s the controller failed: {one_line(error)}.")
            return False
        if off and (self.status.fault == Fault.NONE or is_astray):
            sentence = f"At t = {t} s the arm is off the controller's reference by {off}."
            self._stop(Fault.OFF_COURSE, sentence, pauses=not is_astray)
        if off and not self._pauses:
            return False
        if tau.shape == limit.shape and takes_torque(tau, limit, self._tau):
            return True
        why = f"{one_line(tau)}, and the limits are {one_line(limit)}"
        self._stop(Fault.NO_TORQUE, f"At t = {t} s the controller gave {why}.")
        return False

    @property
    def _dynamics(self) -> InverseDynamics | None:
        """The controller's, if it tells."""
        return getattr(self.controller, "dynamics", None)

    def _controllers_torque(self, t: float, q: ArrayLike, v: ArrayLike, dt: float) -> Array:
        self._began = t if self._began is None else self._began
        own, self._called = t - self._began, True
        if self._handed_over is not None:
            if (dynamics := self._dynamics) is not None:
                dynamics.take_over(self._handed_over, own - dt)
            self._handed_over = None
        return self.controller.torque(own, q, v)

    def _brake_or_hold(self, dt: float) -> None:
        if not self._knows_state:
            self._tau[:] = 0.0
            return
        if self._brakes_anew:
            if self._has_braked:
                self._brake.begin_again(*self._state)
            else:
                self._brake.begin(*self._state, known=self._dynamics)
            self._brakes_anew, self._has_braked = False, True
            dt = 0.0 if self._called else dt
        tau = self._brake.torque(*self._state, dt)
        if not takes_torque(tau, self._arm.limits.effort, self._tau):
            self._tau[:] = 0.0
