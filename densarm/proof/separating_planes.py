"""SeparatingPlanes: a fast proof that a straight joint-space segment touches nothing."""

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import DISTANCE_TOLERANCE
from densarm.compiled import compiled
from densarm.proof.arc_proof import (
    append_unproved,
    keep_unproved_at_ends,
    keep_unproved_by_faces,
    keep_unproved_by_planes,
)
from densarm.proof.motion_bounds import write_motion_bounds
from densarm.proof.moving_hulls import moving_hulls, place
from densarm.proof.swept_bound import SweptBound

_FLOOR = 1e-4  # [rad or m], length of a segment at which one not proved clear counts as not clear
_FIRST = 8  # pairs that were not clear lately, which are looked at before all others


class SeparatingPlanes:
    r"""Proves segments as `SweptBound` does, but by planes between bodies, in compiled code.

    Let a plane that moves with the last joint of both bodies of a pair leave a gap of f_a, f_b
    beyond the margin at both ends of a segment. The points of the bodies leave straight lines with
    accelerations of β at most, hence the gap on the segment, at s in [0, 1], is

    .. math:: f(s) \ge (1 - s) f_a + s f_b - \tfrac{1}{2} \beta s (1 - s) > 0
        \iff \beta < 2 (\sqrt{f_a} + \sqrt{f_b})^2.

    Where neither this nor the distances at both ends prove a pair, the segment is halved.

    Obstacles that are moved afterwards ask for a new object; questions to the old one raise
    `SceneChangedError`.

    Args:
        bound: the pairs, the bound on their motion, and the margin to be kept.
    """

    def __init__(self, bound: SweptBound) -> None:
        self._arm = bound.arm
        self._clearance = bound.clearance
        self._version = bound.clearance.version
        self._lever = bound.lever
        self._kept = np.full(len(bound.lever), bound.margin + DISTANCE_TOLERANCE)
        bodies, some_corner = moving_hulls(bound.clearance)
        self._bodies = (*bodies, bound.shape_lever)
        self._corners = np.full((len(some_corner), 4, 2), -1)
        self._corners[:, 0] = some_corner
        self._order = np.flatnonzero(self._clearance.changes > 0)

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
        return self._is_clear(self._arm.angles(q_a), step, self._kept)

    def tube_is_clear(self, angles: Array, step: Array, radius: Array) -> bool:
        """Return whether every distance is proved above the margin on and around a segment.

        Args:
            angles: joint positions at one end (nv,) [rad or m].
            step: from there to the other end (nv,) [rad or m].
            radius: how far each joint may be off the segment (nv,) [rad or m].
        """
        return self._is_clear(angles, step, self._kept + self._lever @ radius)

    def _is_clear(self, angles: Array, step: Array, kept: Array) -> bool:
        self._clearance.require_version(self._version)
        state = self._corners, self._order
        return bool(_segment_is_clear(*self._bodies, *state, kept, angles, step))


@compiled
def _segment_is_clear(
    parent: NDArray[np.int64],
    joints: Array,
    joint: NDArray[np.int64],
    frame: Array,
    box: Array,
    ball: Array,
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    radius: Array,
    pairs: NDArray[np.int64],
    lever: Array,
    corners: NDArray[np.int64],
    order: NDArray[np.int64],
    kept: Array,
    angles: Array,
    step: Array,
) -> bool:
    """Prove all pairs, those first that were not clear lately."""
    joint_poses, poses = np.empty((3, parent.size, 12)), np.empty((3, joint.size, 12))
    for shape in range(joint.size):
        if joint[shape] == 0:  # `place` leaves what no joint moves as it is
            for side in range(3):
                for k in range(12):  # entry by entry: a slice compiles for seconds
                    poses[side, shape, k] = frame[shape, k]
    bounds, is_asked = np.empty((2, joint.size, parent.size)), np.empty(joint.size, np.bool_)
    longest = 0.0
    for rate in step:
        longest = max(longest, abs(rate))
    first = min(_FIRST, order.size)
    for begin, end in ((0, first), (first, order.size)):
        waiting = _unproved(order, begin, end)
        share = 1.0
        while waiting.shape[0] > 0:
            waiting, is_clear = _halves(
                parent,
                joints,
                joint,
                frame,
                box,
                ball,
                points,
                neighbours,
                first_neighbour,
                radius,
                pairs,
                lever,
                corners,
                order,
                kept,
                angles,
                step,
                waiting,
                share,
                joint_poses,
                poses,
                bounds,
                is_asked,
            )
            if not is_clear or (waiting.shape[0] > 0 and longest * share <= _FLOOR):
                return False
            share *= 0.5
    return True


