"""Cloud search: the point of a cloud that is nearest to a hull, by compiled code."""

import math

import numpy as np

from densarm.scene.point_tree import DEEPEST, PointTree, leaf_points, put_nearer_last
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_lean_part, compiled_part
from densarm.world.hulls import Hulls, Search, new_search, point_depth, point_gap
from densarm.world.simplex import Integers

SHARE = 0.1
"""Of a node's size, by which the plane between it and a hull may fall short of their distance."""

_ACCURACY = 1e-10  # [m], of distances


@compiled
def place_balls(
    tree: PointTree,
    pose: Array,
    hulls: Hulls,
    pair_shapes: Integers,
    pairs: Integers,
    own: tuple[int, int],
    positions: Array,
    rotations: Array,
) -> None:
    """Put balls where a cloud is nearest to hulls.

    Args:
        tree: the points of the cloud.
        pose: position and quaternion of its frame (7,) [m].
        hulls: of the first shapes, those of links.
        pair_shapes: a hull, and the ball that stands for a cloud beside it, of each pair (K, 2).
        pairs: which pairs are asked for (P,).
        own: first pair of this cloud, and that after the last.
        positions: of the frames of all shapes (S, 3) [m]; those of the balls are overwritten.
        rotations: of these frames (S, 3, 3).
    """
    search, cloud, seen = new_search(), np.empty(12), np.empty(12)
    _write_row(pose, cloud)
    for pair in pairs:
        if not own[0] <= pair < own[1]:
            continue
        body, ball = pair_shapes[pair, 0], pair_shapes[pair, 1]
        _see(cloud, positions[body], rotations[body], seen)
        x = tree.points[nearest_point(tree, seen, hulls, body, search)]
        for i in range(3):
            along = cloud[3 * i] * x[0] + cloud[3 * i + 1] * x[1] + cloud[3 * i + 2] * x[2]
            positions[ball, i] = cloud[9 + i] + along


@compiled_lean_part
def _write_row(pose: Array, row: Array) -> None:
    """Write a pose of a position and a unit quaternion (7,) as a row of twelve numbers."""
    w = pose[6]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        a, b, c = pose[3 + i], pose[3 + j], pose[3 + k]
        row[3 * i + i] = 1.0 - 2.0 * (b * b + c * c)
        row[3 * i + j] = 2.0 * (a * b - c * w)
        row[3 * i + k] = 2.0 * (a * c + b * w)
        row[9 + i] = pose[i]


@compiled_lean_part
def _see(cloud: Array, position: Array, rotation: Array, seen: Array) -> None:
    """Write the pose (12,) of a cloud, given in the world, in a frame."""
    for r in range(3):
        for c in range(3):
            turned = 0.0
            for i in range(3):
                turned += rotation[i, r] * cloud[3 * i + c]
            seen[3 * r + c] = turned
        moved = 0.0
        for i in range(3):
            moved += rotation[i, r] * (cloud[9 + i] - position[i])
        seen[9 + r] = moved


@compiled_part
def nearest_point(  # noqa: C901  # what is called at each level is compiled once more
    tree: PointTree, seen: Array, hulls: Hulls, body: int, search: Search
) -> int:
    """Return the index of the point whose signed distance from a hull is least.

    Of nodes and points that a plane or the hull's box tells to be farther than the nearest so far
    nothing is asked.

    Args:
        tree: the points.
        seen: pose of their frame in the hull's (12,) [m].
        hulls: the hulls.
        body: index of the hull.
        search: space to work in.
    """
    points, boxes = tree
    waiting, bounds = np.empty(DEEPEST, np.int64), np.empty(DEEPEST)
    x, middle, plane, box = np.empty(3), np.empty(3), np.zeros(4), hulls.boxes[body]
    best, nearest, count = math.inf, 0, 1
    corner = hulls.first[body, 0]
    plane[3] = math.inf  # which tells nothing
    waiting[0], bounds[0] = 0, -math.inf
    while count > 0:
        count -= 1
        node, bound = waiting[count], bounds[count]
        if bound >= best:
            continue
        size = write_middle(boxes[node], middle)
        see(seen, middle, x)
        bound, _ = point_gap(
            hulls.points, hulls.edges, corner, x, best + size, SHARE * size, search
        )
        corner = search.corners[0, 0]
        if bound > 0.0:
            for i in range(4):
                plane[i] = search.plane[i]
            if plane_bound(boxes[node], seen, plane) >= best:
                continue
        begin, end = leaf_points(tree, node)
        if begin == end:
            one, other = 2 * node + 1, 2 * node + 2
            near, far = box_bound(boxes[one], seen, box), box_bound(boxes[other], seen, box)
            count = put_nearer_last(one, near, other, far, waiting, bounds, count)
        for k in range(begin, end):
            see(seen, points[k], x)
            if plane[0] * x[0] + plane[1] * x[1] + plane[2] * x[2] - plane[3] >= best:
                continue
            bound, distance = point_gap(
                hulls.points, hulls.edges, corner, x, best, _ACCURACY, search
            )
            corner = search.corners[0, 0]
            if distance == 0.0:
                bound = distance = point_depth(hulls, body, x, search.plane)
            if bound < best and distance < best:
                best, nearest = distance, k
                for i in range(4):
                    plane[i] = search.plane[i]
    return nearest


@compiled_lean_part
def write_middle(node: Array, middle: Array) -> float:
    """Write the middle (3,) of a node's box (6,) [m], and return how far corners are from it."""
    size = 0.0
    for axis in range(3):
        middle[axis] = 0.5 * (node[axis] + node[3 + axis])
        size += (node[3 + axis] - middle[axis]) ** 2
    return math.sqrt(size)


@compiled_lean_part
def box_bound(node: Array, seen: Array, box: Array) -> float:
    """Return how far all of a node's box is from another at least, below zero if it may be inside.

    Args:
        node: least and largest coordinates (6,) [m].
        seen: pose of its frame in that of the other (12,) [m].
        box: likewise of the other (6,) [m].
    """
    outside, inside = 0.0, -math.inf
    for r in range(3):
        middle, half = seen[9 + r], 0.0
        for c in range(3):
            middle += 0.5 * seen[3 * r + c] * (node[3 + c] + node[c])
            half += 0.5 * abs(seen[3 * r + c]) * (node[3 + c] - node[c])
        gap = max(box[r] - middle, middle - box[3 + r]) - half
        inside = max(inside, gap)
        outside += max(gap, 0.0) ** 2
    return math.sqrt(outside) if outside > 0.0 else inside


@compiled_lean_part
def plane_bound(node: Array, seen: Array, plane: Array) -> float:
    """Return how far beyond a plane, unit normal and n · x on it (4,), a node's box is [m]."""
    beyond: float = -plane[3]
    for r in range(3):
        beyond += plane[r] * seen[9 + r]
    for c in range(3):
        along = plane[0] * seen[c] + plane[1] * seen[3 + c] + plane[2] * seen[6 + c]
        beyond += 0.5 * along * (node[3 + c] + node[c]) - 0.5 * abs(along) * (node[3 + c] - node[c])
    return beyond


@compiled_lean_part
def see(pose: Array, point: Array, seen: Array) -> None:
    """Write where a point (3,) of a frame is in another, in which that frame has a pose (12,)."""
    for r in range(3):
        seen[r] = pose[9 + r]
        for c in range(3):
            seen[r] += pose[3 * r + c] * point[c]
