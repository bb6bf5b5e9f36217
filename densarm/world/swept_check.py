"""SweptCheck: proof by distances at a few configurations that a motion touches nothing."""

from dataclasses import dataclass
from enum import StrEnum
from heapq import heappop, heappush
from itertools import count

import numpy as np

from densarm.arms.arm import Arm
from densarm.values.arrays import Array
from densarm.values.checks import non_negative
from densarm.world.world import DISTANCE_TOLERANCE, Pairs, World

_SEEN = 0.3  # [m], up to which margins of many thousands of pairs are no mere bounds
_DEPTH_FLOOR = 1e-5  # [rad or m], a shorter segment that is still not proved counts as not clear


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
    evaluated: Array
    """Increasing places at which distances were computed: of a sample the index, plus a fraction
    of the way to the next."""
    distance: float
    """Smallest distance that was met there [m]; infinite without pairs."""


class SweptCheck:
    r"""Proves motions clear by distances at their ends, and where that fails by bisection.

    While the joints move by |Δq_j|, a point of one body of pair k moves against the other by at
    most

    .. math:: \mu_k = \sum_j r_{kj} |\Delta q_j|,

    r_kj the Lipschitz constants of the world. If d_k(q_a) + d_k(q_b) > μ_k the pair is apart on the
    whole motion; else it is tried again on both halves of it.

    What an obstacle goes meanwhile, by its motion, is added to μ_k where times are told.

    Args:
        world: the pairs.
        margin: distance that must be exceeded for a pair to count as apart [m].
        kept: how much more that is for each pair (K,), or for all [m].

    Raises:
        InvalidValueError: a negative margin.
    """

    def __init__(self, world: World, margin: float = 0.0, kept: float | Array = 0.0) -> None:
        self.world = world
        self.arm = world.arm
        self.margin = non_negative("margin", margin)
        self._least = np.full(world.n_pairs, margin + DISTANCE_TOLERANCE) + kept

    def distance_margin(self, q: Array, pairs: Pairs | None = None) -> Array:
        """Return by how much distances surely exceed the margin, and what is kept beyond [m].

        Args:
            q: configuration (nq,).
            pairs: indices of the pairs to look at; None for all, (K,).
        """
        least = self._least if pairs is None else self._least[pairs]
        limit = _SEEN + float(least.max(initial=0.0))
        return self.world.distances_within(q, limit, pairs) - least

    def least_distance_margin(self, q: Array) -> float:
        """Return the smallest distance margin [m] at configurations (N, nq); infinite of none."""
        return min(float(self.distance_margin(row).min(initial=np.inf)) for row in q)

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether every distance at q (nq,) exceeds the margin."""
        return bool((self.distance_margin(q) > 0.0).all())

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether every distance is proved above the margin on the whole segment.

        Args:
            q_a: one end (nq,).
            q_b: the other end (nq,), reached the short way round on continuous joints.
        """
        return self.clear_subdivision(q_a, q_b) is not None

    def clear_subdivision(self, q_a: Array, q_b: Array, surplus: float = 1.0) -> Array | None:
        """Return where the proof split the segment, or None if it is not proved clear.

        Args:
            q_a: one end (nq,).
            q_b: the other end (nq,).
            surplus: factor >= 1 by which d(q_a) + d(q_b) must exceed μ; above 1 it splits more.

        Returns:
            Increasing fractions from 0 to 1; between neighbours one bound proves every pair.
        """
        result = self._bisect(_Polyline(self.arm, np.stack([q_a, q_b])), surplus)
        return result.evaluated if result.verdict == SweptVerdict.CLEAR else None

    def check(
        self, q: Array, departure: Array | None = None, time: Array | None = None
    ) -> SweptResult:
        """Return whether the motion through samples is proved clear.

        On an arc from a to b of the polyline through the samples the joints move by s_j, their
        summed |Δq_j|. The true motion departs from a chord by at most δ_j, none at its ends, so
        that the pair is apart on all of the arc if

            d_k(q_a) + d_k(q_b) > Σ_j r_kj (s_j + 2 max δ_j);

        else the arc is halved, first at samples, then within chords.

        Args:
            q: samples (N, nq), N >= 1, joined by straight segments of joint space.
            departure: bound on how far the motion departs from each segment, per joint
                (N - 1, nv) [rad or m], at any time; None for zero.
            time: increasing times of the samples (N,) [s], between which time passes evenly on
                each segment: obstacles with a motion are where it has them then, and the world
                is left at some time of them. None for obstacles as they are now.
        """
        fastest = self.world.fastest_obstacle
        moves = time is not None and fastest > 0.0
        return self._bisect(_Polyline(self.arm, q, departure, time if moves else None, fastest))

    def _bisect(self, line: "_Polyline", surplus: float = 1.0) -> SweptResult:
        """Prove pairs apart along a polyline.

        Arcs whose ends are nearest to contact come first, so that a motion that cannot be proved is
        given up early.
        """
        every, met = np.arange(self.world.n_pairs), dict[float, float]()

        def margin_at(t: float, pairs: Pairs) -> Array:
            if line.time.size:
                self.world.set_time(line.time_at(t))
            margin = self.distance_margin(line.configuration(t), pairs)
            met[t] = float((margin + self._least[pairs]).min(initial=np.inf))
            return margin

        margin_a, margin_b = margin_at(0, every), margin_at(line.end, every)
        for t, margin in ((0, margin_a), (line.end, margin_b)):
            if (margin <= 0.0).any():
                return self._result(SweptVerdict.CONTACT, met, t, every[margin <= 0.0])
        newest_first = count(0, -1)
        pending = [(0.0, next(newest_first), 0.0, line.end, margin_a, margin_b, every)]
        while pending:
            _, _, a, b, margin_a, margin_b, pairs = heappop(pending)
            near = ~(margin_a + margin_b > surplus * self._motion(line, a, b, pairs))
            if not near.any():
                continue
            pairs, margin_a, margin_b = pairs[near], margin_a[near], margin_b[near]
            middle = line.split(a, b)
            if middle is None:
                return self._result(SweptVerdict.UNDECIDED, met, a, pairs)
            margin = margin_at(middle, pairs)
            if (margin <= 0.0).any():
                return self._result(SweptVerdict.CONTACT, met, middle, pairs[margin <= 0.0])
            for half in ((a, middle, margin_a, margin), (middle, b, margin, margin_b)):
                nearness = float((half[2] + half[3]).min())
                heappush(pending, (nearness, next(newest_first), *half, pairs))
        return self._result(SweptVerdict.CLEAR, met, min(met, key=met.__getitem__), every[:0])

    def _motion(self, line: "_Polyline", a: float, b: float, pairs: Pairs) -> Array:
        """Return how far bodies of pairs (P,) move against each other at most from a to b [m]."""
        motion = self.world.motion_bound(line.travel(a, b), pairs)
        if line.time.size:
            motion += self.world.motion_way(line.time_at(a), line.time_at(b))[pairs]
        return motion

    def _result(
        self, verdict: SweptVerdict, met: dict[float, float], at: float, failing: Pairs
    ) -> SweptResult:
        pairs = tuple(map(self.world.pair_names, failing))
        return SweptResult(verdict, int(at), pairs, np.unique(list(met)), min(met.values()))


