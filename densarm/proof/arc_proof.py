"""What distances and planes prove of the pairs on one arc of a joint-space segment."""

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.proof.box_faces import best_face, face_gap, stays_apart
from densarm.proof.separation import plane_gap, separation

NOTHING, PLANE = -2, -1
"""What is between two bodies, other than a face: nothing that is known of, or a plane."""


@compiled
def keep_unproved_by_faces(
    joint: NDArray[np.int64],
    box: Array,
    pairs: NDArray[np.int64],
    kept: Array,
    pose: Array,
    motion: Array,
    waiting: NDArray[np.int64],
    begin: int,
    end: int,
    planes: Array,
) -> int:
    """Move to the front the pairs of an arc that faces of boxes in its middle do not prove.

    Args:
        joint: that moves each shape (S,).
        box: around each shape, see `MovingHulls`.
        pairs: shapes of each pair, and the last joint that moves both.
        kept: distance that each pair must keep (K,) [m].
        pose: of the shapes in the middle of the arc (S, 12).
        motion: bounds on the motion along the arc (S, njoints) [m].
        waiting: pairs, arcs on which they are not proved, and what is between their bodies in the
            middle of it, written: a face's number or `NOTHING` (N, 3).
        begin: index of the first pair on this arc.
        end: index after the last.
        planes: the gaps beyond faces are written as the last entries (N, 4) [m].

    Returns:
        The index after the last pair that is kept.
    """
    unproved = begin
    for n in range(begin, end):
        k, between, gap = waiting[n, 0], NOTHING, 0.0
        i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
        if joint[j] == c:
            face, gap = best_face(box, j, i, pose)
            gap -= kept[k]
            if gap > 0.5 * (motion[i, c] + motion[j, c]):
                continue
            between = face if gap > 0.0 else NOTHING
        waiting[unproved, 0], waiting[unproved, 2], planes[unproved, 3] = k, between, gap
        unproved += 1
    return unproved


@compiled
def keep_unproved_at_ends(
    box: Array,
    pairs: NDArray[np.int64],
    kept: Array,
    pose_a: Array,
    pose_b: Array,
    bend: Array,
    waiting: NDArray[np.int64],
    begin: int,
    end: int,
    planes: Array,
) -> int:
    """Move to the front the pairs of an arc that faces do not prove at its ends either.

    Args:
        box: around each shape, see `MovingHulls`.
        pairs: shapes of each pair, and the last joint that moves both.
        kept: distance that each pair must keep (K,) [m].
        pose_a: of the shapes at one end of the arc (S, 12).
        pose_b: at the other end (S, 12).
        bend: bounds on the acceleration along the arc (S, njoints) [m].
        waiting: see `keep_unproved_by_faces`; a face that does not prove its pair is forgotten.
        begin: index of the first pair on this arc.
        end: index after the last.
        planes: see `keep_unproved_by_faces`.

    Returns:
        The index after the last pair that is kept.
    """
    unproved = begin
    for n in range(begin, end):
        k, between, gap = waiting[n, 0], waiting[n, 2], planes[n, 3]
        if between >= 0:
            i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
            bent = 0.25 * (bend[i, c] + bend[j, c])  # half the time, a quarter of the way
            gap_a = face_gap(box, j, between, i, pose_a) - kept[k]
            gap_b = face_gap(box, j, between, i, pose_b) - kept[k]
            if stays_apart(gap, gap_a, bent) and stays_apart(gap, gap_b, bent):
                continue
            between = NOTHING
        waiting[unproved, 0], waiting[unproved, 2] = k, between
        _copy_row(planes, n, unproved)
        unproved += 1
    return unproved


