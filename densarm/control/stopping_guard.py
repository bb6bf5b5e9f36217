"""StoppingGuard: lets a torque act only if the arm can still stop after it."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.jerk_limit import JerkLimit
from densarm.density.distance_bounds import DistanceBounds
from densarm.fields.speed_law import SpeedLaw
from densarm.proof.straight_brake import StraightBrake


class StoppingGuard:
    """Replaces a torque by the straight brake where, after it, the brake would not be proved clear.

    Before, it limits the jerk, in the time 1 / K_v; the brake's is not limited. From a state with
    a clear brake the next one has a clear brake too: if not after the torque that is asked for,
    then after the first part of the brake itself.

    Args:
        arm: the arm.
        speed_law: tells from where the arm can stop.
        gains: K_v is used.
        period: time that a torque is held [s].
    """

    def __init__(self, arm: Arm, speed_law: SpeedLaw, gains: Gains, period: float) -> None:
        self._arm = arm
        self._data = arm.model.createData()
        self._speed_law = speed_law
        self._period = period
        self._brake = StraightBrake(arm)
        self._jerk = JerkLimit(arm.limits.acceleration, 1.0 / gains.velocity, period)

    def torque(
        self,
        t: float,
        dynamics: InverseDynamics,
        q: Array,
        v: Array,
        wanted: Array,
        distances: DistanceBounds,
    ) -> Array:
        """Return the wanted torque (nv,) [N·m or N] as far as the jerk allows, or the brake's.

        Args:
            t: time since the motion began [s].
            dynamics: updated at q (nq,) and v (nv,).
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            wanted: torque that is asked for (nv,) [N·m or N].
            distances: of all pairs at q.
        """
        a, tau = self._acceleration(q, v, wanted), wanted
        limited = self._jerk.limited(t, a)
        if limited is not a:
            tau = self._torque(q, v, limited)
            a = self._acceleration(q, v, tau)
        v_next = v + self._period * a
        motion = self._period * np.maximum(np.abs(v), np.abs(v_next))
        q_next = self._arm.integrate(q, self._period * v_next)
        if not self._speed_law.can_stop(q_next, v_next, distances, motion):
            tau = dynamics.brake_torque(v, self._brake.duration(q, v), self._period)
            a = self._acceleration(q, v, tau)
        self._jerk.last = a
        return tau

    def _acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        return np.array(pin.aba(self._arm.model, self._data, q, v, tau))

    def _torque(self, q: Array, v: Array, a: Array) -> Array:
        limit = self._arm.limits.effort
        tau = pin.rnea(self._arm.model, self._data, q, v, a)
        return np.asarray(np.clip(tau, -limit, limit))
