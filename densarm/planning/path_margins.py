"""What a path keeps from obstacles and position limits, at its ends and along it."""

from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.swept_check import SweptCheck

LIMIT_INSET = 0.002
"""Distance from position limits at which a motion leaves and arrives [rad or m]."""

_END_SHARE = 0.5  # of the clearance at start and goal that a path's margin may take
_HALVINGS = 8  # of what a path keeps, until that is proved


class Ends(NamedTuple):
    """Where a way to a goal begins and ends, inside position limits."""

    depart: Array
    """Its first configuration (nq,)."""
    arrive: Array
    """Its last (nq,)."""
    least: Array
    """What pairs may keep beyond the safety margin there (K,) [m]."""


def ends_between(check: SweptCheck, start: Array, goal: Array) -> Ends:
    """Return where a way between two configurations (nq,) begins and ends."""
    depart, arrive = (inside_limits(check, q) for q in (start, goal))
    return Ends(depart, arrive, kept_at(check, [start, depart, arrive]))


def kept_at(check: SweptCheck, ends: Iterable[Array]) -> Array:
    """Return what pairs may keep beyond the safety margin at the ends of a path (K,) [m]."""
    least = np.min([check.distance_margin(q) for q in ends], axis=0)
    return np.asarray(np.maximum(0.0, _END_SHARE * least))


def kept_along(check: SweptCheck, points: Array, kept: Array) -> Array:
    """Return how much of what pairs shall keep (K,) [m] is proved along a polyline (N, nq)."""
    for halving in range(_HALVINGS):
        space = SeparatingPlanes(check.world, check.margin, kept)
        if not kept.any() or all(space.segment_is_clear(a, b) for a, b in pairwise(points)):
            return kept
        if halving == 0:
            met = np.min([check.distance_margin(q) for q in points], axis=0)
            kept = np.clip(met, 0.0, kept)
        else:
            kept = 0.5 * kept
    return np.zeros_like(kept)


def inside_limits(check: SweptCheck, q: Array) -> Array:
    """Return where to leave or to reach q (nq,), at which the density must not vanish.

    A configuration at a position limit is on the rim of an unsafe set. The motion keeps a little
    inside, well within what counts as reached, unless something touches there.
    """
    arm, limits = check.arm, check.arm.limits
    low, high = limits.lower + LIMIT_INSET, limits.upper - LIMIT_INSET
    angles = arm.angles(q)
    if np.array_equal(angles, clipped := np.clip(angles, low, high)):
        return q
    inside = arm.configurations(clipped)
    return inside if check.segment_is_clear(q, inside) else q
