"""Planes on the faces of boxes around shapes, the cheapest of planes between bodies."""

import math

from densarm.arrays import Array
from densarm.compiled import compiled


@compiled
def best_face(box: Array, one: int, other: int, pose: Array) -> tuple[int, float]:
    """Return the face of the box around one shape that another is farthest beyond, and how far.

    Args:
        box: half the sides of the boxes (S, 3) [m].
        one: the shape with the faces.
        other: the other shape.
        pose: of the shapes (S, 12).

    Returns:
        Number of the face: 2 k looks up, 2 k + 1 down along axis k; the gap of the boxes there
        [m], negative if they may overlap.
    """
    face, gap = one - one, -math.inf  # a literal 0 would be compiled for
    for axis in range(3):
        offset, extent = _across(box, one, axis, other, pose)
        if abs(offset) - extent > gap:
            face, gap = 2 * axis + (1 if offset < 0.0 else 0), abs(offset) - extent
    return face, gap


@compiled
def face_gap(box: Array, one: int, face: int, other: int, pose: Array) -> float:
    """Return how far the box around another shape is beyond a face of one's box [m].

    Arguments as for `best_face`.
    """
    offset, extent = _across(box, one, face >> 1, other, pose)
    return (1.0 - 2.0 * (face & 1)) * offset - extent


@compiled
def _across(box: Array, one: int, axis: int, other: int, pose: Array) -> tuple[float, float]:
    """Return how far apart the middles of two boxes are along an axis of one, and the extents."""
    x, y, z = pose[one, axis], pose[one, 3 + axis], pose[one, 6 + axis]
    offset = x * (pose[other, 9] - pose[one, 9]) + y * (pose[other, 10] - pose[one, 10])
    offset += z * (pose[other, 11] - pose[one, 11])
    extent = box[one, axis]
    for k in range(3):
        along = x * pose[other, k] + y * pose[other, 3 + k] + z * pose[other, 6 + k]
        extent += abs(along) * box[other, k]
    return offset, extent


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
