"""Stopping trajectories: from a moving state to rest, within the limits and proved clear."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.dynamics import JointTorques
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes, configuration_tube
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

HELD_SHARE = 0.95
"""Share of the acceleration limits that is asked for: a torque is held while the state changes."""

_PIECES = 8  # of a stopping trajectory among moving obstacles

_SHARES = np.array([0.0, 0.25, 0.5, 0.75, 1.0, 1.0])  # of T, at which torques are computed
_BRAKES = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])  # or, at last, holds
_GROWTH = 1.01  # of T at least, where torques exceed their limits
_LARGEST_GROWTH = 2.0
_ROUNDS = 40
_LARGEST_GROUP = 256  # samples whose stopping trajectories are tried at once
_ROUNDING = 1e-9  # [rad or m], and relative, of torques at their limits


class StoppingTrajectory:
    r"""Stops from a state with q̈ antiparallel to q̇, so that the arm stays on a straight line.

    .. math::

        \dot q(t) = (1 - t/T)\, v, \qquad q(t) = q \oplus (t - t^2/2T)\, v, \qquad
        \tau(t) = H(q(t), \dot q(t)) - M(q(t))\, v / T

    T is the shortest found for which accelerations are within the limits, and torques at five
    instants of it and at rest after it. The arm comes to rest at q ⊕ T v / 2.

    Args:
        arm: its dynamics and limits.
        acceleration_share: of the acceleration limits that it may use.
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
        """Return T (N,) [s] from each state; zero at rest, infinite where none was found.

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


@dataclass(frozen=True)
class StoppingResult:
    """What a stopping check found, for each of N samples."""

    duration: Array
    """Time that stopping takes (N,) [s]; infinite where none was found within the limits."""
    end: Array
    """Joint positions where it ends (N, nv) [rad or m]; where it begins if there is none."""
    inside: NDArray[np.bool_]
    """Whether it ends inside the position limits (N,)."""
    clear: NDArray[np.bool_]
    """Whether it is proved clear (N,)."""

    @property
    def holds(self) -> NDArray[np.bool_]:
        """Whether stopping is proved (N,)."""
        return np.isfinite(self.duration) & self.inside & self.clear

    @property
    def failing(self) -> NDArray[np.int64]:
        """Samples from which stopping is not proved."""
        return np.flatnonzero(~self.holds)


class StoppingCheck:
    r"""Proves the stopping trajectories from all samples of a motion clear, many at a time.

    Those of neighbouring samples are segments of joint space that nearly lie on one line, in
    one tube of radius δ_j. A proof of its middle with bodies grown by Σ_j r_kj δ_j proves all of
    them. Where there is none the samples are halved.

    Pairs of obstacles with a motion are proved one sample after the other where times are told:
    along a stopping trajectory q + v (t - t²/2T), obstacles moving meanwhile.

    Args:
        world: the pairs, and the Lipschitz constants r_kj of their distances.
        stopping: how the arm stops.
        margin: distance that must be exceeded for a pair to count as apart [m].
        kept: how much more that is for each pair (K,), or for all [m].
    """

    def __init__(
        self,
        world: World,
        stopping: StoppingTrajectory,
        margin: float = 0.0,
        kept: float | Array = 0.0,
    ) -> None:
        self._arm = world.arm
        self._stopping = stopping
        self._planes = SeparatingPlanes(world, margin, kept)
        self._swept = SweptCheck(world, margin, kept)

    def check(self, q: Array, v: Array, time: Array | None = None) -> StoppingResult:
        """Return from which samples stopping is proved.

        Args:
            q: configurations (N, nq).
            v: velocities (N, nv) [rad/s or m/s].
            time: of the samples (N,) [s]; None for obstacles as they are now.
        """
        arm, limits = self._arm, self._arm.limits
        duration = self._stopping.durations(q, v)
        travel = 0.5 * np.where(np.isfinite(duration), duration, 0.0)[:, np.newaxis] * v
        end = arm.angles(q) + travel
        outside = limits.excess(end).max(axis=1)
        inside = np.asarray(outside <= _ROUNDING)
        angles = arm.unwrapped(q)
        if time is None:
            clear = self.are_clear(angles, travel)
        else:
            clear = self._clear_meanwhile(angles, v, np.where(inside, duration, np.inf), time)
        return StoppingResult(duration, end, inside, clear)

    def _clear_meanwhile(
        self, angles: Array, v: Array, duration: Array, time: Array
    ) -> NDArray[np.bool_]:
        """Return what is proved clear (N,) while obstacles move, of what has a duration."""
        shares = np.linspace(0.0, 1.0, _PIECES + 1)
        clear = np.zeros(len(angles), dtype=np.bool_)
        for n in np.flatnonzero(np.isfinite(angles + v).all(axis=1) & np.isfinite(duration)):
            length = duration[n]
            way = np.outer(length * shares * (1.0 - 0.5 * shares), v[n])
            # The deceleration is v / T: off the chord of a piece by that times its time² / 8.
            departure = np.tile(np.abs(v[n]) * length / (8.0 * _PIECES**2), (_PIECES, 1))
            q, times = self._arm.configurations(angles[n] + way), time[n] + length * shares
            clear[n] = self._swept.check(q, departure, times).verdict == SweptVerdict.CLEAR
        return clear

    def are_clear(self, angles: Array, travel: Array) -> NDArray[np.bool_]:
        """Return which segments of joint space are proved clear (N,); neighbours should be alike.

        Args:
            angles: where they begin (N, nv) [rad or m]; continuous joints count their turns.
            travel: from there to where they end (N, nv) [rad or m].
        """
        n, end = len(angles), angles + travel
        clear = np.zeros(n, dtype=np.bool_)
        if not np.isfinite(end).all():
            return clear
        waiting = [(a, min(a + _LARGEST_GROUP, n)) for a in range(0, n, _LARGEST_GROUP)]
        while waiting:
            a, b = waiting.pop()
            points = np.vstack([angles[a:b], end[a:b]])
            if self._planes.tube_is_clear(configuration_tube(points, points[-1] - points[0])):
                clear[a:b] = True
            elif b - a > 1:
                m = (a + b) // 2
                waiting += [(a, m), (m, b)]
        return clear
