"""What the faces of boxes around shapes prove of a pair, the cheapest of planes between bodies."""

import math

from densarm.arrays import Array
from densarm.compiled import compiled


@compiled
def faces_prove(
    box: Array,
    one: int,
    other: int,
    pose: Array,
    pose_a: Array,
    pose_b: Array,
    kept: float,
    half: float,
    bend: float,
) -> bool:
    """Return whether a face of the box around one shape proves the other apart along an arc.

    Args:
        box: half the sides of the boxes (S, 3) [m].
        one: the shape with the face; it moves with the last joint that moves both.
        other: the other shape.
        pose: of the shapes in the middle of the arc (S, 12).
        pose_a: of the shapes at one end (S, 12).
        pose_b: of the shapes at the other end (S, 12).
        kept: distance to be kept [m].
        half: bound on how far they move against each other along half the arc [m].
        bend: bound on their acceleration against each other along half the arc [m].
    """
    axis, side, gap = one - one, 1.0, -1.0  # a literal 0 would be compiled for
    for k in range(3):
        above = face_gap(box, one, k, 1.0, other, pose)
        below = face_gap(box, one, k, -1.0, other, pose)
        if max(above, below) > gap:
            axis, side, gap = k, 1.0 if above > below else -1.0, max(above, below)
    gap -= kept
    if gap > half or not gap > 0.0:
        return gap > 0.0
    gap_a = face_gap(box, one, axis, side, other, pose_a) - kept
    gap_b = face_gap(box, one, axis, side, other, pose_b) - kept
    return stays_apart(gap, gap_a, bend) and stays_apart(gap, gap_b, bend)


@compiled
def face_gap(box: Array, one: int, axis: int, side: float, other: int, pose: Array) -> float:
    """Return how far the box around another shape is beyond a face of one's box [m]."""
    x, y, z = pose[one, axis], pose[one, 3 + axis], pose[one, 6 + axis]
    gap: float = x * (pose[other, 9] - pose[one, 9]) + y * (pose[other, 10] - pose[one, 10])
    gap = side * (gap + z * (pose[other, 11] - pose[one, 11])) - box[one, axis]
    for k in range(3):
        along = x * pose[other, k] + y * pose[other, 3 + k] + z * pose[other, 6 + k]
        gap -= abs(along) * box[other, k]
    return gap


@compiled
def stays_apart(gap_a: float, gap_b: float, bend: float) -> bool:
    """Return whether a plane's gaps at both ends of a motion prove that there is one between.

    See `SeparatingPlanes`.

    Args:
        gap_a: at one end [m].
        gap_b: at the other [m].
        bend: bound on the acceleration of points, over a unit of time [m].
    """
    if not (gap_a > 0.0 and gap_b > 0.0):
        return False
    return bend < 2.0 * (math.sqrt(gap_a) + math.sqrt(gap_b)) ** 2
