"""Stopping an arm, holding it still, and a filter that keeps it able to stop."""

import math

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.control.controller import Gains
from densarm.control.disturbance_observer import ActuationParameters
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.speed_law import SpeedLaw
from densarm.values.arrays import Array
from densarm.world.active_pairs import DistanceBounds
from densarm.world.stopping import StoppingTrajectory

_REST = 1e-3  # [rad/s or m/s], below which the arm is held where it is
_GENTLE_BANDWIDTH = 8.0  # [1/s] of the observer, stable with a delay of 50 ms in the state
_FADING = 0.015  # [s] in which braking fades, as slowly as torque may change where the arm holds
_ACCELERATION_SHARE = 0.97  # asked for: a torque is held while the state changes


class StopAndHold:
    r"""Brings an arm to rest along a straight line of joint space and keeps it there.

    .. math::

        \tau = H - M \dot q / (T - t) - \hat d, \qquad
        \tau = H - M \big( K_p (q \ominus q_{rest}) + K_v \dot q \big) - \hat d,

    t the time since it began and T as in `StoppingTrajectory`; torques and accelerations are
    within the limits, and the torque's rate too while the arm holds. d̂ is what the model does not
    explain, by a `DisturbanceObserver`, so that the arm does not sag under a load that is not told.
    Where gravity asks for more torque than there is, the arm cannot be held. The period is the time
    between two calls [s].

    Attributes:
        dynamics: with what is known of disturbance and torques.
    """

    def __init__(
        self,
        arm: Arm,
        gains: Gains,
        period: float,
        actuation: ActuationParameters = ActuationParameters(),
    ) -> None:
        self._arm = arm
        self._gains = gains
        self._period = self._shortest = period
        limit = _ACCELERATION_SHARE * arm.limits.acceleration
        self.dynamics = InverseDynamics(arm, limit, None, period, actuation)
        self.dynamics.load()
        self._bandwidth = actuation.bandwidth
        self._time = 0.0
        self._stopping = StoppingTrajectory(arm, _ACCELERATION_SHARE)
        self._time_left = math.nan
        self._rest: Array | None = None
        self._known: Array | None = None  # of the disturbance, before it stopped

    @property
    def is_holding(self) -> bool:
        """Whether the arm has come to rest since the last `begin`."""
        return self._rest is not None

    def begin(self, q: Array, v: Array, known: InverseDynamics | None = None) -> None:
        """Begin to stop from q (nq,) and v (nv,).

        What others know of disturbance and torques is gone on from; without it they are unknown.
        """
        if known is None:  # what was observed when it stopped before is of another motion
            self.dynamics.update(math.nan, q, v)
        else:
            self.dynamics.take_over(known, self._time)
        self._known = None if known is None else known.disturbance
        self.begin_again(q, v)
        self._shortest = max(self._period, _FADING)
        self.dynamics.set_bandwidth(self._bandwidth)

    def begin_again(self, q: Array, v: Array) -> None:
        """Begin anew from another state, as the arm turned out to be in while it stopped.

        From now on it ends gently, as -K_v q̇, which is stable with a delayed state too, as all is
        that is learned of the disturbance: states that were wrong have shaped it since.
        """
        self._time_left = self._stopping.duration(q, v)
        self._shortest = max(self._period, 1.0 / self._gains.velocity)
        self._rest = None
        self.dynamics.set_bandwidth(min(self._bandwidth, _GENTLE_BANDWIDTH))
        self.dynamics.move_to(q, v, self._known)

    def lead(self, q: Array, step: float) -> None:
        """Move where the arm is held by a step [rad or m] at most towards q (nq,), straight."""
        if self._rest is not None:
            way = self._arm.difference(self._rest, q)
            share = min(1.0, step / max(float(np.abs(way).max()), step))
            self._rest = self._arm.integrate(self._rest, share * way)

    def torque(self, q: Array, v: Array, dt: float) -> Array:
        """Return the torque (nv,) [N·m or N] at q (nq,) and v (nv,), dt [s] after the last call."""
        self._time, self._time_left = self._time + dt, self._time_left - dt
        self.dynamics.update(self._time, q, v)
        is_braking = self._rest is None
        if is_braking and np.abs(v).max() <= _REST:
            self._rest = q.copy()
        if self._rest is not None:
            error = self._arm.difference(self._rest, q)
            brake, attract = -self._gains.velocity * v, -self._gains.position * error
            # The torque of the brake would push a resting arm on: it ends at once.
            tau = self.dynamics.torque(brake, attract)
            return self.dynamics.send(tau, is_emergency=is_braking)
        tau = self.dynamics.brake_torque(v, self._time_left, self._shortest)
        return self.dynamics.send(tau, is_emergency=True)


