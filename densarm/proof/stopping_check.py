"""StoppingCheck: proof that an arm could stop in free space from every sample of a motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.proof.enclosing_tube import enclosing_tube
from densarm.proof.separating_planes import SeparatingPlanes
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound

_LARGEST_GROUP = 256  # samples whose brakes are tried at once
_ROUNDING = 1e-9  # [rad or m]


@dataclass(frozen=True)
class StoppingResult:
    """What a stopping check found, for each of N samples."""

    duration: Array
    """Time that the brake takes (N,) [s]; infinite where none was found within the limits."""
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
    r"""Proves the straight brakes from all samples of a motion clear, many at a time.

    The brakes of neighbouring samples are segments of joint space that nearly lie on one line, in
    one tube of radius δ_j. A proof of its middle with bodies grown by Σ_j r_kj δ_j proves all of
    them. Where there is none the samples are halved.

    Args:
        bound: the pairs, the bound r_kj on their motion, and the margin to be kept.
        brake: the brake.
    """

    def __init__(self, bound: SweptBound, brake: StraightBrake) -> None:
        self._arm = bound.arm
        self._brake = brake
        self._planes = SeparatingPlanes(bound)

    def check(self, q: Array, v: Array) -> StoppingResult:
        """Return from which samples stopping is proved.

        Args:
            q: configurations (N, nq).
            v: velocities (N, nv) [rad/s or m/s].
        """
        arm, limits = self._arm, self._arm.limits
        duration = self._brake.durations(q, v)
        travel = 0.5 * np.where(np.isfinite(duration), duration, 0.0)[:, np.newaxis] * v
        end = arm.angles(q) + travel
        outside = np.maximum(limits.lower - end, end - limits.upper).max(axis=1)
        inside = np.asarray(outside <= _ROUNDING)
        turns = np.cumsum(arm.difference(q[:-1], q[1:]), axis=0)
        angles = arm.angles(q[0]) + np.vstack([np.zeros(arm.nv), turns])
        return StoppingResult(duration, end, inside, self._clear(angles, travel))

    def _clear(self, angles: Array, travel: Array) -> NDArray[np.bool_]:
        n, end = len(angles), angles + travel
        clear = np.zeros(n, dtype=np.bool_)
        if not np.isfinite(end).all():
            return clear
        waiting = [(a, min(a + _LARGEST_GROUP, n)) for a in range(0, n, _LARGEST_GROUP)]
        while waiting:
            a, b = waiting.pop()
            points = np.vstack([angles[a:b], end[a:b]])
            if self._planes.tube_is_clear(*enclosing_tube(points, points[-1] - points[0])):
                clear[a:b] = True
            elif b - a > 1:
                m = (a + b) // 2
                waiting += [(a, m), (m, b)]
        return clear
