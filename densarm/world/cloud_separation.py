"""Cloud separation: proofs that a link stays apart from all points of a cloud on an arc."""

import math

from densarm.scene.point_tree import PointTree, leaf_points, put_nearer_last
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part
from densarm.world.bodies import BOX, RADIUS, Bodies
from densarm.world.cloud_field import Arc, CloudSpace
from densarm.world.cloud_search import (
    SHARE,
    box_bound,
    plane_bound,
    see,
    write_middle,
)
from densarm.world.hulls import Search, farthest_corner, point_gap
from densarm.world.simplex import Integers

_ACCURACY = 1e-5  # [m], by which the bound on a distance may fall short of it
_SMALL = 0.25  # of how far a link moves on half an arc; into smaller nodes it is not looked there
_GAPS = 4  # first column of the gaps that suffice
_FOUND, _CORNER = 6, 10  # first columns of what is known of a plane on any arc
_UNKNOWN = -1.0  # a gap that nobody asked for yet

PLANES = (6, 11)
"""Planes that are kept of a link and a cloud, those that prove most before the others, and what of
each: in the cloud's frame unit normal out of the link, n · x on it, and the gaps before it that
suffice on either half of an arc; in the link's frame unit normal, n · x, infinite for none, and the
corner that lies on it."""


@compiled_lean_part
def unproved_halves(  # noqa: C901  # what is called at each level is compiled once more
    bodies: Bodies, poses: Array, arc: Arc, corners: Integers, planes: Array, space: CloudSpace
) -> int:
    """Return which halves of an arc a link is not proved apart from a cloud on, as bits 1 and 2.

    A node of the cloud's tree is proved by a plane before its box in the middle of the arc: by its
    gap there alone, or by those at both ends too, on halves of which all before was proved. Planes
    that have proved others are tried first. What is not proved is looked into, down to each point,
    unless it is small beside the way that the link goes: then the halves are shorter first.

    Args:
        bodies: the bodies.
        poses: of all bodies at the arc's beginning, in its middle and at its end (3, S, 12).
        arc: what is to be proved.
        corners: of the pair (4, 2): a corner of the link in the first row; the point of the cloud
            that is not apart is written to the second.
        planes: of the pair (6, 11), see `PLANES`, overwritten.
        space: to work in.

    Returns:
        -1 where a point is not apart in the middle.
    """
    c, held, corner, unproved = bodies.cloud[arc.cloud], arc.held, corners[0, 0], 0
    points = bodies.clouds.points[bodies.clouds.first[c, 0] : bodies.clouds.first[c + 1, 0]]
    boxes = bodies.clouds.boxes[bodies.clouds.first[c, 1] : bodies.clouds.first[c + 1, 1]]
    search, seen, ends, box, places, waiting, bounds = space
    x, middle, last = places[0], places[1], planes[planes.shape[0] - 1]
    _write_seen(poses[1, arc.link], poses[1, arc.cloud], seen)
    for bit in range(2):
        _write_seen(poses[2 * bit, arc.link], poses[1, arc.link], ends[bit])
    for axis in range(3):
        box[3 + axis] = bodies.shapes[arc.link, BOX + axis] - bodies.shapes[arc.link, RADIUS]
        box[axis] = -box[3 + axis]
    count, waiting[0] = 1, 0
    bounds[0] = box_bound(boxes[0], seen, box)
    if bounds[0] - held > arc.half:
        return 0
    for k in range(planes.shape[0]):
        planes[k, 3] = math.inf
        if planes[k, _FOUND + 3] < math.inf:
            _place_plane(planes[k], seen)
    while count > 0:
        count -= 1
        node, far = waiting[count], bounds[count]
        if far - held > arc.half:
            continue
        # No plane is looked for where the box may be inside of the link's.
        if far > 0.0 and _proves(bodies, space, arc, planes, boxes[node], unproved):
            continue
        begin, end = leaf_points(PointTree(points, boxes), node)
        if far > 0.0 or begin < end:
            size = write_middle(boxes[node], middle)
            see(seen, middle, x)
            enough, accuracy = held + arc.half + size, SHARE * size + _ACCURACY
            gap, _ = point_gap(bodies.points, bodies.edges, corner, x, enough, accuracy, search)
            corner = search.corners[0, 0]
            if gap > 0.0 and plane_bound(boxes[node], seen, search.plane) > held:
                _write_plane(search, corner, seen, last)
                beyond = _beyond(boxes[node], last) - held
                left = _unproved(bodies, space, arc, last, beyond, unproved)
                if left == unproved:
                    continue
                if size < _SMALL * arc.half:
                    unproved = left
                    if unproved == 3:
                        return unproved
                    continue
        if begin == end:
            one, other = 2 * node + 2, 2 * node + 1
            near, far = box_bound(boxes[one], seen, box), box_bound(boxes[other], seen, box)
            count = put_nearer_last(one, near, other, far, waiting, bounds, count)
        for k in range(begin, end):
            if _proves(bodies, space, arc, planes, points[k], unproved):
                continue
            see(seen, points[k], x)
            enough = held + arc.half
            gap, _ = point_gap(bodies.points, bodies.edges, corner, x, enough, _ACCURACY, search)
            corner = search.corners[0, 0]
            if not gap > held:
                corners[1, 0] = k
                return -1
            _write_plane(search, corner, seen, last)
            unproved = _unproved(bodies, space, arc, last, gap - held, unproved)
            if unproved == 3:
                return unproved
    return unproved


