"""Cloud field: how far places are from a cloud, found where asked for and kept."""

import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from densarm.scene.point_tree import (
    DEEPEST,
    PointTree,
    leaf_points,
    put_nearer_last,
    square_from_box,
)
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part, compiled_part
from densarm.world.bodies import Bodies, bodies_of
from densarm.world.hulls import Search, new_search
from densarm.world.simplex import Integers
from densarm.world.world import World

_CELL = 0.02  # [m], side of the cells
_COARSE = 4  # times as wide are those that are asked first
_MOST = 4e6  # cells of a cloud


class Arc(NamedTuple):
    """A link beside a cloud that stands, while it moves for a while."""

    link: int
    """Index of its body."""
    cloud: int
    """Index of a body that stands for the cloud."""
    held: float
    """Distance of the hull from the points that must be exceeded [m]."""
    half: float
    """How far a point of the link moves on either half at most [m]."""
    bend: float
    """β of the whole arc, as `SeparatingPlanes` has it [m]."""


class CloudSpace(NamedTuple):
    """Space in which a proof about a link and a cloud is found."""

    search: Search
    """For the distance of a point."""
    seen: Array
    """Pose of the cloud in the link's frame in the middle of the arc (12,)."""
    ends: Array
    """That of the link in the middle, in its frame at both ends of the arc (2, 12)."""
    box: Array
    """Least and largest coordinates of the link's hull (6,) [m]."""
    places: Array
    """A point, the middle of a box, and a direction (3, 3)."""
    waiting: Integers
    """Nodes that wait (64,)."""
    bounds: Array
    """How far they are at least (64,) [m]."""


@compiled_part
def new_cloud_space() -> CloudSpace:
    """Return space for proofs."""
    return CloudSpace(
        new_search(),
        np.empty(12),
        np.empty((2, 12)),
        np.empty(6),
        np.empty((3, 3)),
        np.empty(DEEPEST, np.int64),
        np.empty(DEEPEST),
    )


class Fields(NamedTuple):
    """Grids of cells around clouds, with the distance of each cell's middle from the points."""

    distances: NDArray[np.float32]
    """Lower bounds on the distances (N,) [m], negative where not known yet; overwritten."""
    cells: Array
    """Sides of the cells of each cloud, coarse and fine (C, 2) [m]."""
    sizes: Integers
    """The number of these along x, y and z, and the first of them (C, 2, 4)."""


def fields_of(world: World) -> Fields:
    """Return the fields of a world's clouds, kept with what is known until an obstacle changes."""
    version, made = _MADE.get(world, (0, None))
    if made is None or version != world.version:
        made = _empty_fields(bodies_of(world)[0])
        _MADE[world] = (world.version, made)
    return made


# A plan proves under several margins, each time with the same clouds.
_MADE: WeakKeyDictionary[World, tuple[int, Fields]] = WeakKeyDictionary()


def _empty_fields(bodies: Bodies) -> Fields:
    count = len(bodies.clouds.first) - 1
    cells, sizes, end = np.zeros((count, 2)), np.zeros((count, 2, 4), np.int64), 0
    for c, first in enumerate(bodies.clouds.first[:-1, 1]):
        box = bodies.clouds.boxes[first].reshape(2, 3)
        extent = np.maximum(box[1] - box[0], _CELL)
        fine = max(_CELL, float(extent.prod() / _MOST) ** (1.0 / 3.0))
        for level, cell in enumerate((_COARSE * fine, fine)):
            cells[c, level] = cell
            sizes[c, level] = [*np.ceil(extent / cell).astype(int) + 1, end]
            end += int(sizes[c, level, :3].prod())
    return Fields(np.full(end, -1.0, np.float32), cells, sizes)


@compiled_lean_part
def field_bound(bodies: Bodies, fields: Fields, pose: Array, arc: Arc, space: CloudSpace) -> float:
    """Return how far a link is from the points of a cloud at least, by balls that cover it [m].

    Args:
        bodies: the bodies, whose covers are used.
        fields: of their clouds; what is asked for and not known yet is found out.
        pose: of all bodies (S, 12).
        arc: the link and the cloud.
        space: to work in.
    """
    least, x, seen = math.inf, space.places[0], space.places[1]
    frame, cloud = pose[arc.link], pose[arc.cloud]
    for n in range(bodies.first_cover[arc.link], bodies.first_cover[arc.link + 1]):
        for r in range(3):
            x[r] = frame[9 + r] - cloud[9 + r]
            for k in range(3):
                x[r] += frame[3 * r + k] * bodies.covers[n, k]
        for k in range(3):
            seen[k] = cloud[k] * x[0] + cloud[3 + k] * x[1] + cloud[6 + k] * x[2]
        radius, c = bodies.covers[n, 3], bodies.cloud[arc.cloud]
        far = _distance(bodies, fields, c, 0, math.inf, seen, space)
        if far - radius <= arc.held + arc.half:
            most = far + 2.0 * math.sqrt(3.0) * fields.cells[c, 0]
            far = _distance(bodies, fields, c, 1, most, seen, space)
        least = min(least, far - radius)
        if least <= arc.held:
            break
    return least


@compiled_lean_part
def _distance(
    bodies: Bodies, fields: Fields, c: int, level: int, most: float, x: Array, space: CloudSpace
) -> float:
    """Return a lower bound on the distance of a place (3,) from a cloud, both in its frame [m].

    No point is nearer to a place than to the nearest one in the cloud's box, since that is convex.
    """
    box, cell = bodies.clouds.boxes[bodies.clouds.first[c, 1]], fields.cells[c, level]
    index, off, out, stride = fields.sizes[c, level, 3], 0.0, 0.0, 1
    middle = space.places[2]
    for axis in range(3):
        inside = min(max(x[axis], box[axis]), box[3 + axis])
        k = math.floor((inside - box[axis]) / cell + 0.5)
        middle[axis] = box[axis] + cell * k
        off += (inside - middle[axis]) ** 2
        out += (x[axis] - inside) ** 2
        index += stride * k
        stride *= fields.sizes[c, level, axis]
    known = fields.distances[index]
    if known < 0.0:
        known = fields.distances[index] = np.float32(
            _from_points(bodies, c, most, middle, space) * (1.0 - 1e-6)
        )
    return max(float(known) - math.sqrt(off), math.sqrt(out))


@compiled_lean_part
def _from_points(bodies: Bodies, c: int, most: float, x: Array, space: CloudSpace) -> float:
    """Return the distance of a place from the nearest point of a cloud, which is at most so far."""
    points = bodies.clouds.points[bodies.clouds.first[c, 0] : bodies.clouds.first[c + 1, 0]]
    boxes = bodies.clouds.boxes[bodies.clouds.first[c, 1] : bodies.clouds.first[c + 1, 1]]
    waiting, bounds = space.waiting, space.bounds
    waiting[0], bounds[0] = 0, 0.0
    count, least = 1, most * most
    while count > 0:
        count -= 1
        node = waiting[count]
        if bounds[count] >= least:
            continue
        begin, end = leaf_points(PointTree(points, boxes), node)
        if begin == end:
            one, other = 2 * node + 2, 2 * node + 1
            near, far = square_from_box(boxes[one], x), square_from_box(boxes[other], x)
            count = put_nearer_last(one, near, other, far, waiting, bounds, count)
        for k in range(begin, end):
            square = 0.0
            for axis in range(3):
                square += (points[k, axis] - x[axis]) ** 2
            least = min(least, square)
    return math.sqrt(least)
