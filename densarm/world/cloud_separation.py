"""Cloud separation: proofs that a link stays apart from all points of a cloud on an arc."""

import math

import numpy as np

from densarm.scene.point_tree import DEEPEST, leaf_points, put_nearer_last
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_part
from densarm.world.bodies import BOX, RADIUS, Bodies, tree_of
from densarm.world.cloud_field import Arc
from densarm.world.cloud_search import (
    SHARE,
    box_bound,
    plane_bound,
    see,
    write_middle,
)
from densarm.world.hulls import farthest_corner, new_search, point_gap

_ACCURACY = 1e-5  # [m], by which the bound on a distance may fall short of it
_GAPS = 4  # first column of the gaps that suffice
_PLANES = 6  # that are kept, those that prove most before the others


@compiled_part
def unproved_halves(  # noqa: C901  # what is called at each level is compiled once more
    bodies: Bodies, poses: Array, arc: Arc, start: int
) -> int:
    """Return which halves of an arc a link is not proved apart from a cloud on, as bits 1 and 2.

    A node of the cloud's tree is proved by a plane before its box in the middle of the arc: by its
    gap there alone, or by those at both ends too. Planes that have proved others are tried first.
    What is not proved is looked into, down to each point.

    Args:
        bodies: the bodies.
        poses: of all bodies at the arc's beginning, in its middle and at its end (3, S, 12).
        arc: what is to be proved.
        start: a corner of the link.

    Returns:
        -1 where a point is not apart in the middle.
    """
    tree = tree_of(bodies.clouds, bodies.cloud[arc.cloud])
    held, corner, unproved = arc.held, start, 0
    points, boxes = tree
    search, seen, box = new_search(), np.empty(12), np.empty(6)
    planes, x, middle = np.zeros((_PLANES, 6)), np.empty(3), np.empty(3)
    planes[:, 3] = math.inf  # which prove nothing
    _write_seen(poses[1, arc.link], poses[1, arc.cloud], seen)
    for axis in range(3):
        box[3 + axis] = bodies.shapes[arc.link, BOX + axis] - bodies.shapes[arc.link, RADIUS]
        box[axis] = -box[3 + axis]
    waiting, bounds, count = np.zeros(DEEPEST, np.int64), np.empty(DEEPEST), 1
    bounds[0] = box_bound(boxes[0], seen, box)
    if bounds[0] - held > arc.half:
        return 0
    while count > 0:
        count -= 1
        node, far = waiting[count], bounds[count]
        if far - held > arc.half or _proves(boxes[node], seen, held, planes):
            continue
        size = write_middle(boxes[node], middle)
        begin, end = leaf_points(tree, node)
        if far > 0.0 or begin < end:
            see(seen, middle, x)
            enough, accuracy = held + arc.half + size, SHARE * size + _ACCURACY
            gap, _ = point_gap(bodies.points, bodies.edges, corner, x, enough, accuracy, search)
            corner = search.corners[0, 0]
            if gap > 0.0 and plane_bound(boxes[node], seen, search.plane) > held:
                _write_plane(bodies, poses, arc, corner, search.plane, planes[_PLANES - 1])
                if _proves(boxes[node], seen, held, planes[_PLANES - 1 :]):
                    continue
        if begin == end:
            one, other = 2 * node + 2, 2 * node + 1
            near, far = box_bound(boxes[one], seen, box), box_bound(boxes[other], seen, box)
            count = put_nearer_last(one, near, other, far, waiting, bounds, count)
        for k in range(begin, end):
            see(seen, points[k], x)
            if _is_beyond(x, held, planes):
                continue
            enough = held + arc.half
            gap, _ = point_gap(bodies.points, bodies.edges, corner, x, enough, _ACCURACY, search)
            corner = search.corners[0, 0]
            if not gap > held:
                return -1
            _write_plane(bodies, poses, arc, corner, search.plane, planes[_PLANES - 1])
            for bit in range(2):
                if not gap - held > planes[_PLANES - 1, _GAPS + bit]:
                    unproved |= 1 << bit
            if unproved == 3:
                return unproved
    return unproved


@compiled_part
def _write_seen(frame: Array, pose: Array, seen: Array) -> None:
    """Write a pose of the world in a frame of it, all rows of twelve numbers."""
    for r in range(3):
        moved = 0.0
        for i in range(3):
            moved += frame[3 * i + r] * (pose[9 + i] - frame[9 + i])
        seen[9 + r] = moved
        for c in range(3):
            turned = 0.0
            for i in range(3):
                turned += frame[3 * i + r] * pose[3 * i + c]
            seen[3 * r + c] = turned


@compiled_part
def _proves(node: Array, seen: Array, held: float, planes: Array) -> bool:
    """Return whether a plane proves all of a node's box on the whole arc; it is moved forward."""
    for k in range(planes.shape[0]):
        enough = max(planes[k, _GAPS], planes[k, _GAPS + 1])
        if plane_bound(node, seen, planes[k]) - held > enough:
            if k > 0:
                for n in range(planes.shape[1]):
                    before = planes[k - 1, n]
                    planes[k - 1, n] = planes[k, n]
                    planes[k, n] = before
            return True
    return False


@compiled_part
def _is_beyond(x: Array, held: float, planes: Array) -> bool:
    """Return whether a plane proves a point (3,) of the link's frame on the whole arc."""
    for k in range(planes.shape[0]):
        gap = planes[k, 0] * x[0] + planes[k, 1] * x[1] + planes[k, 2] * x[2] - planes[k, 3]
        if gap - held > max(planes[k, _GAPS], planes[k, _GAPS + 1]):
            return True
    return False


@compiled_part
def _write_plane(
    bodies: Bodies, poses: Array, arc: Arc, corner: int, found: Array, plane: Array
) -> None:
    r"""Write a plane of the link's frame, and the gap before it that proves each half of an arc.

    With the gaps f in the middle and f + δ at an end, the half is proved if

    .. math:: \beta < 8 (\sqrt{f} + \sqrt{f + \delta})^2,

    that is if :math:`\sqrt f > (s^2 - \delta) / 2s`, s = √(β/8), for |δ| <= s².

    Args:
        bodies: the bodies.
        poses: as above.
        arc: what is to be proved.
        corner: a corner of the link, on the plane.
        found: unit normal out of the link, and n · x on it in the middle (4,) [m].
        plane: the same, and the gaps that suffice on either half (6,) [m], overwritten.
    """
    normal, along, at, square = np.zeros(3), np.empty(3), found[3], 0.125 * arc.bend
    for k in range(4):
        plane[k] = found[k]
    for r in range(3):
        for c in range(3):
            normal[r] += poses[1, arc.link, 3 * r + c] * found[c]
        at += normal[r] * poses[1, arc.link, 9 + r]
    for bit in range(2):
        pose, more = poses[2 * bit, arc.link], at
        for c in range(3):
            along[c] = 0.0
            for r in range(3):
                along[c] += pose[3 * r + c] * normal[r]
            more -= normal[c] * pose[9 + c]
        more -= farthest_corner(bodies.points, bodies.edges, corner, along[0], along[1], along[2])[
            1
        ]
        enough = max(0.0, -more)
        if abs(more) < square:
            enough = (square - more) ** 2 / (4.0 * square)
        plane[_GAPS + bit] = min(enough, arc.half)
