"""Hulls: sphere-swept convex hulls as arrays, and their distances from points."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import coal
import numpy as np

from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part, compiled_part
from densarm.world.simplex import Integers, approach_origin

_SLICES = 16  # of a hull that balls cover
_ITERATIONS = 60
_CONTACT = 1e-10  # [m], closer than this a point counts as inside


class Hulls(NamedTuple):
    """Convex hulls enlarged by a radius each, every one in its own frame."""

    points: Array
    """Corners of all hulls, one hull after the other (P, 3) [m]."""
    edges: Integers
    """Where the neighbours of each corner begin and end in this array (P + 1,), then the corners
    that share an edge with a corner, one corner after the other."""
    first: Integers
    """First corner and first face of each hull, and those after the last (S + 1, 2)."""
    faces: Array
    """Unit normals of all faces out of their hulls, and n · x on them (F, 4) [m]."""
    boxes: Array
    """Least and largest coordinates of each hull's corners (S, 6) [m]."""
    radius: Array
    """By which each hull is enlarged (S,) [m]."""


def hulls_of(shapes: Sequence[coal.CollisionGeometry]) -> Hulls:
    """Return the hulls of spheres, capsules and convex shapes."""
    corners, radii = zip(*map(extreme_points, shapes), strict=True)
    near = [neighbours(*each) for each in zip(shapes, corners, radii, strict=True)]
    faces = [_faces(each) for each in corners]
    first = np.array([np.cumsum([0, *map(len, each)]) for each in (corners, faces)]).T
    boxes = [np.concatenate([each.min(axis=0), each.max(axis=0)]) for each in corners]
    return Hulls(
        points=np.vstack(corners),
        edges=edge_table(near, first[:, 0]),
        first=np.ascontiguousarray(first, dtype=np.int64),
        faces=np.vstack(faces),
        boxes=np.array(boxes),
        radius=np.array(radii),
    )


Neighbours = tuple[Integers, Integers]
"""Numbers of neighbours of a hull's corners, and the neighbours, one corner after the other."""


def neighbours(hull: coal.CollisionGeometry, corners: Array, radius: float) -> Neighbours:
    """Return a hull's neighbours; all corners of a round shape are each other's."""
    count = len(corners)
    found = [hull.neighbors(k) if radius == 0.0 else range(count) for k in range(count)]
    return np.array([*map(len, found)]), np.concatenate([*map(np.array, found)])


def edge_table(near: Iterable[Neighbours], first: Integers) -> Integers:
    """Return `Hulls.edges` of the neighbours of each hull, and where the hulls begin."""
    counts, others = zip(*near, strict=True)
    number = np.concatenate(counts)
    ends = len(number) + 1 + np.append(0, np.cumsum(number))
    moved = [begin + each for begin, each in zip(first, others, strict=False)]
    return np.concatenate([ends, *moved]).astype(np.int64)


def cover(corners: Array, near: Neighbours) -> Array:
    """Return balls, middle and radius (B, 4) [m], that cover a hull: one for each of some slices.

    It is cut across its longest side into slices as thick as half of what they are wide.
    """
    extent = np.ptp(corners, axis=0)
    axis = int(extent.argmax())
    wide = float(np.delete(extent, axis).max())
    count = min(_SLICES, max(1, int(np.ceil(2.0 * extent[axis] / max(wide, 1e-3)))))
    cuts = corners[:, axis].min() + extent[axis] * np.linspace(0.0, 1.0, count + 1)
    begin = np.repeat(np.arange(len(corners)), near[0])
    one, other = corners[begin], corners[near[1]]
    balls = np.empty((count, 4))
    for k, (low, high) in enumerate(pairwise(cuts)):
        ends = [corners[(corners[:, axis] >= low) & (corners[:, axis] <= high)]]
        for cut in (low, high):
            crosses = (one[:, axis] < cut) & (cut < other[:, axis])
            a, b = one[crosses], other[crosses]
            share = (cut - a[:, axis]) / (b[:, axis] - a[:, axis])
            ends.append(a + share[:, np.newaxis] * (b - a))
        points = np.vstack(ends)
        balls[k, :3] = 0.5 * (points.min(axis=0) + points.max(axis=0))
        balls[k, 3] = np.linalg.norm(points - balls[k, :3], axis=1).max() * (1.0 + 1e-9)
    return balls


