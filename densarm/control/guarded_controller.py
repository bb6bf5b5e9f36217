"""GuardedController: a controller that brakes and holds when something is wrong."""

import math

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.control.brake_and_hold import BrakeAndHold
from densarm.control.call_clock import CallClock
from densarm.control.controller import Controller, checked_state, tracking_error
from densarm.control.gains import Gains
from densarm.control.guard_status import GuardStatus, GuardWord
from densarm.control.guard_tolerances import GuardTolerances
from densarm.control.state_observer import StateObserver
from densarm.validation import positive

HOLDING_GAINS = Gains(position=50.0, velocity=15.0)
"""Stable with a delay of 50 ms in the state, by a phase margin of 33 degrees."""

_FASTEST = 10.0  # of the velocity limits: beyond it a number is no velocity
_UNLIMITED_FASTEST = 100.0  # [rad/s or m/s]
_FARTHEST = 1e6  # [rad or m]
_LONGEST_PREDICTION = 0.25  # [s]
_ROUNDING = 1e-9  # relative, of torques at their limits
_SLOW = 0.01  # [rad/s or m/s], which counts as rest

Measured = tuple[Array, Array]


class GuardedController:
    """Passes on another controller's torque while all is well, and else stops the arm.

    All is well while the state is one, the dynamics explain how it came from the last one under
    the torque between (see `StateObserver`), calls come in time, the arm keeps to the controller's
    reference if it has one (`tracking_error`), and the controller gives a finite torque within the
    limits. Else the arm brakes along a straight line and holds still, until `resume` is called: a
    controller that follows a reference in time would otherwise chase what went on without it.
    `torque` never raises, and whatever it is given its result is finite and within the torque
    limits. Without a fault it is the guarded controller's, bit for bit.

    What it rests on. A measured state that does not agree is left out, and the arm is braked where
    the dynamics say that it is; one that then agrees with itself for the time `delay` is believed.
    Without any believable state the arm is held by the torque that the model's gravity asks for at
    the observed rest. That is no feedback: what the model does not know (payload, friction, a
    push) moves the arm unseen, and an arm held upright falls in the end. Close mechanical brakes
    then. Before the first state there is nothing to hold by, and the torque is zero. A state that
    stays the same while the arm rests, that drifts slower than `GuardTolerances` allow, or another
    scene cannot be noticed from here: who watches these calls `stop` or `scene_changed`. Between
    two calls nothing can be done: a torque is held until the next one comes.

    Args:
        arm: the arm, as the plant is.
        controller: acts while all is well.
        period: time between two calls [s].
        tolerances: what counts as normal.
        gains: hold the arm at rest; higher ones sag less under a payload that the model does not
            know, and bear less delay.

    Raises:
        InvalidValueError: a period that is not positive.
    """

    def __init__(
        self,
        arm: Arm,
        controller: Controller,
        period: float,
        tolerances: GuardTolerances | None = None,
        gains: Gains = HOLDING_GAINS,
    ) -> None:
        self._arm = arm
        self._controller = controller
        self._period = positive("period", period)
        self._tolerances = tolerances or GuardTolerances()
        velocity = arm.limits.velocity
        self._fastest = np.where(np.isfinite(velocity), _FASTEST * velocity, _UNLIMITED_FASTEST)
        self._brake = BrakeAndHold(arm, gains, period)
        self._observer = StateObserver(arm, self._fastest, self._tolerances)
        self._candidate = StateObserver(arm, self._fastest, self._tolerances)
        self._agreed_for: float | None = None  # the candidate, if there is one
        self._status = GuardStatus()
        self._tau = np.zeros(arm.nv)
        self._clock = CallClock(period, max(self._tolerances.gap, 1.5 * period))
        self._last_q = np.full(arm.nq, np.nan)  # as measured
        self._knows_state = self._trusts_state = False
        self._brakes_anew = self._has_rested = self._needs_plan = False
        self._state = self._observer.q, self._observer.v
        # Kernels are loaded, or compiled, here rather than in a control loop.
        self._measured(0.0, *self._state)
        _repeats(self._observer.q, self._last_q.copy())
        _takes(self._tau, arm.limits.effort, self._tau)

    @property
    def status(self) -> GuardStatus:
        """Whether the controller acts, and if not, why."""
        return self._status

    @property
    def trusts_state(self) -> bool:
        """Whether the last state was believed."""
        return self._trusts_state

    @property
    def is_at_rest(self) -> bool:
        """Whether the arm was stopped, and rests as far as is known."""
        return self._brake.is_holding and bool(np.abs(self._state[1]).max() <= _SLOW)

    def stop(self, why: str = "The caller asked to stop.") -> None:
        """Brake from the next call of `torque` on, and hold still.

        Args:
            why: for the status.
        """
        self._stop(GuardWord.STOPPED, why)

    def scene_changed(self, how: str = "The scene has changed.") -> None:
        """Brake from the next call of `torque` on, hold still, and resume with a new plan only.

        The brake is a straight line, clear in the scene that the plan was made for.

        Args:
            how: for the status, e.g. which obstacle came or moved.
        """
        self._needs_plan = True
        self._stop(GuardWord.SCENE_CHANGED, how)

    def resume(self, controller: Controller | None = None) -> bool:
        """Let a controller act again, if the arm rests and the last state was believed.

        Args:
            controller: acts from now on, e.g. along a new plan; None for the one before, which
                fits a law without a reference in time, in the scene that it was made for. The
                next call may have any time.

        Returns:
            Whether it acts.
        """
        acts = self._status.word == GuardWord.ACTING
        if not acts and not (self.is_at_rest and self._trusts_state):
            return False
        if self._needs_plan and controller is None:
            return False
        self._needs_plan = False
        self._controller = controller or self._controller
        self._status = GuardStatus()
        self._has_rested = False
        self._clock.restart()
        return True

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`, but never raise: see `status`."""
        dt, fault = self._clock.elapsed(t)
        if fault:
            self._stop(fault.word, fault.sentence)
        measured = self._measured(t, q, v)
        self._observe(t, measured, dt)
        acts = self._status.word == GuardWord.ACTING and measured is not None
        if not (acts and self._passes_on(t, *self._state)):
            self._brake_or_hold(dt)
        return self._tau.copy()

    def _stop(self, word: GuardWord, sentence: str) -> None:
        if self._status.word == GuardWord.ACTING:
            self._status = GuardStatus(word, sentence)
            self._brakes_anew = True

    def _measured(self, t: float, q: ArrayLike, v: ArrayLike) -> Measured | None:
        """Return q (nq,) and v (nv,), or None if they are no state."""
        try:
            q, v = checked_state(self._arm, q, v)
        except Exception as error:  # noqa: BLE001  # a caller may give anything
            self._stop(GuardWord.NOT_A_STATE, f"At t = {t} s, {_one_line(error)}.")
            return None
        if _is_plausible(q, v, _FARTHEST, self._fastest):
            return q, v
        largest = f"velocities up to {np.abs(v).max():.3g}, positions up to {np.abs(q).max():.3g}"
        self._stop(GuardWord.NOT_A_STATE, f"At t = {t} s the state is beyond reason: {largest}.")
        return None

    def _observe(self, t: float, measured: Measured | None, dt: float) -> None:
        """Follow the dynamics, and believe the measured state if it agrees with them."""
        self._observer.advance(min(dt, _LONGEST_PREDICTION), self._period, self._tau)
        self._trusts_state = False
        repeats = measured is not None and _repeats(measured[0], self._last_q)
        if measured is None:
            self._agreed_for = None
        elif not self._knows_state or dt > _LONGEST_PREDICTION:
            self._believe(*measured)
        elif self._observer.agrees(*measured, 0.0 if repeats else dt):
            self._trusts_state, self._agreed_for = True, None
        else:
            self._doubt(t, *measured, dt, repeats)
        self._state = self._observer.q, self._observer.v
        if measured is not None and self._trusts_state:
            self._state = measured

    def _believe(self, q: Array, v: Array) -> None:
        self._observer.start(q, v)
        self._knows_state = self._trusts_state = self._brakes_anew = True
        self._agreed_for = None

    def _doubt(self, t: float, q: Array, v: Array, dt: float, repeats: bool) -> None:
        """Brake; believe an unexplained state only once it has agreed with itself for long."""
        if self._status.word == GuardWord.ACTING:
            word = GuardWord.FROZEN if repeats else GuardWord.JUMPED
            self._stop(word, self._doubt_in_words(t, q, v, repeats))
        if self._agreed_for is not None and not repeats:
            self._candidate.advance(dt, self._period, self._tau)
            if self._candidate.agrees(q, v, dt):
                self._agreed_for += dt
                if self._agreed_for >= self._tolerances.delay:
                    self._believe(q, v)
                return
        self._candidate.start(q, v)
        self._agreed_for = 0.0

    def _doubt_in_words(self, t: float, q: Array, v: Array, repeats: bool) -> str:
        position = np.abs(self._arm.difference(self._observer.q, q)).max()
        velocity = np.abs(v - self._observer.v).max()
        off = f"{position:.3g} in position and {velocity:.3g} in velocity (rad, m and s)"
        if repeats:
            return f"At t = {t} s the configuration has stood still, and is off by {off}."
        return f"At t = {t} s the state is off by {off} from where the dynamics put it."

    def _passes_on(self, t: float, q: Array, v: Array) -> bool:
        """Take the controller's torque over if it may be applied."""
        try:
            tau = np.asarray(self._controller.torque(t, q, v), dtype=np.float64)
            off = tracking_error(self._controller)
        except Exception as error:  # noqa: BLE001  # whatever fails, the arm must be stopped
            why = f"At t = {t} s the controller failed: {_one_line(error)}."
            self._stop(GuardWord.NO_TORQUE, why)
            return False
        if not off <= self._tolerances.tracking:
            why = f"off the controller's reference by {off:.3g} rad or m"
            self._stop(GuardWord.OFF_COURSE, f"At t = {t} s the arm is {why}.")
            return False
        limit = self._arm.limits.effort
        if tau.shape == limit.shape and _takes(tau, limit, self._tau):
            return True
        why = f"{_one_line(tau)}, and the limits are {_one_line(limit)}"
        self._stop(GuardWord.NO_TORQUE, f"At t = {t} s the controller gave {why}.")
        return False

    def _brake_or_hold(self, dt: float) -> None:
        if not self._knows_state:
            self._tau[:] = 0.0
            return
        if self._brakes_anew:
            self._brake.begin(*self._state, is_gentle=self._has_rested)
            self._brakes_anew, dt = False, 0.0
        tau = self._brake.torque(*self._state, dt)
        self._has_rested |= self._brake.is_holding
        if not _takes(tau, self._arm.limits.effort, self._tau):
            self._tau[:] = 0.0


def _one_line(text: object) -> str:
    return " ".join(str(text).split())[:300]


@compiled
def _repeats(q: Array, last: Array) -> bool:
    """Return whether q is the last one again, and keep it."""
    repeats = True
    for i in range(q.size):
        repeats &= q[i] == last[i]
        last[i] = q[i]
    return repeats


@compiled
def _is_plausible(q: Array, v: Array, farthest: float, fastest: Array) -> bool:
    is_plausible = True
    for x in q:
        is_plausible &= abs(x) <= farthest
    for i in range(v.size):
        is_plausible &= abs(v[i]) <= fastest[i]
    return is_plausible


@compiled
def _takes(tau: Array, limit: Array, out: Array) -> bool:
    """Copy a torque if it is finite and within the limits up to rounding, clipped to them."""
    for i in range(tau.size):
        if not (math.isfinite(tau[i]) and abs(tau[i]) <= limit[i] * (1.0 + _ROUNDING)):
            return False
    for i in range(tau.size):
        out[i] = min(max(tau[i], -limit[i]), limit[i])
    return True
