"""TriangleMesh: surfaces as triangles, alike for the page and for pictures."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, pairwise
from operator import itemgetter

import coal
import numpy as np
from numpy.typing import NDArray

from densarm.scene.shapes import box_hull, circumscribed_cylinder, convex_hull, extreme_points
from densarm.values.arrays import Array

_CREASE = np.cos(np.radians(40.0))
"""Cosine of the angle between faces from which on the edge between them is sharp."""

_PARALLELS, _MERIDIANS = 17, 32  # of the ball that rounds a hull
_TUBE_SIDES = 10


@dataclass(frozen=True)
class TriangleMesh:
    """Triangles with the normals that they are shaded by."""

    vertices: Array
    """Corners (N, 3) [m]."""
    normals: Array
    """Unit normal of the surface at each of them (N, 3)."""
    faces: NDArray[np.int64]
    """Indices of the corners of each triangle (M, 3), counterclockwise from outside."""
    edges: Array
    """Ends of the sharp edges (E, 2, 3) [m]."""
    is_smooth: bool = True
    """Whether each normal is the mean of the faces around its corner."""
    colors: Array | None = None
    """Red, green and blue at each corner (N, 3), 0 to 1; None where the mesh has one colour."""


def mesh_of(shape: coal.CollisionGeometry) -> TriangleMesh:
    """Return the surface of a shape: a mesh, box, sphere, capsule, cylinder or convex hull."""
    if isinstance(shape, coal.BVHModelBase):
        faces = _corners(map(shape.tri_indices, range(shape.num_tris)))
        is_mirrored = shape.computeVolume() < 0.0
        return _smooth(np.array(shape.vertices()), faces[:, ::-1] if is_mirrored else faces)
    if isinstance(shape, coal.Box):
        shape = box_hull(2.0 * shape.halfSide)
    elif isinstance(shape, coal.Cylinder):
        shape = circumscribed_cylinder(shape.radius, 2.0 * shape.halfLength)
    return sphere_swept_hull(*extreme_points(shape))


def sphere_swept_hull(points: Array, radius: float) -> TriangleMesh:
    """Return the convex hull of balls of a radius ≥ 0 [m] about points (N, 3) [m].

    It has sharp edges if the balls are points.
    """
    if radius > 0.0:
        points = (points[:, np.newaxis] + radius * _ball()).reshape(-1, 3)
    hull = convex_hull(points)
    vertices = np.array(hull.points())
    faces = _corners(map(hull.polygons, range(hull.num_polygons)))
    return _smooth(vertices, faces) if radius > 0.0 else _creased(vertices, faces)


def octahedra(points: Array, radius: float) -> TriangleMesh:
    """Return an octahedron of a radius [m] about each of points (N, 3) [m]."""
    corners = np.vstack([np.eye(3), -np.eye(3)])
    x, y, z = np.meshgrid([0, 3], [1, 4], [2, 5], indexing="ij")
    faces = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    turned = np.linalg.det(corners[faces]) < 0.0
    faces[turned] = faces[turned][:, ::-1]
    vertices = (points[:, np.newaxis] + radius * corners).reshape(-1, 3)
    first = len(corners) * np.arange(len(points))
    return TriangleMesh(
        vertices,
        np.tile(corners, (len(points), 1)),
        (first[:, np.newaxis, np.newaxis] + faces).reshape(-1, 3),
        np.zeros((0, 2, 3)),
        is_smooth=False,
    )


def tube(points: Array, radius: float, colors: Array) -> TriangleMesh:
    """Return a tube of a radius [m] along points (N, 3) [m], no two neighbours the same.

    It has a colour at each of the points (N, 3).
    """
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.eye(3)[np.argmin(np.abs(along[0]))]
    rings = []
    for direction in along:
        side = side - (side @ direction) * direction  # the least twist from ring to ring
        side /= np.linalg.norm(side)
        angle = 2.0 * np.pi * np.arange(_TUBE_SIDES)[:, np.newaxis] / _TUBE_SIDES
        rings.append(np.cos(angle) * side + np.sin(angle) * np.cross(direction, side))
    normals = np.vstack(rings)
    centres, ring = np.repeat(points, _TUBE_SIDES, axis=0), np.arange(_TUBE_SIDES)
    after = np.roll(ring, -1)
    starts = _TUBE_SIDES * np.arange(len(points))
    faces = [
        np.column_stack(corners)
        for a, b in pairwise(starts)
        for corners in ((a + ring, a + after, b + ring), (b + ring, a + after, b + after))
    ]
    return TriangleMesh(
        centres + radius * normals,
        normals,
        np.vstack(faces),
        np.zeros((0, 2, 3)),
        colors=np.repeat(colors, _TUBE_SIDES, axis=0),
    )


def _corners(triangles: Iterable[coal.Triangle]) -> NDArray[np.int64]:
    # Meshes have a hundred thousand triangles, and coal hands them out one by one.
    corners = chain.from_iterable(map(itemgetter(0, 1, 2), triangles))
    return np.fromiter(corners, dtype=np.int64).reshape(-1, 3)


def _ball() -> Array:
    """Return points (K, 3) all over the unit sphere."""
    polar = np.linspace(0.0, np.pi, _PARALLELS)[1:-1]
    around = 2.0 * np.pi * np.arange(_MERIDIANS) / _MERIDIANS
    polar, around = (axis.ravel() for axis in np.meshgrid(polar, around))
    sphere = np.stack(
        [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)]
    )
    return np.vstack([sphere.T, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])


def _face_normals(vertices: Array, faces: NDArray[np.int64]) -> Array:
    """Return the normals (M, 3), as long as twice the areas."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def _smooth(vertices: Array, faces: NDArray[np.int64]) -> TriangleMesh:
    normals, of_face = np.zeros_like(vertices), _face_normals(vertices, faces)
    for k in range(3):
        np.add.at(normals, faces[:, k], of_face)
    return TriangleMesh(vertices, _unit(normals), faces, np.zeros((0, 2, 3)))


def _creased(vertices: Array, faces: NDArray[np.int64]) -> TriangleMesh:
    """Return a mesh with a vertex for each corner of each face.

    Its normal is the mean of those faces around it that lie about as this one.
    """
    area_normals = _face_normals(vertices, faces)
    directions = _unit(area_normals)
    alike = directions @ directions.T > _CREASE
    around = np.zeros((len(faces), len(vertices)), dtype=bool)
    around[np.arange(len(faces))[:, np.newaxis], faces] = True
    normals = [(around[:, faces[:, k]].T & alike) @ area_normals for k in range(3)]
    corners = vertices[faces].reshape(-1, 3)
    shared = np.stack(normals, axis=1).reshape(-1, 3)
    numbers = np.arange(len(corners)).reshape(-1, 3)
    edges = _sharp_edges(vertices, faces, alike)
    return TriangleMesh(corners, _unit(shared), numbers, edges, is_smooth=False)


def _sharp_edges(vertices: Array, faces: NDArray[np.int64], alike: NDArray[np.bool_]) -> Array:
    seen: dict[tuple[int, int], int] = {}
    sharp = []
    for face, (a, b, c) in enumerate(faces.tolist()):
        for edge in ((a, b), (b, c), (c, a)):
            other = seen.setdefault((min(edge), max(edge)), face)
            if not alike[face, other]:
                sharp.append(edge)
    return vertices[np.array(sharp, dtype=np.int64).reshape(-1, 2)]
