"""StoppingCheck: proof that an arm could stop in free space from every sample of a motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
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

    The brakes of neighbouring samples are segments of joint space that nearly lie on one line. A
    tube, all points within δ_j per joint of a segment, is convex: it holds a brake if it holds
    both ends of it. A proof of the segment with bodies grown by Σ_j r_kj δ_j proves all brakes
    in its tube. Where there is none the samples are halved.

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
            if self._planes.tube_is_clear(*_tube(angles[a:b], end[a:b])):
                clear[a:b] = True
            elif b - a > 1:
                m = (a + b) // 2
                waiting += [(a, m), (m, b)]
        return clear


def _tube(first: Array, last: Array) -> tuple[Array, Array, Array]:
    """Return one end of a segment, the step to the other, and the radius of a tube of points.

    Args:
        first: where brakes begin (N, nv) [rad or m].
        last: where they end (N, nv) [rad or m].
    """
    points, begin, step = np.vstack([first, last]), first[0], last[-1] - first[0]
    square = float(step @ step)
    share = np.clip((points - begin) @ step / square, 0.0, 1.0) if square > 0.0 else 0.0
    off = points - begin - np.multiply.outer(share, step)
    low, high = off.min(axis=0), off.max(axis=0)
    return begin + 0.5 * (low + high), step, 0.5 * (high - low)
