"""StoppableController: a controller that stops when it is told to."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import Controller, checked_state
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.stopping_guard import brake_torque
from densarm.proof.straight_brake import HELD_SHARE, StraightBrake

_REST = 1e-3  # [rad/s or m/s], below which the arm is held where it is


class StoppableController:
    r"""Hands on another controller's torque until it is stopped.

    From then on the arm brakes along a straight line of joint space, inside its limits,

    .. math:: \tau = H - M \dot q / (T - t), \qquad 0 \le t < T,

    t the time since the brake began and T as in `StraightBrake`; then it holds still there.

    Args:
        arm: the arm.
        controller: acts until `stop` is called.
        gains: hold the arm at rest.
        period: time between two calls [s].
    """

    def __init__(self, arm: Arm, controller: Controller, gains: Gains, period: float) -> None:
        self._arm = arm
        self._controller = controller
        self._gains = gains
        self._period = period
        self._dynamics = InverseDynamics(arm, HELD_SHARE * arm.limits.acceleration)
        self._brake = StraightBrake(arm)
        self._stopping = False
        self._rest_time: float | None = None
        self._held: Array | None = None

    @property
    def is_stopping(self) -> bool:
        """Whether `stop` was called."""
        return self._stopping

    def stop(self) -> None:
        """Brake from the next call of `torque` on, and then hold still."""
        self._stopping = True

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        if not self._stopping:
            return self._controller.torque(t, q, v)
        q, v = checked_state(self._arm, q, v)
        self._dynamics.update(q, v)
        if self._held is not None:
            error = self._arm.difference(self._held, q)
            return self._dynamics.torque(-self._gains.velocity * v, -self._gains.position * error)
        if self._rest_time is None:
            self._rest_time = t + self._brake.duration(q, v)
        if np.abs(v).max() <= _REST:
            self._held = q
        return brake_torque(self._dynamics, v, self._rest_time - t, self._period)