@compiled_lean_part
def meets_again(
    bodies: Bodies, pose: Array, arc: Arc, corners: Integers, space: CloudSpace
) -> bool:
    """Return whether a link is not apart, in the middle of an arc, from the point that it met last.

    Args:
        bodies: the bodies.
        pose: of all bodies (S, 12).
        arc: the link and the cloud.
        corners: of the pair, as `unproved_halves` has them.
        space: to work in.
    """
    point, x = bodies.clouds.first[bodies.cloud[arc.cloud], 0] + corners[1, 0], space.places[0]
    _write_seen(pose[arc.link], pose[arc.cloud], space.seen)
    see(space.seen, bodies.clouds.points[point], x)
    at, edges, search = bodies.points, bodies.edges, space.search
    gap, _ = point_gap(at, edges, corners[0, 0], x, arc.held, _ACCURACY, search)
    return not gap > arc.held


@compiled_lean_part
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


@compiled_lean_part
def _proves(
    bodies: Bodies, space: CloudSpace, arc: Arc, planes: Array, node: Array, unproved: int
) -> bool:
    """Return whether a plane proves a node's box (6,), or a point (3,), on all but such halves.

    It is put forward. Other arguments as for `unproved_halves`.
    """
    for k in range(planes.shape[0]):
        gap = _beyond(node, planes[k]) - arc.held
        if gap > 0.0 and _unproved(bodies, space, arc, planes[k], gap, unproved) == unproved:
            if k > 0:
                for n in range(planes.shape[1]):
                    before = planes[k - 1, n]
                    planes[k - 1, n] = planes[k, n]
                    planes[k, n] = before
            return True
    return False


@compiled_lean_part
def _beyond(node: Array, plane: Array) -> float:
    """Return how far beyond a plane in the middle of an arc a node's box (6,), or a point, is."""
    beyond, high = -plane[3], node.size - 3
    for axis in range(3):
        along = plane[axis]
        beyond += along * (node[axis] if along > 0.0 else node[high + axis])
    return float(beyond)


@compiled_lean_part
def _unproved(
    bodies: Bodies, space: CloudSpace, arc: Arc, plane: Array, gap: float, unproved: int
) -> int:
    """Return unproved halves and those that a plane with a gap in the middle does not prove."""
    for bit in range(2):
        if unproved >> bit & 1 or gap > arc.half:
            continue
        if plane[_GAPS + bit] == _UNKNOWN:
            plane[_GAPS + bit] = _sufficient_gap(bodies, space.ends[bit], arc.bend, plane)
        if not gap > plane[_GAPS + bit]:
            unproved |= 1 << bit
    return unproved


@compiled_lean_part
def _write_plane(search: Search, corner: int, seen: Array, plane: Array) -> None:
    """Write the plane of the search, on which a corner lies."""
    for k in range(4):
        plane[_FOUND + k] = search.plane[k]
    plane[_CORNER] = corner
    _place_plane(plane, seen)


@compiled_lean_part
def _place_plane(plane: Array, seen: Array) -> None:
    """Write a plane in the cloud's frame, which has a pose in the link's in the middle (12,)."""
    plane[3], plane[_GAPS], plane[_GAPS + 1] = plane[_FOUND + 3], _UNKNOWN, _UNKNOWN
    for c in range(3):
        plane[c] = 0.0
        plane[3] -= plane[_FOUND + c] * seen[9 + c]
        for r in range(3):
            plane[c] += seen[3 * r + c] * plane[_FOUND + r]


@compiled_lean_part
def _sufficient_gap(bodies: Bodies, end: Array, bend: float, plane: Array) -> float:
    r"""Return the gap before a plane in the middle of an arc that proves a half of it [m].

    With the gaps f in the middle and f + δ at the end, the half is proved if

    .. math:: \beta < 8 (\sqrt{f} + \sqrt{f + \delta})^2,

    that is if :math:`\sqrt f > (s^2 - \delta) / 2s`, s = √(β/8), for |δ| <= s².

    Args:
        bodies: the bodies.
        end: pose of the link's frame in the middle, in that at the end (12,).
        bend: β of the whole arc [m].
        plane: the plane (11,).
    """
    square, more, a, b, c = 0.125 * bend, plane[_FOUND + 3], 0.0, 0.0, 0.0
    for k in range(3):
        along = plane[_FOUND + k]
        a += end[k] * along
        b += end[3 + k] * along
        c += end[6 + k] * along
    more += a * end[9] + b * end[10] + c * end[11]
    corner = int(plane[_CORNER])
    _, farthest = farthest_corner(bodies.points, bodies.edges, corner, a, b, c)
    more -= farthest
    if abs(more) < square:
        return float((square - more) ** 2 / (4.0 * square))
    return float(max(0.0, -more))
