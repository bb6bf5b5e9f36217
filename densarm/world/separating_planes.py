"""SeparatingPlanes: a fast proof that straight joint-space segments touch nothing."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.checks import non_negative
from densarm.values.kernels import compiled, compiled_part
from densarm.world.bodies import (
    BALL,
    BOX,
    RADIUS,
    Bodies,
    bodies_of,
    place,
    write_motion_bounds,
)
from densarm.world.cloud_field import Arc, Fields, field_bound, fields_of
from densarm.world.cloud_separation import unproved_halves
from densarm.world.separation import climb, separation, stays_apart
from densarm.world.simplex import Integers
from densarm.world.world import DISTANCE_TOLERANCE, World

_FLOOR = 1e-4  # [rad or m], length of a segment at which one not proved clear counts as not clear
_FIRST = 8  # pairs that were not clear lately, which are looked at before all others
# What is known of a pair on an arc, where it is not which face of a box is between its bodies.
_PROVED, _NOTHING, _PLANE = -3, -2, -1
_OPEN = -3  # less 1, 2 or 3: of a cloud, what is not proved is one half, the other, or both
_BOTH = 3
_SHORTEST = 0.04  # part of an arc that a field is asked for; nearer to a cloud it costs too many


class Tube(NamedTuple):
    """All joint positions within a radius per joint of a segment; a convex set."""

    begin: Array
    """One end of the segment (nv,) [rad or m]."""
    step: Array
    """From there to the other end (nv,) [rad or m]."""
    radius: Array
    """How far each joint may be off the segment (nv,) [rad or m]."""


@compiled
def configuration_tube(points: Array, step: Array) -> Tube:
    """Return a tube along a step (nv,) from the first of some points that holds them all.

    Being convex it holds the segments between the points (N, nv) [rad or m] as well.
    """
    square, nv = 0.0, step.size
    low, high = np.zeros(nv), np.zeros(nv)
    for j in range(nv):
        square += step[j] * step[j]
    for n in range(points.shape[0]):
        along = 0.0
        for j in range(nv):
            along += (points[n, j] - points[0, j]) * step[j]
        share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
        for j in range(nv):
            off = points[n, j] - points[0, j] - share * step[j]
            low[j], high[j] = min(low[j], off), max(high[j], off)
    for j in range(nv):
        low[j], high[j] = points[0, j] + 0.5 * (low[j] + high[j]), 0.5 * (high[j] - low[j])
    return Tube(low, step, high)


class SeparatingPlanes:
    r"""Proves segments as `SweptCheck` does, but by planes between bodies, in compiled code.

    Let a plane that moves with the last joint of both bodies of a pair leave a gap of f_a, f_b
    beyond the margin at both ends of a segment. The points of the bodies leave straight lines with
    accelerations of β at most, hence the gap on the segment, at s in [0, 1], is

    .. math:: f(s) \ge (1 - s) f_a + s f_b - \tfrac{1}{2} \beta s (1 - s) > 0
        \iff \beta < 2 (\sqrt{f_a} + \sqrt{f_b})^2.

    Where neither this nor the distances at both ends prove a pair, the segment is halved.

    Obstacles that are moved afterwards ask for a new object; questions to the old one raise
    `SceneChangedError`.

    Args:
        world: the pairs.
        margin: distance that must be exceeded for a pair to count as apart [m].
        kept: how much more that is for each pair (K,), or for all [m].

    Raises:
        InvalidValueError: a negative margin.
    """

    def __init__(self, world: World, margin: float = 0.0, kept: float | Array = 0.0) -> None:
        self._world = world
        self._version = world.version
        self._bodies, some_corner = bodies_of(world)
        least = non_negative("margin", margin) + DISTANCE_TOLERANCE
        self._least = np.full(world.n_pairs, least) + kept
        corners = np.full((world.n_pairs, 4, 2), -1)
        corners[:, 0] = some_corner
        order = np.flatnonzero(world.changes > 0)
        self._memory = _Memory(corners, order, fields_of(world))
        nothing, rest = np.zeros(0, np.int64), np.zeros((2, world.arm.nv))
        # Kernels are loaded, or compiled, here rather than where a plan's time is taken.
        _polyline_is_clear(self._bodies, self._memory._replace(order=nothing), self._least, rest)

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether every distance at q (nq,) is proved above the margin."""
        return self.segment_is_clear(q, q)

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether every distance is proved above the margin on the whole segment.

        Args:
            q_a: one end (nq,).
            q_b: the other end (nq,), reached the short way round on continuous joints.
        """
        arm = self._world.arm
        return self._is_clear(_ends(arm.angles(q_a), arm.difference(q_a, q_b)), self._least)

    def polyline_is_clear(self, angles: Array) -> bool:
        """Return whether every distance is proved above the margin on a whole polyline.

        Args:
            angles: joint positions that it goes through (N, nv) [rad or m], N >= 2; continuous
                joints count their turns.
        """
        return self._is_clear(np.ascontiguousarray(angles), self._least)

    def tube_is_clear(self, tube: Tube) -> bool:
        """Return whether every distance is proved above the margin in all of a tube."""
        least = self._least + self._world.lipschitz @ tube.radius
        return self._is_clear(_ends(tube.begin, tube.step), least)

    def _is_clear(self, angles: Array, least: Array) -> bool:
        self._world.require_version(self._version)
        return bool(_polyline_is_clear(self._bodies, self._memory, least, angles))


def _ends(begin: Array, step: Array) -> Array:
    return np.array([begin, begin + step])


class _Memory(NamedTuple):
    """What later questions are quicker by; overwritten."""

    corners: Integers
    """Corners of each pair (K, 4, 2) by which a plane was found, see `separation`."""
    order: Integers
    """The pairs in the order in which they are looked at; one that was not clear is put first."""
    fields: Fields
    """How far places are from clouds."""


@compiled
def _polyline_is_clear(  # noqa: C901  # what is called at each level is compiled once more
    bodies: Bodies, memory: _Memory, least: Array, points: Array
) -> bool:
    """Prove all pairs on a polyline, on all of it those first that were not clear lately.

    On each arc of a segment pairs are proved by faces of boxes, which are the cheapest planes,
    then by planes that are looked for; what is left is tried again on both halves of the arc.

    Args:
        bodies: the bodies.
        memory: which pairs to prove, and what helps.
        least: distance that each pair must exceed (K,) [m].
        points: joint positions that it goes through (N, nv) [rad or m].
    """
    n_joints, n_bodies = bodies.parent.size, bodies.joint.size
    pairs, shapes = bodies.pairs, bodies.shapes
    # Of one arc at a time: where all is at its beginning, in its middle and at its end.
    joint_poses, poses = np.empty((3, n_joints, 12)), np.empty((3, n_bodies, 12))
    bounds, is_asked = np.empty((2, n_bodies, n_joints)), np.empty(n_bodies, np.bool_)
    # Of each pair a normal, and the gap that its plane leaves [m].
    planes, work, step = np.empty((least.size, 4)), np.empty((8, 4)), np.empty(points.shape[1])
    n_segments, first = points.shape[0] - 1, memory.order[:_FIRST]
    for part in range(2 * n_segments):
        order = first if part < n_segments else memory.order[_FIRST:]
        angles, longest = points[part % n_segments], 0.0
        for j in range(step.size):
            step[j] = points[part % n_segments + 1, j] - angles[j]
            longest = max(longest, abs(step[j]))
        # Pairs, arcs on which they are not proved, and what is known of them there.
        waiting = np.empty((order.size, 3), np.int64)
        for n in range(order.size):
            waiting[n, 0], waiting[n, 1], waiting[n, 2] = order[n], 0, _NOTHING
        share = 1.0  # of the segment that an arc is
        while waiting.shape[0] > 0:
            halves, written, end = np.empty((2 * waiting.shape[0], 3), np.int64), 0, 0
            while end < waiting.shape[0]:
                begin, arc = end, waiting[end, 1]
                while end < waiting.shape[0] and waiting[end, 1] == arc:
                    end += 1
                rows, joint_pose, pose = waiting[begin:end], joint_poses[1], poses[1]
                _ask_for(pairs, rows, is_asked)
                place(bodies, angles, step, share * (arc + 0.5), is_asked, joint_pose, pose)
                write_motion_bounds(bodies, step, share, is_asked, joint_pose, pose, bounds)
                motion, bend = bounds[0], bounds[1]
                _look_at_faces(bodies, least, pose, motion, rows, planes)
                # Pairs that no face is between first, for one of them may be in contact.
                for faces_are_done in range(2):
                    for n in range(begin, end):
                        if waiting[n, 2] == _NOTHING:
                            k = waiting[n, 0]
                            i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
                            held = least[k] + shapes[i, RADIUS] + shapes[j, RADIUS]
                            half = 0.5 * (motion[i, c] + motion[j, c])
                            if bodies.cloud[j] >= 0:
                                on = Arc(i, j, held, half, bend[i, c] + bend[j, c])
                                start, left = memory.corners[k, 0, 0], _BOTH
                                if faces_are_done:
                                    left = unproved_halves(bodies, poses, on, start)
                                else:
                                    far = field_bound(bodies, memory.fields, pose, on) - held
                                    if far > half:
                                        left = 0
                                    elif far < _SHORTEST * half:
                                        continue
                                if left < 0:
                                    _move_to_front(memory.order, k)
                                    return False
                                waiting[n, 2] = _OPEN - left
                                continue
                            corners, plane, enough = memory.corners[k], planes[k], held + half
                            gap = separation(bodies, pose, i, j, held, enough, corners, work, plane)
                            gap -= held
                            if not gap > 0.0:
                                _move_to_front(memory.order, k)
                                return False
                            plane[3] = gap
                            waiting[n, 2] = _PROVED if gap > half else _PLANE
                    if faces_are_done or not _ask_for(pairs, rows, is_asked):
                        break
                    for side in (0, 2):
                        at = share * (arc + 0.5 * side)
                        place(bodies, angles, step, at, is_asked, joint_poses[side], poses[side])
                    _look_at_ends(bodies, least, poses, bend, rows, planes)
                for side in (0, 2):
                    for n in range(begin, end):
                        if waiting[n, 2] < _OPEN and (_OPEN - waiting[n, 2]) >> (side // 2) & 1:
                            written = _write_half(
                                halves, written, waiting[n, 0], 2 * arc + side // 2
                            )
                        elif waiting[n, 2] == _PLANE:
                            k, normal = waiting[n, 0], work[0]
                            i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
                            _carry(joint_pose, joint_poses[side], c, planes[k], normal)
                            # The corners that it ends at are of no use, and overwritten.
                            start, ends = memory.corners[k, 0], halves[written]
                            gap = climb(bodies, poses[side], i, j, start, normal, ends)
                            gap -= least[k] + shapes[i, RADIUS] + shapes[j, RADIUS]
                            if not stays_apart(planes[k, 3], gap, bend[i, c] + bend[j, c]):
                                written = _write_half(halves, written, k, 2 * arc + side // 2)
            if written > 0 and longest * share <= _FLOOR:
                return False
            waiting = halves[:written]
            share *= 0.5
    return True


@compiled_part
def _write_half(halves: Integers, row: int, pair: int, arc: int) -> int:
    """Write that a pair is not proved on an arc, and return the next row."""
    halves[row, 0], halves[row, 1], halves[row, 2] = pair, arc, _NOTHING
    return row + 1


@compiled_part
def _ask_for(pairs: Integers, rows: Integers, is_asked: NDArray[np.bool_]) -> bool:
    """Write which bodies are of pairs that are not proved; return whether there are any."""
    is_any = False
    for body in range(is_asked.size):
        is_asked[body] = False
    for n in range(rows.shape[0]):
        if rows[n, 2] != _PROVED:
            k = rows[n, 0]
            is_asked[pairs[k, 0]] = is_asked[pairs[k, 1]] = is_any = True
    return is_any


@compiled_part
def _look_at_faces(
    bodies: Bodies, least: Array, pose: Array, motion: Array, rows: Integers, planes: Array
) -> None:
    """Look for faces of boxes that are between pairs, or prove them, in the middle of an arc.

    Before that for balls that are apart, which proves what is far in the fewest operations.
    """
    shapes = bodies.shapes
    for n in range(rows.shape[0]):
        k = rows[n, 0]
        i, j, c = bodies.pairs[k, 0], bodies.pairs[k, 1], bodies.pairs[k, 2]
        needed, square = least[k] + 0.5 * (motion[i, c] + motion[j, c]), 0.0
        needed += shapes[i, BALL] + shapes[j, BALL]
        for axis in range(9, 12):
            square += (pose[i, axis] - pose[j, axis]) ** 2
        if square > needed * needed:
            rows[n, 2] = _PROVED
            continue
        if bodies.joint[j] == c:
            face, gap = 0, -math.inf
            for axis in range(3):
                offset, extent = _across(bodies.shapes, i, j, axis, pose)
                if abs(offset) - extent > gap:
                    face, gap = 2 * axis + (1 if offset < 0.0 else 0), abs(offset) - extent
            gap -= least[k]
            planes[k, 3] = gap
            if gap > 0.0:
                proved = gap > 0.5 * (motion[i, c] + motion[j, c])
                rows[n, 2] = _PROVED if proved else face


@compiled_part
def _look_at_ends(
    bodies: Bodies, least: Array, poses: Array, bend: Array, rows: Integers, planes: Array
) -> None:
    """Find out whether faces between pairs prove them, by the gaps at both ends of an arc."""
    for n in range(rows.shape[0]):
        k, face = rows[n, 0], rows[n, 2]
        if face >= 0:
            rows[n, 2] = _PROVED
            i, j, c = bodies.pairs[k, 0], bodies.pairs[k, 1], bodies.pairs[k, 2]
            for side in (0, 2):
                offset, extent = _across(bodies.shapes, i, j, face >> 1, poses[side])
                beyond = (1.0 - 2.0 * (face & 1)) * offset - extent - least[k]
                if not stays_apart(planes[k, 3], beyond, bend[i, c] + bend[j, c]):
                    rows[n, 2] = _NOTHING


@compiled_part
def _across(shapes: Array, other: int, one: int, axis: int, pose: Array) -> tuple[float, float]:
    """Return how far a box is off another along an axis of the other, and their half widths."""
    offset, extent = 0.0, shapes[one, BOX + axis]
    for k in range(3):
        offset += pose[one, 3 * k + axis] * (pose[other, 9 + k] - pose[one, 9 + k])
        along = 0.0
        for row in range(0, 9, 3):
            along += pose[one, row + axis] * pose[other, row + k]
        extent += abs(along) * shapes[other, BOX + k]
    return offset, extent


@compiled_part
def _carry(middle: Array, end: Array, joint: int, plane: Array, normal: Array) -> None:
    """Write what becomes of a normal that moves with a joint from an arc's middle to one end."""
    normal[0] = normal[1] = normal[2] = 0.0
    for column in range(3):
        along = 0.0
        for row in range(3):
            along += middle[joint, 3 * row + column] * plane[row]
        for row in range(3):
            normal[row] += end[joint, 3 * row + column] * along


@compiled_part
def _move_to_front(order: Integers, pair: int) -> None:
    """Put a pair before all others, which keep their order."""
    before = pair
    for n in range(order.size):
        before, order[n] = order[n], before
        if before == pair:
            break
