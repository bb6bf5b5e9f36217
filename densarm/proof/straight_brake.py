"""StraightBrake: the shortest brake along a straight line of joint space within the limits."""

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.joint_torques import JointTorques

HELD_SHARE = 0.95
"""Share of the acceleration limits that is asked for: a torque is held while the state changes."""

_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.0])  # of T, at which torques are computed
_BRAKES = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])  # or, at last, holds
_GROWTH = 1.01  # of T at least, where torques exceed their limits
_LARGEST_GROWTH = 2.0
_ROUNDS = 40
_ROUNDING = 1e-9  # relative, of torques at their limits


class StraightBrake:
    r"""Brakes from a state with q̈ antiparallel to q̇, so that the arm stays on a straight line.

    .. math::

        \dot q(t) = (1 - t/T)\, v, \qquad q(t) = q \oplus (t - t^2/2T)\, v, \qquad
        \tau(t) = H(q(t), \dot q(t)) - M(q(t))\, v / T

    T is the shortest found for which accelerations are within the limits, and torques at five
    instants of the brake and at rest after it. The arm comes to rest at q ⊕ T v / 2.

    Args:
        arm: its dynamics and limits.
        acceleration_share: of the acceleration limits that the brake may use.
        torque_share: of the torque limits that it may use.
    """

    def __init__(
        self, arm: Arm, acceleration_share: float = HELD_SHARE, torque_share: float = 1.0
    ) -> None:
        self._arm = arm
        self._torques = JointTorques(arm)
        self._acceleration = acceleration_share * arm.limits.acceleration
        self._effort = torque_share * arm.limits.effort * (1.0 + _ROUNDING)

    def duration(self, q: Array, v: Array) -> float:
        """Return T [s] from one state, q (nq,) and v (nv,); as `durations`."""
        return float(self.durations(q[np.newaxis], v[np.newaxis])[0])

    def durations(self, q: Array, v: Array) -> Array:
        """Return T (N,) [s] from each state; zero at rest, infinite where no brake was found.

        Args:
            q: configurations (N, nq).
            v: velocities (N, nv) [rad/s or m/s].
        """
        angles = self._arm.angles(q)
        duration: Array = (np.abs(v) / self._acceleration).max(axis=1)
        longer = np.flatnonzero((duration > 0.0) & np.isfinite(duration))
        for _ in range(_ROUNDS):
            growth = self._growth(angles[longer], v[longer], duration[longer])
            longer, growth = longer[growth > 1.0], growth[growth > 1.0]
            if not longer.size:
                return duration
            duration[longer] *= growth
        duration[longer] = np.inf
        return duration

    def _growth(self, angles: Array, v: Array, duration: Array) -> Array:
        """Return the factors by which the durations (N,) must grow, one where torques hold."""
        time = (_SHARES - 0.5 * _SHARES**2) * duration[:, np.newaxis]
        theta = angles[:, np.newaxis] + time[..., np.newaxis] * v[:, np.newaxis]
        q = self._arm.configurations(theta)
        speed = (1.0 - _SHARES)[:, np.newaxis] * v[:, np.newaxis]
        brake = -_BRAKES[:, np.newaxis] * (v / duration[:, np.newaxis])[:, np.newaxis]
        torque = self._torques(q, speed, brake)
        growth = np.ones(len(v))
        weak = ~(np.abs(torque) <= self._effort).all(axis=(1, 2))
        if not weak.any():
            return growth
        held = self._torques(q[weak], speed[weak], np.zeros_like(speed[weak]))
        growth[weak] = self._needed(held, torque[weak] - held)
        return growth

    def _needed(self, held: Array, brake: Array) -> Array:
        """Return the growth of T by which |held + brake / growth| would come within the limits.

        Args:
            held: H along each brake (N, instants, nv).
            brake: -M v / T there (N, instants, nv).
        """
        bound = np.where(brake > 0.0, self._effort, -self._effort) - held
        with np.errstate(divide="ignore", invalid="ignore"):
            free = np.where(np.abs(held) <= self._effort, np.inf, 0.0)
            share = np.where(brake != 0.0, bound / brake, free).min(axis=(1, 2))
            needed = np.where(share > 0.0, 1.0 / share, _LARGEST_GROWTH)
        needed = np.nan_to_num(needed, nan=_LARGEST_GROWTH)
        return np.asarray(np.clip(needed, _GROWTH, _LARGEST_GROWTH))
