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
from densarm.world.hulls import farthest_corner, point_gap
from densarm.world.simplex import Integers

_ACCURACY = 1e-5  # [m], by which the bound on a distance may fall short of it
_MANY, _LONG = 100, 0.1  # nodes looked at on an arc of more than so many [m], which is halved then
_GAPS = 4  # first column of the gaps that suffice
_FOUND = 6  # first column of what is known of a plane on any arc

PLANES = (6, 10)
"""Planes that are kept of a link and a cloud, those that prove most before the others, and what of
each: in the cloud's frame unit normal out of the link, n · x on it, and the gaps before it that
suffice on either half of an arc; unit normal and n · x in the link's frame, infinite for none."""


@compiled_lean_part
def unproved_halves(  # noqa: C901  # what is called at each level is compiled once more
    bodies: Bodies, poses: Array, arc: Arc, corners: Integers, planes: Array, space: CloudSpace
) -> int:
    """Return which halves of an arc a link is not proved apart from a cloud on, as bits 1 and 2.

    A node of the cloud's tree is proved by a plane before its box in the middle of the arc: by its
    gap there alone, or by those at both ends too. Planes that have proved others are tried first.
    What is not proved is looked into, down to each point.

    Args:
        bodies: the bodies.
        poses: of all bodies at the arc's beginning, in its middle and at its end (3, S, 12).
        arc: what is to be proved.
        corners: of the pair (4, 2): a corner of the link in the first row; the point of the cloud
            that is not apart is written to the second.
        planes: of the pair (6, 10), see `PLANES`, overwritten.
        space: to work in.

    Returns:
        -1 where a point is not apart in the middle.
    """
    c, held, corner, unproved = bodies.cloud[arc.cloud], arc.held, corners[0, 0], 0
    points = bodies.clouds.points[bodies.clouds.first[c, 0] : bodies.clouds.first[c + 1, 0]]
    boxes = bodies.clouds.boxes[bodies.clouds.first[c, 1] : bodies.clouds.first[c + 1, 1]]
    search, seen, ends, box, places, waiting, bounds = space
    x, middle = places[0], places[1]
    _write_seen(poses[1, arc.link], poses[1, arc.cloud], seen)
    for bit in range(2):
        _write_seen(poses[2 * bit, arc.link], poses[1, arc.link], ends[bit])
    for axis in range(3):
        box[3 + axis] = bodies.shapes[arc.link, BOX + axis] - bodies.shapes[arc.link, RADIUS]
        box[axis] = -box[3 + axis]
    count, waiting[0], looked_at = 1, 0, 0
    bounds[0] = box_bound(boxes[0], seen, box)
    if bounds[0] - held > arc.half:
        return 0
    for k in range(planes.shape[0]):
        planes[k, 3] = math.inf
        if planes[k, _FOUND + 3] < math.inf:
            _write_gaps(bodies, space, arc, corner, planes[k])
    while count > 0:
        count -= 1
        node, far = waiting[count], bounds[count]
        # No plane is looked for where the box may be inside of the link's.
        if far - held > arc.half or (far > 0.0 and _proves(boxes[node], held, planes)):
            continue
        looked_at += 1
        if looked_at > _MANY and arc.half > _LONG:
            return 3
        begin, end = leaf_points(PointTree(points, boxes), node)
        if far > 0.0 or begin < end:
            size = write_middle(boxes[node], middle)
            see(seen, middle, x)
            enough, accuracy = held + arc.half + size, SHARE * size + _ACCURACY
            gap, _ = point_gap(bodies.points, bodies.edges, corner, x, enough, accuracy, search)
            corner = search.corners[0, 0]
            if gap > 0.0 and plane_bound(boxes[node], seen, search.plane) > held:
                _write_plane(bodies, space, arc, corner, planes)
                if _proves(boxes[node], held, planes[planes.shape[0] - 1 :]):
                    continue
        if begin == end:
            one, other = 2 * node + 2, 2 * node + 1
            near, far = box_bound(boxes[one], seen, box), box_bound(boxes[other], seen, box)
            count = put_nearer_last(one, near, other, far, waiting, bounds, count)
        for k in range(begin, end):
            if _is_beyond(points[k], held, planes):
                continue
            see(seen, points[k], x)
            enough = held + arc.half
            gap, _ = point_gap(bodies.points, bodies.edges, corner, x, enough, _ACCURACY, search)
            corner = search.corners[0, 0]
            if not gap > held:
                corners[1, 0] = k
                return -1
            _write_plane(bodies, space, arc, corner, planes)
            for bit in range(2):
                if not gap - held > planes[planes.shape[0] - 1, _GAPS + bit]:
                    unproved |= 1 << bit
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
def _proves(node: Array, held: float, planes: Array) -> bool:
    """Return whether a plane proves all of a node's box on the whole arc; it is moved forward."""
    for k in range(planes.shape[0]):
        beyond = -planes[k, 3] - held
        for axis in range(3):
            along = planes[k, axis]
            beyond += along * (node[axis] if along > 0.0 else node[3 + axis])
        if beyond > max(planes[k, _GAPS], planes[k, _GAPS + 1]):
            if k > 0:
                for n in range(planes.shape[1]):
                    before = planes[k - 1, n]
                    planes[k - 1, n] = planes[k, n]
                    planes[k, n] = before
            return True
    return False


