"""StoppingGuard: lets a torque act only if the arm can still stop after it."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.fields.speed_law import SpeedLaw
from densarm.proof.straight_brake import StraightBrake


class StoppingGuard:
    """Replaces a torque by the straight brake where, after it, the brake would not be proved clear.

    From a state with a clear brake the next one has a clear brake too: if not after the torque
    that is asked for, then after the first part of the brake itself.

    Args:
        arm: the arm.
        speed_law: tells from where the arm can stop.
        period: time that a torque is held [s].
    """

    def __init__(self, arm: Arm, speed_law: SpeedLaw, period: float) -> None:
        self._arm = arm
        self._data = arm.model.createData()
        self._speed_law = speed_law
        self._period = period
        self._brake = StraightBrake(arm)

    def torque(
        self, dynamics: InverseDynamics, q: Array, v: Array, wanted: Array, distance: Array
    ) -> Array:
        """Return the wanted torque (nv,) [N·m or N], or that of the brake.

        Args:
            dynamics: updated at q (nq,) and v (nv,).
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            wanted: torque that is asked for (nv,) [N·m or N].
            distance: signed distances of all pairs at q (K,) [m].
        """
        a = pin.aba(self._arm.model, self._data, q, v, wanted)
        v_next = v + self._period * a
        motion = self._period * np.maximum(np.abs(v), np.abs(v_next))
        q_next = self._arm.integrate(q, self._period * v_next)
        if self._speed_law.can_stop(q_next, v_next, distance, motion):
            return wanted
        return brake_torque(dynamics, v, self._brake.duration(q, v), self._period)


def brake_torque(dynamics: InverseDynamics, v: Array, duration: float, period: float) -> Array:
    """Return the torque (nv,) of the straight brake with a time to go.

    Args:
        dynamics: updated at the state.
        v: velocity (nv,) [rad/s or m/s].
        duration: time to go [s]; if infinite the brake is as hard as the limits allow.
        period: time that the torque is held [s].
    """
    longest = max(duration, period) if np.isfinite(duration) else period
    return dynamics.torque(-v / longest, np.zeros_like(v))
