"""BrakeAndHold: the straight brake to rest, and holding still there."""

import math

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.proof.straight_brake import StraightBrake

_REST = 1e-3  # [rad/s or m/s], below which the arm is held where it is
_ACCELERATION_SHARE = 0.97  # asked for: a torque is held while the state changes


class BrakeAndHold:
    r"""Brings an arm to rest along a straight line of joint space and keeps it there.

    .. math::

        \tau = H - M \dot q / (T - t), \qquad
        \tau = H - M \big( K_p (q \ominus q_{rest}) + K_v \dot q \big),

    t the time since the brake began and T as in `StraightBrake`; torques and accelerations are
    within the limits. Where gravity asks for more torque than there is, the arm cannot be held.

    Args:
        arm: the arm.
        gains: K_p and K_v that hold it at rest.
        period: time between two calls [s].
    """

    def __init__(self, arm: Arm, gains: Gains, period: float) -> None:
        self._arm = arm
        self._gains = gains
        self._period = self._shortest = period
        self._dynamics = InverseDynamics(arm, _ACCELERATION_SHARE * arm.limits.acceleration)
        self._dynamics.torque(np.zeros(arm.nv), np.zeros(arm.nv))  # loads its kernel before a loop
        self._brake = StraightBrake(arm, _ACCELERATION_SHARE)
        self._time_left = math.nan
        self._rest: Array | None = None

    @property
    def is_holding(self) -> bool:
        """Whether the arm has come to rest since the last `begin`."""
        return self._rest is not None

    def begin(self, q: Array, v: Array, is_gentle: bool = False) -> None:
        """Begin to brake.

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            is_gentle: whether to end the brake as -K_v q̇, which a delayed state leaves stable.
        """
        self._time_left = self._brake.duration(q, v)
        self._shortest = 1.0 / self._gains.velocity if is_gentle else self._period
        self._rest = None

    def torque(self, q: Array, v: Array, dt: float) -> Array:
        """Return the torque (nv,) [N·m or N].

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            dt: time since the last call, or since `begin` [s].
        """
        self._dynamics.update(q, v)
        self._time_left -= dt
        if self._rest is None and np.abs(v).max() <= _REST:
            self._rest = q.copy()
        if self._rest is not None:
            error = self._arm.difference(self._rest, q)
            return self._dynamics.torque(-self._gains.velocity * v, -self._gains.position * error)
        return self._dynamics.brake_torque(v, self._time_left, self._shortest)
