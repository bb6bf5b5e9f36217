"""SweptCheck: proof that a whole sampled motion touches nothing."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from densarm.arrays import Array
from densarm.clearance import DISTANCE_TOLERANCE
from densarm.proof.bisection import bisect
from densarm.proof.swept_bound import SweptBound


class SweptVerdict(StrEnum):
    """Answer of a swept check."""

    CLEAR = "clear"
    """Every pair is proved apart during the whole motion."""
    CONTACT = "contact"
    """A pair is not apart at some configuration of the motion."""
    UNDECIDED = "undecided"
    """Neither was shown before the depth floor; never counts as clear."""


@dataclass(frozen=True)
class SweptResult:
    """What a swept check found."""

    verdict: SweptVerdict
    index: int
    """Sample at or after which it failed; when clear, where the smallest distance was met."""
    pairs: tuple[tuple[str, str], ...]
    """The pairs in contact or undecided there; empty when clear."""
    evaluations: int
    """Configurations at which distances were computed."""
    distance: float
    """Smallest distance that was met there [m]; infinite without pairs."""


class SweptCheck:
    """Proves a sampled motion clear by bisection over arcs of it.

    On an arc from a to b of the polyline through the samples the bodies of pair k move against
    each other by at most Σ_j r_kj s_j, s_j the summed |Δq_j|. The true motion departs from a chord
    by at most δ_j, none at its ends, so that the pair is apart on all of the arc if

        d_k(q_a) + d_k(q_b) > Σ_j r_kj (s_j + 2 max δ_j);

    else the arc is halved, first at samples, then within chords.

    Args:
        bound: the bound r_kj and the margin to be kept.
    """

    def __init__(self, bound: SweptBound) -> None:
        self._bound = bound

    def check(self, q: Array, departure: Array | None = None) -> SweptResult:
        """Return whether the motion through samples is proved clear.

        Args:
            q: samples (N, nq), N >= 1, joined by straight segments of joint space.
            departure: bound on how far the motion departs from each segment, per joint
                (N - 1, nv) [rad or m]; None for zero.
        """
        clearance = self._bound.clearance
        polyline = _Polyline(self._bound, q, departure)
        result = bisect(
            slack=lambda t, pairs: self._bound.slack(polyline.configuration(t), pairs),
            motion=lambda a, b, pairs: self._bound.motion(polyline.travel(a, b), pairs),
            split=polyline.split,
            ends=(0, len(q) - 1),
            n_pairs=clearance.n_pairs,
        )
        evaluations = len(result.evaluated)
        distance = result.smallest + self._bound.margin + DISTANCE_TOLERANCE
        if not len(result.failing):
            nearest = int(result.smallest_at)
            return SweptResult(SweptVerdict.CLEAR, nearest, (), evaluations, distance)
        verdict = SweptVerdict.CONTACT if result.in_contact else SweptVerdict.UNDECIDED
        pairs = tuple(clearance.pairs[k] for k in result.failing)
        return SweptResult(verdict, int(result.failed_at), pairs, evaluations, distance)


class _Polyline:
    """The polyline through samples, its parameter t the index of a sample plus a fraction."""

    def __init__(self, bound: SweptBound, q: Array, departure: Array | None) -> None:
        self._arm, self._floor = bound.arm, bound.DEPTH_FLOOR
        self._q = q
        self._step = self._arm.difference(q[:-1], q[1:])
        self._departure = np.zeros_like(self._step) if departure is None else departure
        length = np.cumsum(np.abs(self._step), axis=0)
        self._length = np.vstack([np.zeros(self._arm.nv), length])

    def configuration(self, t: float) -> Array:
        k = int(t)
        return self._q[k] if k == t else self._arm.integrate(self._q[k], (t - k) * self._step[k])

    def travel(self, a: float, b: float) -> Array:
        """Return the bound s_j + 2 max δ_j (nv,) on the motion of the joints from a to b."""
        departure = self._departure[int(a) : int(np.ceil(b))].max(axis=0, initial=0.0)
        return np.asarray(self._length_at(b) - self._length_at(a) + 2.0 * departure)

    def split(self, a: float, b: float) -> float | None:
        if b - a > 1:
            return (a + b) // 2
        longest = float(np.abs(self._step[int(a)]).max()) * (b - a) if b > a else 0.0
        return 0.5 * (a + b) if longest > self._floor else None

    def _length_at(self, t: float) -> Array:
        k = int(t)
        part = 0.0 if k == t else (t - k) * np.abs(self._step[k])
        return np.asarray(self._length[k] + part)
