"""MovingGoal: a goal that is set at any time and rate, and where it is in between."""

import math
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.pose import Pose
from densarm.values.arrays import Array

_GOES_ON = 0.1  # [s] for which it goes on without being set again
_FASTEST_POSE = (2.0, 6.0)  # [m/s], [rad/s], above which two poses are a jump


class MovingGoal:
    r"""A goal g_k that was set at t_k, a configuration or a pose, and goes on from there.

    .. math:: g(t) = g_k \oplus (t - t_k)\, w_k, \qquad
        w_k = \frac{g_k \ominus g_{k-1}}{t_k - t_{k-1}} \ \text{where no velocity is told}

    for 0.1 s. After that it rests, where it is by then, or where it was set if its velocity was not
    told. An estimated velocity is zero where the goal before is of another kind, was set more than
    0.1 s ago, or is farther off than the arm's velocity limits reach, as when the goal jumps.

    Args:
        arm: its joint space.
        goal: configuration (nq,), or pose, at rest.
    """

    def __init__(self, arm: Arm, goal: Array | Pose) -> None:
        self._arm, self._goal, self._told = arm, goal, True
        self._velocity, self._time = np.zeros(0), math.nan
        self._before: tuple[Any, float] = (None, math.nan)

    def set(self, goal: Array | Pose, velocity: Array | None) -> None:
        """Take another goal, for the time of the next `at`, and its velocity, None to estimate it.

        That is (nv,) [rad/s or m/s], or of a pose (6,), linear [m/s] and angular [rad/s].
        """
        if not math.isnan(self._time):
            self._before = self._goal, self._time
        self._goal, self._told, self._time = goal, velocity is not None, math.nan
        self._velocity = np.zeros(0) if velocity is None else velocity

    def at(self, t: float) -> tuple[Array | Pose, Array]:
        """Return the goal at a time [s], the very object that was set if it rests, and w_k."""
        if not t >= self._time:
            self._time = t
            if not self._told:
                self._velocity = self._estimate(t)
        since = t - self._time
        if not self._velocity.any() or (since >= _GOES_ON and not self._told):
            return self._goal, np.zeros_like(self._velocity)
        step = min(since, _GOES_ON) * self._velocity
        goes = self._velocity if since < _GOES_ON else np.zeros_like(step)
        if isinstance(self._goal, Pose):
            return self._goal.moved(step), goes
        return self._arm.integrate(self._goal, step), goes

    def _estimate(self, t: float) -> Array:
        before, time = self._before
        now, pose = self._goal, isinstance(self._goal, Pose)
        size = 6 if pose else self._arm.nv
        if not 0.0 < t - time <= _GOES_ON or isinstance(before, Pose) != pose:
            return np.zeros(size)
        if isinstance(now, Pose):
            way = _between(before, now)
            fastest = np.repeat(_FASTEST_POSE, 3)
        else:
            way, fastest = self._arm.difference(before, now), self._arm.limits.velocity
        velocity = way / (t - time)
        return velocity if (np.abs(velocity) <= fastest).all() else np.zeros(size)


def _between(before: Pose, now: Pose) -> Array:
    """Return the step (6,) that `Pose.moved` takes from one pose of a frame to another."""
    a, b = before.placement, now.placement
    turn = pin.log3(b.rotation @ a.rotation.T)
    return np.concatenate([b.translation - a.translation, turn])
