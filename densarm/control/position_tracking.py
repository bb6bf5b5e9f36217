"""PositionTracking: a motion streamed to a robot that follows joint positions by itself."""

from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.control.controller import ToldByGoal, checked_state
from densarm.control.course import USED_SHARE
from densarm.planning.motion import Motion
from densarm.values.arrays import Array
from densarm.values.checks import positive

_LONGEST_STEP = 2.0  # periods that the motion goes on by at once, however late a call is
_CLOCK_RATE = 20.0  # ω [1/s]
_LIMIT_SHARE = 0.95  # of acceleration limits, that pausing and going on take with the motion
_PAUSED = 0.01  # σ̇ below which the reference counts as at rest
_DISTANCE = 0.02  # [rad or m], of motions without a tube


class PositionTracking(ToldByGoal):
    r"""Gives the joint positions q_d(σ) of a motion, one period ahead.

    σ runs with the robot's clock as long as the arm keeps to the motion: within its tube, in which
    it is proved clear, of a place where it was told to be within the last time `lag`, which a
    robot's own controller takes to follow. Else the motion pauses, σ̇ coming to rest as

    .. math:: \dddot\sigma = -\omega^2 \dot\sigma - 2 \omega \ddot\sigma

    inside the acceleration limits, until `resume`. A late call lets it wait, never jump.

    Args:
        arm: the arm.
        motion: q_d(t), as `plan_motion` makes it, from where the robot is.
        period: time between two calls, the robot's [s]; None for the motion's.
        lag: how long the robot may take to be where it was told to be [s].

    Attributes:
        motion, period: as given.
        goal: where it ends (nq,).
        reference: the place nearest to the arm of those where it was told to be (nv,) [rad or m].
        tracking_error: how far the arm was off it at the last call [rad or m].

    Raises:
        InvalidValueError: a period or lag that is not positive.
    """

    def __init__(
        self, arm: Arm, motion: Motion, period: float | None = None, lag: float = 0.2
    ) -> None:
        self.period = motion.period if period is None else positive("period", period)
        self._arm, self.motion = arm, motion
        self.goal = arm.configurations(motion.position[-1])
        self.reference, self.tracking_error = np.array(motion.position[0]), 0.0
        self._bound = np.full(arm.nv, _DISTANCE) if motion.tube is None else motion.tube
        count = int(np.ceil(positive("lag", lag) / self.period))
        self._told: deque[Array] = deque([self.reference], maxlen=count + 1)
        self._time: float | None = None  # of the last call
        self._sigma, self._rate, self._change, self._wanted = 0.0, 1.0, 0.0, 1.0
        self._detail = ""
        self.position(0.0, arm.configurations(self.reference), np.zeros(arm.nv))
        self._time = None

    def position(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Return the joint positions to command (nv,) [rad or m]; else as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        elapsed = 0.0 if self._time is None else t - self._time
        elapsed, self._time = min(max(elapsed, 0.0), _LONGEST_STEP * self.period), t
        self._sigma += self._rate * elapsed
        sample = self.motion.sample(self._sigma)
        step = min(_CLOCK_RATE * elapsed, 1.0)
        self._change += step * (_CLOCK_RATE * (self._wanted - self._rate) - 2.0 * self._change)
        slowest, fastest = self._bounds(sample.velocity, sample.acceleration)
        self._change = min(max(self._change, slowest), fastest)
        self._rate = max(self._rate + elapsed * self._change, 0.0)
        self._told.append(sample.position)
        self._keep_to_the_motion(t, q)
        return self.motion.sample(self._sigma + self._rate * self.period).position

    def _bounds(self, velocity: Array, acceleration: Array) -> tuple[float, float]:
        """Return bounds on σ̈, about zero, within which accelerations keep their limits."""
        moves = velocity != 0.0
        if not moves.any():
            return -np.inf, np.inf
        along = (self._rate**2 * np.sign(velocity) * acceleration)[moves]
        most, speed = _LIMIT_SHARE * self._arm.limits.acceleration[moves], np.abs(velocity[moves])
        least, largest = ((-most - along) / speed).max(), ((most - along) / speed).min()
        return min(float(least), 0.0), max(float(largest), 0.0)

    def _keep_to_the_motion(self, t: float, q: Array) -> None:
        told = np.array(self._told)
        off = np.abs(self._arm.difference(self._arm.configurations(told), q))
        nearest = int((off / self._bound).max(axis=1).argmin())
        self.reference, self.tracking_error = told[nearest], float(off[nearest].max())
        joint = int((off[nearest] / self._bound).argmax())
        if off[nearest, joint] > USED_SHARE * self._bound[joint] and self._wanted > 0.0:
            name = self._arm.joint_names[joint]
            self.pause(
                f"paused at t = {t:.3f} s: {name} was {off[nearest, joint]:.3g} rad or m off the "
                f"motion, where {self._bound[joint]:.3g} are allowed"
            )

    def pause(self, why: str = "paused as it was told to") -> None:
        """Come to rest on the motion; the reason is for `describe_stall`."""
        self._wanted, self._detail = 0.0, why

    def resume(self) -> None:
        """Go on from where it paused."""
        self._wanted, self._detail = 1.0, ""

    @property
    def is_paused(self) -> bool:
        """Whether it was made to pause, and what it gives rests."""
        return self._wanted == 0.0 and self._rate < _PAUSED

    @property
    def is_moving(self) -> bool:
        """Whether what it gives still moves."""
        return self._sigma < self.motion.duration and not self.is_paused

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the arm rests short of the goal."""
        return self._detail or self.motion.detail

    @property
    def remark(self) -> str:
        """As `Motion.remark`."""
        return self.motion.remark