@compiled
def _unproved(order: NDArray[np.int64], begin: int, end: int) -> NDArray[np.int64]:
    """Return a table of pairs that are not proved on the whole segment."""
    waiting = np.empty((end - begin, 3), np.int64)
    for n in range(begin, end):
        waiting[n - begin, 0], waiting[n - begin, 1] = order[n], 0
    return waiting


@compiled
def _halves(
    parent: NDArray[np.int64],
    joints: Array,
    joint: NDArray[np.int64],
    frame: Array,
    box: Array,
    ball: Array,
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    radius: Array,
    pairs: NDArray[np.int64],
    lever: Array,
    corners: NDArray[np.int64],
    order: NDArray[np.int64],
    kept: Array,
    angles: Array,
    step: Array,
    waiting: NDArray[np.int64],
    share: float,
    joint_poses: Array,
    poses: Array,
    bounds: Array,
    is_asked: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], bool]:
    """Return pairs and halves of arcs that are left to prove, and False if a pair is not clear.

    The joints' and shapes' poses and their bounds, written here, are of one arc at a time: at its
    beginning, in its middle, and at its end.
    """
    count = waiting.shape[0]
    planes, halves = np.empty((count, 4)), np.empty((2 * count, 3), np.int64)
    motion, bend = bounds[0], bounds[1]
    begin = written = count - count  # functions that take a literal 0 are compiled for it too
    while begin < count:
        arc, end = waiting[begin, 1], begin + 1
        while end < count and waiting[end, 1] == arc:
            end += 1
        _ask_for(pairs, waiting, begin, end, is_asked)
        at = share * (arc + 0.5)
        place(parent, joints, joint, frame, is_asked, angles, step, at, joint_poses[1], poses[1])
        write_motion_bounds(
            parent,
            joints,
            joint,
            ball,
            lever,
            is_asked,
            step,
            share,
            joint_poses[1],
            poses[1],
            motion,
            bend,
        )
        left = keep_unproved_by_faces(
            joint, box, pairs, kept, poses[1], motion, waiting, begin, end, planes
        )
        # Pairs that no face is between first, for one of them may be in contact.
        for faces_are_done in range(2):
            left = keep_unproved_by_planes(
                points,
                neighbours,
                first_neighbour,
                radius,
                pairs,
                kept,
                corners,
                order,
                poses[1],
                motion,
                waiting,
                begin,
                left,
                planes,
            )
            if left < 0:
                return halves, False
            if faces_are_done or left == begin:
                break
            _ask_for(pairs, waiting, begin, left, is_asked)
            for side in (0, 2):
                at = share * (arc + 0.5 * side)
                place(
                    parent,
                    joints,
                    joint,
                    frame,
                    is_asked,
                    angles,
                    step,
                    at,
                    joint_poses[side],
                    poses[side],
                )
            left = keep_unproved_at_ends(
                box, pairs, kept, poses[0], poses[2], bend, waiting, begin, left, planes
            )
        for side in (0, 2):
            written = append_unproved(
                points,
                neighbours,
                first_neighbour,
                radius,
                pairs,
                kept,
                corners,
                joint_poses[1],
                joint_poses[side],
                poses[side],
                bend,
                waiting,
                begin,
                left,
                planes,
                2 * arc + side // 2,
                halves,
                written,
            )
        begin = end
    return halves[:written], True


@compiled
def _ask_for(
    pairs: NDArray[np.int64],
    waiting: NDArray[np.int64],
    begin: int,
    end: int,
    is_asked: NDArray[np.bool_],
) -> None:
    """Write which shapes are of the pairs in some rows of a table."""
    for shape in range(is_asked.size):
        is_asked[shape] = False
    for n in range(begin, end):
        is_asked[pairs[waiting[n, 0], 0]] = is_asked[pairs[waiting[n, 0], 1]] = True