def _faces(corners: Array) -> Array:
    if len(corners) < 4:  # of a ball or capsule
        return np.zeros((0, 4))
    from scipy.spatial import ConvexHull

    planes = np.unique(ConvexHull(corners).equations, axis=0)
    return np.column_stack([planes[:, :3], -planes[:, 3]])


class Search(NamedTuple):
    """Space in which the distance of a point from a hull is found."""

    simplex: Array
    system: Array
    corners: Integers
    plane: Array
    """Unit normal of the last plane between them, out of the hull, and n · x on the hull (4,)."""


@compiled_part
def new_search() -> Search:
    """Return space for searches."""
    return Search(np.empty((4, 4)), np.empty((4, 4)), np.zeros((5, 2), np.int64), np.zeros(4))


@compiled_lean_part
def point_gap(
    points: Array,
    edges: Integers,
    start: int,
    x: Array,
    enough: float,
    accuracy: float,
    search: Search,
) -> tuple[float, float]:
    """Return a lower bound on a point's distance from a hull and its distance [m]; zeros inside.

    Unless the bound is enough, the distance exceeds it by the accuracy at most. Where it is
    positive, the bound is by the plane that is written to the search.

    Args:
        points: corners of hulls (P, 3) [m].
        edges: their neighbours, as `Hulls.edges`.
        start: a corner of the hull.
        x: the point, in the hull's frame (3,) [m].
        enough: a bound that need not be improved [m].
        accuracy: of the distance [m].
        search: space to work in; its first corner is one near to the point afterwards.

    Source: Gilbert, Johnson, Keerthi, A Fast Procedure for Computing the Distance Between Complex
        Objects in Three-Dimensional Space, IEEE J. Robotics and Automation 1988.
    """
    simplex, system, corners, plane = search
    best, norm, count, corner = 0.0, 0.0, 1, start
    corners[0, 0] = start
    for axis in range(3):
        simplex[0, axis] = points[start, axis] - x[axis]
    simplex[0, 3] = 1.0
    for _ in range(_ITERATIONS):
        count = approach_origin(simplex, system, corners, count)
        a, b, c = system[0, 0], system[0, 1], system[0, 2]
        norm = math.sqrt(a * a + b * b + c * c)
        if count == 4 or norm < _CONTACT:
            best = norm = 0.0
            break
        a, b, c = -a / norm, -b / norm, -c / norm
        corner, farthest = farthest_corner(points, edges, corner, a, b, c)
        gap = a * x[0] + b * x[1] + c * x[2] - farthest
        if gap > best:
            best = gap
            plane[0], plane[1], plane[2], plane[3] = a, b, c, farthest
        is_known = False
        for k in range(count):
            is_known |= corners[k, 0] == corner
        if is_known or gap >= norm - accuracy or (gap > 0.0 and gap >= enough):
            break
        corners[count, 0] = corner
        for axis in range(3):
            simplex[count, axis] = points[corner, axis] - x[axis]
        simplex[count, 3] = 0.0
        count += 1
    corners[0, 0] = corner
    return best, norm


@compiled_lean_part
def farthest_corner(
    points: Array, edges: Integers, start: int, a: float, b: float, c: float
) -> tuple[int, float]:
    """Return the corner of a hull farthest along [a, b, c], and how far, from a corner of it."""
    corner, climbing = start, True
    best = points[corner, 0] * a + points[corner, 1] * b + points[corner, 2] * c
    while climbing:
        climbing = False
        for k in range(edges[corner], edges[corner + 1]):
            near = edges[k]
            value = points[near, 0] * a + points[near, 1] * b + points[near, 2] * c
            if value > best:
                best, corner, climbing = value, near, True
    return corner, best


@compiled_lean_part
def point_depth(hulls: Hulls, body: int, x: Array, plane: Array) -> float:
    """Return the signed distance of a point inside a hull [m], and write the nearest face (4,)."""
    deepest, face = -math.inf, -1
    for k in range(hulls.first[body, 1], hulls.first[body + 1, 1]):
        height = -hulls.faces[k, 3]
        for axis in range(3):
            height += hulls.faces[k, axis] * x[axis]
        if height > deepest:
            deepest, face = height, k
    if face < 0:
        return 0.0
    for k in range(4):
        plane[k] = hulls.faces[face, k]
    return min(deepest, 0.0)
