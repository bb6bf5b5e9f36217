"""Bisection: proof along a motion from distances at a few of its configurations."""

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array

Pairs = NDArray[np.int64]


@dataclass(frozen=True)
class Bisection:
    """Outcome of a bisection."""

    evaluated: Array
    """Increasing parameters of the configurations at which distances were computed."""
    failing: Pairs
    """The pairs that were not proved apart; empty when the motion is clear."""
    failed_at: float
    """Parameter at or after which they failed; NaN when clear."""
    in_contact: bool
    """Whether they are in contact there, and not merely unproved."""
    smallest: float
    """Smallest slack that was met [m]; infinite without pairs."""
    smallest_at: float
    """Parameter at which it was met."""


def bisect(
    slack: Callable[[float, Pairs], Array],
    motion: Callable[[float, float, Pairs], Array],
    split: Callable[[float, float], float | None],
    ends: tuple[float, float],
    n_pairs: int,
) -> Bisection:
    """Prove pairs apart along a motion x(t), t between two ends.

    A pair is apart on all of [a, b] if slack(a) + slack(b) > motion(a, b). Other pairs are tried
    again on both halves. Arcs whose ends are nearest to contact come first, so that a motion that
    cannot be proved is given up early.

    Args:
        slack: t and pairs to their distances beyond what must be kept (len(pairs),) [m].
        motion: a, b and pairs to bounds on how far their bodies move in between [m].
        split: a and b to the parameter to evaluate between them, or None to give up.
        ends: the first and the last parameter.
        n_pairs: the pairs are 0 to n_pairs - 1.
    """
    every = np.arange(n_pairs)
    slack_first, slack_last = (slack(t, every) for t in ends)
    met = {t: _least(values) for t, values in zip(ends, (slack_first, slack_last), strict=True)}
    for t, values in zip(ends, (slack_first, slack_last), strict=True):
        if (values <= 0.0).any():
            return _bisection(met, every[values <= 0.0], t, in_contact=True)
    newest_first = count(0, -1)
    pending = [(0.0, next(newest_first), *ends, slack_first, slack_last, every)]
    while pending:
        _, _, a, b, slack_a, slack_b, pairs = heappop(pending)
        near = ~(slack_a + slack_b > motion(a, b, pairs))
        if not near.any():
            continue
        pairs, slack_a, slack_b = pairs[near], slack_a[near], slack_b[near]
        middle = split(a, b)
        if middle is None:
            return _bisection(met, pairs, a, in_contact=False)
        slack_middle = slack(middle, pairs)
        met[middle] = _least(slack_middle)
        if (slack_middle <= 0.0).any():
            return _bisection(met, pairs[slack_middle <= 0.0], middle, in_contact=True)
        for half in ((a, middle, slack_a, slack_middle), (middle, b, slack_middle, slack_b)):
            nearness = float((half[2] + half[3]).min())
            heappush(pending, (nearness, next(newest_first), *half, pairs))
    return _bisection(met, every[:0], np.nan, in_contact=False)


def _least(slack: Array) -> float:
    return float(slack.min(initial=np.inf))


def _bisection(
    met: dict[float, float], failing: Pairs, at: float, *, in_contact: bool
) -> Bisection:
    nearest = min(met, key=met.__getitem__)
    return Bisection(np.unique(list(met)), failing, at, in_contact, met[nearest], nearest)
