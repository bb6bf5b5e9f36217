"""SeparatingPlanes: a fast proof that a straight joint-space segment touches nothing."""

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import DISTANCE_TOLERANCE
from densarm.compiled import compiled
from densarm.proof.moving_hulls import (
    MovingHulls,
    Placements,
    moving_hulls,
    near_pairs,
    place,
    placements,
    write_relative,
)
from densarm.proof.separation import separation
from densarm.proof.swept_bound import SweptBound

_FLOOR = 1e-4  # [rad or m], length of a segment at which one not proved clear counts as not clear


class SeparatingPlanes:
    """Proves segments as `SweptBound` does, but from lower bounds on distances in compiled code.

    A plane between two bodies bounds their distance from below; the bound is within 1 % of the
    distance, and takes the place of it in the proof. Bodies whose enclosing balls are farther
    apart than they move need no plane.

    Args:
        bound: the pairs, the bound on their motion, and the margin to be kept.
    """

    def __init__(self, bound: SweptBound) -> None:
        self._arm = bound.arm
        self._lever = bound.lever
        self._kept = bound.margin + DISTANCE_TOLERANCE
        self._bodies = moving_hulls(bound.clearance)
        self._placements = (placements(self._bodies), placements(self._bodies))
        self._corners = _any_corners(self._bodies)

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether every distance at q (nq,) is proved above the margin."""
        return self.segment_is_clear(q, q)

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether every distance is proved above the margin on the whole segment.

        Args:
            q_a: one end (nq,).
            q_b: the other end (nq,), reached the short way round on continuous joints.
        """
        step = self._arm.difference(q_a, q_b)
        return self.tube_is_clear(self._arm.angles(q_a), step, np.zeros_like(step))

    def tube_is_clear(self, angles: Array, step: Array, radius: Array) -> bool:
        """Return whether every distance is proved above the margin on and around a segment.

        Args:
            angles: joint positions at one end (nv,) [rad or m].
            step: from there to the other end (nv,) [rad or m].
            radius: how far each joint may be off the segment (nv,) [rad or m].
        """
        motion = self._lever @ np.abs(step)
        longest = float(np.abs(step).max())
        depth = 0 if longest <= _FLOOR else int(np.ceil(np.log2(longest / _FLOOR)))
        return bool(
            _segment_is_clear(
                self._bodies,
                *self._placements,
                self._corners,
                angles,
                step,
                motion,
                self._kept + self._lever @ radius,
                depth,
            )
        )


def _any_corners(bodies: MovingHulls) -> NDArray[np.int64]:
    """Return one pair of corners for each pair of shapes, in the form of `separation`."""
    corners = np.full((len(bodies.pairs), 4, 2), -1)
    corners[:, 0] = bodies.hulls.first[bodies.pairs]
    return corners


@compiled
def _segment_is_clear(
    bodies: MovingHulls,
    at_a: Placements,
    at_b: Placements,
    corners: NDArray[np.int64],
    angles: Array,
    step: Array,
    motion: Array,
    kept: Array,
    depth: int,
) -> bool:
    """Prove all pairs; arcs that two distances do not prove are halved, all of a length in turn."""
    place(bodies, at_a, angles, step, 0.0)
    place(bodies, at_b, angles, step, 1.0)
    pair = near_pairs(bodies, at_a, at_b, motion, kept)
    count, arc = pair.size, np.zeros(pair.size, np.int64)
    slack_a, slack_b, middle = np.empty(count), np.empty(count), np.empty(count)
    # The far end first: planners start from an end that is clear.
    if not _write_slack(bodies, at_b, corners, pair, kept, motion, 1.0, slack_b):
        return False
    if not _write_slack(bodies, at_a, corners, pair, kept, motion, 1.0, slack_a):
        return False
    for level in range(depth + 1):
        share = 0.5**level
        count = _keep_open(pair, arc, slack_a, slack_b, count, motion, share)
        if count == 0 or level == depth:
            break
        middle, begin = np.empty(count), 0
        while begin < count:
            end = begin
            while end < count and arc[end] == arc[begin]:
                end += 1
            place(bodies, at_a, angles, step, (arc[begin] + 0.5) * share)
            if not _write_slack(
                bodies, at_a, corners, pair[begin:end], kept, motion, 0.5 * share, middle[begin:end]
            ):
                return False
            begin = end
        pair, arc, slack_a, slack_b = _halves(pair, arc, slack_a, middle, slack_b)
        count *= 2
    return bool(count == 0)


@compiled
def _keep_open(
    pair: NDArray[np.int64],
    arc: NDArray[np.int64],
    slack_a: Array,
    slack_b: Array,
    count: int,
    motion: Array,
    share: float,
) -> int:
    """Move to the front what the slack at both ends of an arc does not prove; return its number."""
    kept = 0
    for i in range(count):
        if not slack_a[i] + slack_b[i] > share * motion[pair[i]]:
            pair[kept], arc[kept] = pair[i], arc[i]
            slack_a[kept], slack_b[kept] = slack_a[i], slack_b[i]
            kept += 1
    return kept


@compiled
def _halves(
    pair: NDArray[np.int64], arc: NDArray[np.int64], slack_a: Array, middle: Array, slack_b: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Return pairs, arcs and slacks of both halves of every arc, in the order of the arcs."""
    count = middle.size
    pairs, arcs = np.empty(2 * count, np.int64), np.empty(2 * count, np.int64)
    first, last = np.empty(2 * count), np.empty(2 * count)
    begin = 0
    while begin < count:
        end = begin
        while end < count and arc[end] == arc[begin]:
            end += 1
        for i in range(begin, end):
            left, right = begin + i, end + i
            pairs[left] = pairs[right] = pair[i]
            arcs[left], arcs[right] = 2 * arc[i], 2 * arc[i] + 1
            first[left], last[left] = slack_a[i], middle[i]
            first[right], last[right] = middle[i], slack_b[i]
        begin = end
    return pairs, arcs, first, last


@compiled
def _write_slack(
    bodies: MovingHulls,
    at: Placements,
    corners: NDArray[np.int64],
    pair: NDArray[np.int64],
    kept: Array,
    motion: Array,
    share: float,
    slack: Array,
) -> bool:
    """Write lower bounds on by how much pairs exceed what is to be kept, while they do [m]."""
    hulls, pairs, rotation, translation = bodies.hulls, bodies.pairs, at.rotation, at.translation
    between, offset = np.empty((3, 3)), np.empty(3)
    for n in range(pair.size):
        k = pair[n]
        i, j = pairs[k, 0], pairs[k, 1]
        write_relative(rotation, translation, i, j, between, offset)
        held = kept[k] + hulls.radius[i] + hulls.radius[j]
        enough = share * motion[k] + held
        slack[n] = separation(hulls, between, offset, enough, corners[k]) - held
        if not slack[n] > 0.0:
            return False
    return True
