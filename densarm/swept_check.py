"""SweptCheck: proof that a whole sampled motion touches nothing."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from densarm.arrays import Array
from densarm.swept_bound import SweptBound


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
    """Sample at or after which it failed; -1 when clear."""
    pairs: tuple[tuple[str, str], ...]
    """The pairs in contact or undecided there; empty when clear."""
    evaluations: int
    """Configurations at which distances were computed."""


class SweptCheck:
    """Proves a sampled motion clear by bisection over arcs of it.

    An arc from sample a to sample b moves a pair's bodies by at most μ = Σ_j r_j s_j, s_j the
    summed |Δq_j| along it and what the true motion departs from the chords. The pair is apart on
    all of the arc if d(q_a) + d(q_b) > μ; else the arc is halved, down to parts of one chord.

    Args:
        bound: the bound r_j and the margin to be kept.
    """

    def __init__(self, bound: SweptBound) -> None:
        self._bound = bound
        self._arm = bound.arm

    def check(self, q: Array, departure: Array | None = None) -> SweptResult:
        """Return whether the motion through samples is proved clear.

        Args:
            q: samples (N, nq), N >= 1, joined by straight segments of joint space.
            departure: bound on how far the motion departs from each segment, per joint
                (N - 1, nv) [rad or m]; None for zero.
        """
        steps = np.abs(self._arm.difference(q[:-1], q[1:]))
        if departure is not None:
            # A point that departs from its chord is that much farther from both of its ends.
            steps = steps + 2.0 * departure
        travelled = np.vstack([np.zeros(self._arm.nv), np.cumsum(steps, axis=0)])
        slack = {k: self._bound.slack(q[k]) for k in {0, len(q) - 1}}
        arcs = [(0, len(q) - 1)]
        while arcs:
            a, b = arcs.pop()
            for end in (a, b):
                if (slack[end] <= 0.0).any():
                    return self._failure(SweptVerdict.CONTACT, end, slack[end] <= 0.0, len(slack))
            near = slack[a] + slack[b] <= self._bound.motion(travelled[b] - travelled[a])
            if not near.any():
                continue
            if b - a > 1:
                middle = (a + b) // 2
                slack[middle] = self._bound.slack(q[middle])
                arcs += [(middle, b), (a, middle)]
            elif not self._chord_is_clear(q[a], q[b], None if departure is None else departure[a]):
                return self._failure(SweptVerdict.UNDECIDED, a, near, len(slack))
        return SweptResult(SweptVerdict.CLEAR, -1, (), len(slack))

    def _chord_is_clear(self, q_a: Array, q_b: Array, departure: Array | None) -> bool:
        """Decide one chord by bisection; departing bodies come nearer by what they depart."""
        if departure is None:
            return self._bound.segment_is_clear(q_a, q_b)
        extra = float(self._bound.motion(departure).max(initial=0.0))
        return self._bound.with_margin(self._bound.margin + extra).segment_is_clear(q_a, q_b)

    def _failure(
        self, verdict: SweptVerdict, index: int, failing: Array, evaluations: int
    ) -> SweptResult:
        pairs = tuple(self._bound.clearance.pairs[k] for k in np.flatnonzero(failing))
        return SweptResult(verdict, int(index), pairs, evaluations)