class _Polyline:
    """The polyline through samples, its parameter t the index of a sample plus a fraction."""

    def __init__(
        self,
        arm: Arm,
        q: Array,
        departure: Array | None = None,
        time: Array | None = None,
        fastest: float = 0.0,
    ) -> None:
        self._arm = arm
        self._q = q
        self.time = np.zeros(0) if time is None else time
        self._fastest = fastest
        self._step = arm.difference(q[:-1], q[1:])
        self._departure = np.zeros_like(self._step) if departure is None else departure
        length = np.cumsum(np.abs(self._step), axis=0)
        self._length = np.vstack([np.zeros(arm.nv), length])
        self.end = len(q) - 1

    def configuration(self, t: float) -> Array:
        k = int(t)
        return self._q[k] if k == t else self._arm.integrate(self._q[k], (t - k) * self._step[k])

    def time_at(self, t: float) -> float:
        k = int(t)
        later = self.time[k + 1] - self.time[k] if k < t else 0.0
        return float(self.time[k] + (t - k) * later)

    def travel(self, a: float, b: float) -> Array:
        """Return the bound s_j + 2 max δ_j (nv,) on the motion of the joints from a to b."""
        departure = self._departure[int(a) : int(np.ceil(b))].max(axis=0, initial=0.0)
        return np.asarray(self._length_at(b) - self._length_at(a) + 2.0 * departure)

    def split(self, a: float, b: float) -> float | None:
        if b - a > 1:
            return (a + b) // 2
        if not b > a:
            return None
        longest = float(np.abs(self._step[int(a)]).max()) * (b - a)
        if self.time.size:
            longest = max(longest, self._fastest * (self.time_at(b) - self.time_at(a)))
        return 0.5 * (a + b) if longest > _DEPTH_FLOOR else None

    def _length_at(self, t: float) -> Array:
        k = int(t)
        part = 0.0 if k == t else (t - k) * np.abs(self._step[k])
        return np.asarray(self._length[k] + part)