class BackupFilter:
    r"""Replaces a torque by that which stops the arm where it could not be proved to stop after it.

    From a state with a clear stopping trajectory the next one has one too: if not after the torque
    that is asked for, then after the first part of the trajectory itself. Before, the filter limits
    the jerk: of a wanted acceleration a* there is

    .. math::

        a_k = a_{k-1} + s\,(a^* - a_{k-1}), \qquad
        s = \min\Big\{1, \min_i \frac{a_i^{max} \Delta t / T}{|a^*_i - a_{k-1,i}|}\Big\}

    a_k is between a_{k-1} and a*: within any convex limits that both keep. The feedback a* =
    K_v (k - q̇) settles from its largest acceleration by K_v a^max per second: T = 1 / K_v lets that
    pass, and spreads the jumps of k. After a pause of more than a period and a half the arm counts
    as unaccelerated. The jerk of stopping is not limited.

    The period is the time that a torque is held [s].

    Attributes:
        last: a_k, what the model makes of the torque sent last (nv,) [rad/s²].
    """

    def __init__(self, arm: Arm, speed_law: SpeedLaw, gains: Gains, period: float) -> None:
        self._arm = arm
        self._data = arm.model.createData()
        self._speed_law = speed_law
        self._period = period
        self._stopping = StoppingTrajectory(arm)
        smoothing_time = 1.0 / gains.velocity
        self._step = arm.limits.acceleration * (period / smoothing_time)
        self.last, self._time = np.zeros(arm.nv), math.nan

    def torque(
        self,
        t: float,
        dynamics: InverseDynamics,
        q: Array,
        v: Array,
        wanted: Array,
        distances: DistanceBounds,
    ) -> Array:
        """Send the wanted torque (nv,) [N·m or N] as far as the jerk allows, or that to stop.

        The dynamics are updated at q (nq,) and v (nv,), where the distances of all pairs are these.
        """
        if not abs(t - self._time) <= 1.5 * self._period:
            self.last = np.zeros_like(wanted)
        self._time = t
        unknown = dynamics.disturbance
        a, tau = self.acceleration(q, v, wanted + unknown), wanted
        change = a - self.last
        excess = float((np.abs(change) / self._step).max())
        if not excess <= 1.0:
            limit = self._arm.limits.effort
            tau = pin.rnea(self._arm.model, self._data, q, v, self.last + change / excess)
            tau = np.asarray(np.clip(tau - unknown, -limit, limit))
        tau = dynamics.send(tau)
        a = self.acceleration(q, v, tau + unknown)
        v_next = v + self._period * a
        motion = self._period * np.maximum(np.abs(v), np.abs(v_next))
        q_next = self._arm.integrate(q, self._period * v_next)
        if not self._speed_law.can_stop(q_next, v_next, distances, motion):
            tau = dynamics.brake_torque(v, self._stopping.duration(q, v), self._period)
            tau = dynamics.send(tau, is_emergency=True)
            a = self.acceleration(q, v, tau + unknown)
        self.last = a
        return tau

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        """Return what a torque (nv,) makes of q (nq,) and v (nv,) [rad/s²]."""
        return np.array(pin.aba(self._arm.model, self._data, q, v, tau))
