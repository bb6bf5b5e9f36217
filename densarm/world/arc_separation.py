"""Arc separation: proofs that pairs of bodies stay apart on parts of a segment, by planes."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part, compiled_part
from densarm.world.bodies import BALL, BOX, RADIUS, Bodies, place, write_motion_bounds
from densarm.world.cloud_field import Arc, CloudSpace, Fields, field_bound, new_cloud_space
from densarm.world.cloud_separation import meets_again, unproved_halves
from densarm.world.obstacle_tree import ObstacleTree
from densarm.world.separation import climb, separation, stays_apart
from densarm.world.simplex import Integers

NOTHING = -2
"""That nothing is known of a pair on an arc."""

# What is known of a pair on an arc, where it is not which face of a box is between its bodies.
_PROVED, _PLANE = -3, -1
_OPEN = -3  # less 1, 2 or 3: of a cloud, what is not proved is one half, the other, or both
_BOTH = 3
_SHORTEST = 0.2  # part of an arc that a field is asked for; nearer to a cloud it costs too many


class Memory(NamedTuple):
    """What later questions are quicker by; overwritten."""

    corners: Integers
    """Corners of each pair (K, 4, 2) by which a plane was found, see `separation`; of a link and a
    cloud see `unproved_halves`."""
    order: Integers
    """The pairs in the order in which they are looked at; one that was not clear is put first. Of
    very many pairs some that were not clear lately."""
    planes: Array
    """Planes between each link and cloud (K, 6, 10), see `PLANES`."""
    gaps: Array
    """Of each pair a normal, and the gap that its plane leaves (K, 4) [m]."""
    fields: Fields
    """How far places are from clouds."""
    tree: ObstacleTree
    """What finds the others of very many pairs."""


class ArcSpace(NamedTuple):
    """Space to work in on one arc at a time."""

    step: Array
    """Motion of the joints on the segment (nv,) [rad or m]."""
    joint_poses: Array
    """Of joints at its beginning, in its middle and at its end (3, njoints, 12)."""
    poses: Array
    """Of bodies there (3, S, 12)."""
    bounds: Array
    """As `write_motion_bounds` has them (2, S, njoints) [m]."""
    is_asked: NDArray[np.bool_]
    """Which bodies are of pairs that are not proved (S,)."""
    planes: Array
    """As `Memory.gaps`."""
    work: Array
    """See `separation` (8, 4)."""
    cloud: CloudSpace
    """For clouds."""


@compiled_part
def new_arc_space(n_joints: int, n_bodies: int, gaps: Array) -> ArcSpace:
    """Return space for so many joints, of which the first is the world, and bodies."""
    return ArcSpace(
        np.empty(n_joints - 1),
        np.empty((3, n_joints, 12)),
        np.empty((3, n_bodies, 12)),
        np.empty((2, n_bodies, n_joints)),
        np.empty(n_bodies, np.bool_),
        gaps,
        np.empty((8, 4)),
        new_cloud_space(),
    )


@compiled_lean_part
def write_unproved(  # noqa: C901  # what is called at each level is compiled once more
    bodies: Bodies,
    memory: Memory,
    least: Array,
    angles: Array,
    share: float,
    waiting: Integers,
    halves: Integers,
    space: ArcSpace,
) -> int:
    """Prove pairs on arcs, and write what is left for both halves of each; return how many rows.

    They are proved by faces of boxes, which are the cheapest planes, then by planes that are looked
    for. Where a pair is not apart in the middle of an arc nothing is left to prove: -1.
    """
    step, joint_poses, poses, bounds, is_asked, planes, work, cloud = space
    pairs, shapes, motion, bend = bodies.pairs, bodies.shapes, bounds[0], bounds[1]
    written, end = 0, 0
    while end < waiting.shape[0]:
        begin, arc = end, waiting[end, 1]
        while end < waiting.shape[0] and waiting[end, 1] == arc:
            end += 1
        rows, joint_pose, pose = waiting[begin:end], joint_poses[1], poses[1]
        _ask_for(pairs, rows, is_asked)
        place(bodies, angles, step, share * (arc + 0.5), is_asked, joint_pose, pose)
        write_motion_bounds(bodies, step, share, is_asked, joint_pose, pose, bounds)
        _look_at_faces(bodies, least, pose, motion, rows, planes)
        # Pairs that no face is between first, for one of them may be in contact.
        for faces_are_done in range(2):
            for n in range(begin, end):
                if waiting[n, 2] == NOTHING:
                    k = waiting[n, 0]
                    i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
                    held = least[k] + shapes[i, RADIUS] + shapes[j, RADIUS]
                    half = 0.5 * (motion[i, c] + motion[j, c])
                    if bodies.cloud[j] >= 0:
                        on = Arc(i, j, held, half, bend[i, c] + bend[j, c])
                        left = _BOTH
                        if faces_are_done:
                            known = memory.corners[k], memory.planes[k]
                            left = unproved_halves(bodies, poses, on, *known, cloud)
                        else:
                            far = field_bound(bodies, memory.fields, pose, on, cloud)
                            far -= held
                            if far > half:
                                left = 0
                            elif far < _SHORTEST * half:
                                continue
                        if left < 0:
                            _move_to_front(memory.order, k)
                            return -1
                        waiting[n, 2] = _OPEN - left
                        continue
                    corners, plane, enough = memory.corners[k], planes[k], held + half
                    gap = separation(bodies, pose, i, j, held, enough, corners, work, plane)
                    gap -= held
                    if not gap > 0.0:
                        _move_to_front(memory.order, k)
                        return -1
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
                    written = _write_half(halves, written, waiting[n, 0], 2 * arc + side // 2)
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
    return written


@compiled_lean_part
def is_met_again(
    bodies: Bodies, memory: Memory, least: Array, angles: Array, pairs: Integers, space: ArcSpace
) -> bool:
    """Return whether a link meets, in the middle of a segment, the point of a cloud it met last.

    Ways that are tried fail by the same points again and again. Arguments as for `write_unproved`,
    with the pairs (P,) that are looked at.
    """
    pose, is_placed = space.poses[1], False
    for k in pairs:
        i, j = bodies.pairs[k, 0], bodies.pairs[k, 1]
        if bodies.cloud[j] < 0 or memory.corners[k, 1, 0] < 0:
            continue
        if not is_placed:
            for body in range(space.is_asked.size):
                space.is_asked[body] = True
            place(bodies, angles, space.step, 0.5, space.is_asked, space.joint_poses[1], pose)
            is_placed = True
        held = least[k] + bodies.shapes[i, RADIUS] + bodies.shapes[j, RADIUS]
        on = Arc(i, j, held, 0.0, 0.0)
        if meets_again(bodies, pose, on, memory.corners[k], space.cloud):
            return True
    return False


@compiled_lean_part
def _write_half(halves: Integers, row: int, pair: int, arc: int) -> int:
    """Write that a pair is not proved on an arc, and return the next row."""
    halves[row, 0], halves[row, 1], halves[row, 2] = pair, arc, NOTHING
    return row + 1


@compiled_lean_part
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


@compiled_lean_part
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


@compiled_lean_part
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
                    rows[n, 2] = NOTHING


@compiled_lean_part
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


@compiled_lean_part
def _carry(middle: Array, end: Array, joint: int, plane: Array, normal: Array) -> None:
    """Write what becomes of a normal that moves with a joint from an arc's middle to one end."""
    normal[0] = normal[1] = normal[2] = 0.0
    for column in range(3):
        along = 0.0
        for row in range(3):
            along += middle[joint, 3 * row + column] * plane[row]
        for row in range(3):
            normal[row] += end[joint, 3 * row + column] * along


@compiled_lean_part
def _move_to_front(order: Integers, pair: int) -> None:
    """Put a pair before all others, which keep their order."""
    before = pair
    for n in range(order.size):
        before, order[n] = order[n], before
        if before == pair:
            break
