"""TubeCheck: a fast proof that a sampled motion touches nothing."""

from densarm.arrays import Array
from densarm.proof.enclosing_tube import enclosing_tube
from densarm.proof.separating_planes import SeparatingPlanes
from densarm.proof.swept_bound import SweptBound
from densarm.proof.swept_check import SweptCheck, SweptVerdict

_LARGEST_GROUP = 64  # chords that are tried at once


class TubeCheck:
    """Proves what `SweptCheck` does, in tubes around many chords each.

    A chord in no tube that is proved clear is left to `SweptCheck` and its exact distances.

    Args:
        bound: the bound on motion and the margin to be kept.
    """

    def __init__(self, bound: SweptBound) -> None:
        self._arm = bound.arm
        self._planes = SeparatingPlanes(bound)
        self._swept = SweptCheck(bound)

    def check(self, angles: Array, departure: Array) -> SweptVerdict:
        """Return whether the motion through samples is proved clear.

        Args:
            angles: joint positions (N, nv), N >= 2, continuous joints counting their turns
                [rad or m].
            departure: bound on how far the motion departs from each chord, per joint
                (N - 1, nv) [rad or m].
        """
        last = len(departure)
        firsts = range(0, last, _LARGEST_GROUP)
        waiting = [(a, min(a + _LARGEST_GROUP, last)) for a in firsts]
        while waiting:
            a, b = waiting.pop()
            points, off = angles[a : b + 1], departure[a:b].max(axis=0)
            begin, step, radius = enclosing_tube(points, points[-1] - points[0])
            if self._planes.tube_is_clear(begin, step, radius + off):
                continue
            if b - a > 1:
                m = (a + b) // 2
                waiting += [(a, m), (m, b)]
                continue
            result = self._swept.check(self._arm.configurations(points), departure[a:b])
            if result.verdict != SweptVerdict.CLEAR:
                return result.verdict
        return SweptVerdict.CLEAR
