"""What distances and planes prove of the pairs on one arc of a joint-space segment."""

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.proof.box_faces import faces_prove, stays_apart
from densarm.proof.separation import plane_gap, separation


@compiled
def keep_unproved(
    joint: NDArray[np.int64],
    box: Array,
    points: Array,
    neighbours: NDArray[np.int64],
    first_neighbour: NDArray[np.int64],
    radius: Array,
    pairs: NDArray[np.int64],
    kept: Array,
    corners: NDArray[np.int64],
    order: NDArray[np.int64],
    pose: Array,
    pose_a: Array,
    pose_b: Array,
    motion: Array,
    bend: Array,
    pairs_on_arcs: NDArray[np.int64],
    begin: int,
    end: int,
    planes: Array,
) -> int:
    """Move to the front the pairs of an arc that neither boxes nor distances in its middle prove.

    Args:
        joint: see `MovingHulls`, as the next six.
        box: around each shape.
        points: corners of the hulls.
        neighbours: of the corners.
        first_neighbour: of each corner.
        radius: of each hull.
        pairs: shapes of each pair, and the last joint that moves both.
        kept: distance that each pair must keep (K,) [m].
        corners: of each pair, see `separation`.
        order: in which pairs are looked at (K,); one that is not clear is put first.
        pose: of the shapes in the middle of the arc (S, 12).
        pose_a: at one end of it (S, 12).
        pose_b: at the other end (S, 12).
        motion: bounds on the motion along the arc (S, njoints) [m].
        bend: bounds on the acceleration along the arc (S, njoints) [m].
        pairs_on_arcs: pairs, and arcs on which they are not proved (N, 2).
        begin: index of the first pair on this arc.
        end: index after the last.
        planes: written for the pairs that are kept: normal, and gap [m] (N, 4).

    Returns:
        The index after the last of them; -1 if a pair is not clear there.
    """
    simplex, system = np.empty((4, 4)), np.empty((4, 4))
    unproved = begin
    for n in range(begin, end):
        k = pairs_on_arcs[n, 0]
        i, j, c = pairs[k, 0], pairs[k, 1], pairs[k, 2]
        half = 0.5 * (motion[i, c] + motion[j, c])
        bent = 0.25 * (bend[i, c] + bend[j, c])  # half the time, a quarter of the way
        if joint[j] == c and faces_prove(box, j, i, pose, pose_a, pose_b, kept[k], half, bent):
            continue
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
                unproved,
            )
            - held
        )
        if not gap > 0.0:
            _move_to_front(order, k)
            return -1
        if not gap > half:
            pairs_on_arcs[unproved, 0], planes[unproved, 3] = k, gap
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
    pairs_on_arcs: NDArray[np.int64],
    begin: int,
    end: int,
    planes: Array,
    half: int,
    halves: NDArray[np.int64],
    waiting: int,
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
        pairs_on_arcs: pairs that are to be proved (N, 2).
        begin: index of the first of them.
        end: index after the last.
        planes: their planes in the middle of the arc (N, 4).
        half: number of the half.
        halves: pairs, and halves on which they are not proved (2 N, 2).
        waiting: number of those that are written.

    Returns:
        Their number.
    """
    for n in range(begin, end):
        k = pairs_on_arcs[n, 0]
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
            halves[waiting, 0], halves[waiting, 1] = k, half
            waiting += 1
    return waiting


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