@compiled
def keep_unproved_by_planes(
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    radius: Array,
    pairs: NDArray[np.int64],
    kept: Array,
    corners: NDArray[np.int64],
    order: NDArray[np.int64],
    pose: Array,
    motion: Array,
    waiting: NDArray[np.int64],
    begin: int,
    end: int,
    planes: Array,
) -> int:
    """Look for planes where nothing is between bodies, and move to the front what is not proved.

    Args:
        points: corners of the hulls, see `MovingHulls`, as the next four.
        neighbours: of the corners.
        first_neighbour: of each corner.
        radius: of each hull.
        pairs: shapes of each pair, and the last joint that moves both.
        kept: distance that each pair must keep (K,) [m].
        corners: of each pair, see `separation`.
        order: in which pairs are looked at (K,); one that is not clear is put first.
        pose: of the shapes in the middle of the arc (S, 12).
        motion: bounds on the motion along the arc (S, njoints) [m].
        waiting: see `keep_unproved_by_faces`; `PLANE` is written where one is found.
        begin: index of the first pair on this arc.
        end: index after the last.
        planes: normals and gaps [m] of the planes (N, 4).

    Returns:
        The index after the last pair that is kept; -1 if a pair is not clear.
    """
    simplex, system = np.empty((4, 4)), np.empty((4, 4))
    unproved = begin
    for n in range(begin, end):
        k, between = waiting[n, 0], waiting[n, 2]
        if between == NOTHING:
            i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
            half = 0.5 * (motion[i, c] + motion[j, c])
            held = kept[k] + radius[i] + radius[j]
            gap = (
                separation(
                    points,
                    neighbours,
                    first_neighbour,
                    pose,
                    i,
                    j,
                    held,
                    held + half,
                    corners,
                    k,
                    simplex,
                    system,
                    planes,
                    n,
                )
                - held
            )
            if not gap > 0.0:
                _move_to_front(order, k)
                return -1
            if gap > half:
                continue
            between, planes[n, 3] = PLANE, gap
        waiting[unproved, 0], waiting[unproved, 2] = k, between
        _copy_row(planes, n, unproved)
        unproved += 1
    return unproved


@compiled
def append_unproved(
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    radius: Array,
    pairs: NDArray[np.int64],
    kept: Array,
    corners: NDArray[np.int64],
    joint_pose: Array,
    joint_end: Array,
    shape_end: Array,
    bend: Array,
    waiting: NDArray[np.int64],
    begin: int,
    end: int,
    planes: Array,
    half: int,
    halves: NDArray[np.int64],
    written: int,
) -> int:
    """Append the pairs that planes do not prove on one half of an arc.

    Args:
        points: corners of the hulls, see `MovingHulls`, as the next four.
        neighbours: of the corners.
        first_neighbour: of each corner.
        radius: of each hull.
        pairs: shapes of each pair, and the last joint that moves both.
        kept: distance that each pair must keep (K,) [m].
        corners: of each pair, see `separation`.
        joint_pose: of the joints in the middle of the arc (njoints, 12).
        joint_end: of the joints at the end of the half (njoints, 12).
        shape_end: of the shapes there (S, 12).
        bend: bounds on accelerations along the arc (S, njoints) [m].
        waiting: pairs that are to be proved (N, 3).
        begin: index of the first of them.
        end: index after the last.
        planes: their planes in the middle of the arc (N, 4).
        half: number of the half.
        halves: pairs, and halves on which they are not proved (2 N, 3).
        written: number of those that are.

    Returns:
        Their number.
    """
    for n in range(begin, end):
        k = waiting[n, 0]
        i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
        x, y, z = _carried(joint_pose, joint_end, c, planes, n)
        gap = plane_gap(
            points,
            neighbours,
            first_neighbour,
            shape_end,
            i,
            j,
            corners[k, 0, 0],
            corners[k, 0, 1],
            x,
            y,
            z,
        ) - (kept[k] + radius[i] + radius[j])
        if not stays_apart(planes[n, 3], gap, 0.25 * (bend[i, c] + bend[j, c])):
            halves[written, 0], halves[written, 1] = k, half
            written += 1
    return written


@compiled
def _copy_row(table: Array, row: int, to: int) -> None:
    for k in range(table.shape[1]):
        table[to, k] = table[row, k]


@compiled
def _move_to_front(order: NDArray[np.int64], pair: int) -> None:
    """Put a pair before all others, which keep their order."""
    before = pair
    for n in range(order.size):
        before, order[n] = order[n], before
        if before == pair:
            break


@compiled
def _carried(
    pose_from: Array, pose_to: Array, joint: int, vectors: Array, n: int
) -> tuple[float, float, float]:
    """Return what becomes of the n-th vector when it moves with a joint from pose to pose."""
    x = y = z = 0.0
    for k in range(3):
        along = vectors[n, k]
        x += pose_from[joint, 3 * k] * along
        y += pose_from[joint, 3 * k + 1] * along
        z += pose_from[joint, 3 * k + 2] * along
    return (
        pose_to[joint, 0] * x + pose_to[joint, 1] * y + pose_to[joint, 2] * z,
        pose_to[joint, 3] * x + pose_to[joint, 4] * y + pose_to[joint, 5] * z,
        pose_to[joint, 6] * x + pose_to[joint, 7] * y + pose_to[joint, 8] * z,
    )
