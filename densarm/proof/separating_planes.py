"""SeparatingPlanes: a fast proof that a straight joint-space segment touches nothing."""

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import DISTANCE_TOLERANCE
from densarm.compiled import compiled
from densarm.proof.arc_proof import append_unproved, keep_unproved
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
        motion = kept, angles, step
        return bool(
            _segment_is_clear(*self._bodies, *state, 0, _FIRST, *motion)
            and _segment_is_clear(*self._bodies, *state, _FIRST, len(self._order), *motion)
        )


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
    first: int,
    last: int,
    kept: Array,
    angles: Array,
    step: Array,
) -> bool:
    """Prove some pairs; arcs on which one is not proved are halved, all of a length in turn."""
    joint_pose, joint_a = np.empty((parent.size, 12)), np.empty((parent.size, 12))
    joint_b, pose, pose_a, pose_b = joint_a.copy(), frame.copy(), frame.copy(), frame.copy()
    motion, bend = np.empty((joint.size, parent.size)), np.empty((joint.size, parent.size))
    count, share, longest = max(0, min(last, order.size) - first), 1.0, 0.0
    none = count - count  # functions that take a literal 0 are compiled for it, and again
    pairs_on_arcs = np.empty((count, 2), np.int64)
    for n in range(count):
        pairs_on_arcs[n, 0], pairs_on_arcs[n, 1] = order[first + n], 0
    for rate in step:
        longest = max(longest, abs(rate))
    while True:
        planes, halves = np.empty((count, 4)), np.empty((2 * count, 2), np.int64)
        begin = waiting = none
        while begin < count:
            arc, end = pairs_on_arcs[begin, 1], begin + 1
            while end < count and pairs_on_arcs[end, 1] == arc:
                end += 1
            at = arc * share
            place(parent, joints, joint, frame, angles, step, at, joint_a, pose_a)
            place(parent, joints, joint, frame, angles, step, at + 0.5 * share, joint_pose, pose)
            place(parent, joints, joint, frame, angles, step, at + share, joint_b, pose_b)
            write_motion_bounds(
                parent, joints, joint, ball, lever, step, share, joint_pose, pose, motion, bend
            )
            unproved = keep_unproved(
                joint,
                box,
                points,
                neighbours,
                first_neighbour,
                radius,
                pairs,
                kept,
                corners,
                order,
                pose,
                pose_a,
                pose_b,
                motion,
                bend,
                pairs_on_arcs,
                begin,
                end,
                planes,
            )
            if unproved < 0:
                return False
            for side in range(2):
                joint_end, pose_end = (joint_a, pose_a) if side == 0 else (joint_b, pose_b)
                waiting = append_unproved(
                    points,
                    neighbours,
                    first_neighbour,
                    radius,
                    pairs,
                    kept,
                    corners,
                    joint_pose,
                    joint_end,
                    pose_end,
                    bend,
                    pairs_on_arcs,
                    begin,
                    unproved,
                    planes,
                    2 * arc + side,
                    halves,
                    waiting,
                )
            begin = end
        if waiting == 0:
            return True
        if longest * share <= _FLOOR:
            return False
        pairs_on_arcs, count, share = halves, waiting, 0.5 * share