@compiled_lean_part
def _is_beyond(x: Array, held: float, planes: Array) -> bool:
    """Return whether a plane proves a point (3,) of the cloud's frame on the whole arc."""
    for k in range(planes.shape[0]):
        gap = planes[k, 0] * x[0] + planes[k, 1] * x[1] + planes[k, 2] * x[2] - planes[k, 3]
        if gap - held > max(planes[k, _GAPS], planes[k, _GAPS + 1]):
            return True
    return False


@compiled_lean_part
def _write_plane(bodies: Bodies, space: CloudSpace, arc: Arc, corner: int, planes: Array) -> None:
    """Write the plane of the search as the last one. Arguments as for `_write_gaps`."""
    plane = planes[planes.shape[0] - 1]
    for k in range(4):
        plane[_FOUND + k] = space.search.plane[k]
    _write_gaps(bodies, space, arc, corner, plane)


@compiled_lean_part
def _write_gaps(bodies: Bodies, space: CloudSpace, arc: Arc, corner: int, plane: Array) -> None:
    r"""Write a plane in the cloud's frame, and the gaps that prove each half of an arc.

    With the gaps f in the middle and f + δ at an end, the half is proved if

    .. math:: \beta < 8 (\sqrt{f} + \sqrt{f + \delta})^2,

    that is if :math:`\sqrt f > (s^2 - \delta) / 2s`, s = √(β/8), for |δ| <= s².

    Args:
        bodies: the bodies.
        space: what is known of the arc.
        arc: what is to be proved.
        corner: a corner of the link, near to the plane.
        plane: as it is in the link's frame (10,); the rest is written.
    """
    found, along = plane[_FOUND:], space.places[2]
    square, plane[3] = 0.125 * arc.bend, found[3]
    for c in range(3):
        plane[c] = 0.0
        plane[3] -= found[c] * space.seen[9 + c]
        for r in range(3):
            plane[c] += space.seen[3 * r + c] * found[r]
    for bit in range(2):
        pose, more = space.ends[bit], found[3]
        for r in range(3):
            along[r] = 0.0
            for c in range(3):
                along[r] += pose[3 * r + c] * found[c]
            more += along[r] * pose[9 + r]
        _, farthest = farthest_corner(
            bodies.points, bodies.edges, corner, along[0], along[1], along[2]
        )
        more -= farthest
        enough = max(0.0, -more)
        if abs(more) < square:
            enough = (square - more) ** 2 / (4.0 * square)
        plane[_GAPS + bit] = min(enough, arc.half)
