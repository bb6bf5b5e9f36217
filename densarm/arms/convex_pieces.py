"""Convex pieces that together enclose a triangle mesh: parts between planes, each by its hull."""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from densarm.errors import RobotDescriptionError
from densarm.scene.shapes import convex_hull
from densarm.values.arrays import Array

MOST_PIECES = 8
"""Pieces of one mesh at most."""

LEAST_GAIN = 0.01
"""Part of the hull's volume that each cut must take away."""

_POSITIONS = 9  # planes tried along each axis, and again between the best one's neighbours
_TRIANGLES = 4000  # about so many of a part's, evenly chosen, by which cuts are compared
_TOLERANCE = 1e-9  # per extent of the mesh, by which a corner may lie beyond a plane
_INSIDE = 0.1  # winding number, which rounding or a hole in the mesh make no whole one

# Evenly spread; the points farthest along them stand for all where cuts are compared.
_HEIGHT = np.linspace(-1.0, 1.0, 100)
_TURN = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(100)
_DIRECTIONS = np.array([np.cos(_TURN), np.sin(_TURN), _HEIGHT])
_DIRECTIONS[:2] *= np.sqrt(1.0 - _HEIGHT**2)


class ConvexTree(NamedTuple):
    """The hull of a mesh, and the parts that it and its parts were cut into."""

    corners: list[Array]
    """Corners of each part (C, 3) [m]; the first is the hull of all."""
    halves: NDArray[np.int64]
    """Indices of the two parts that each was cut into (N, 2), or zeros."""

    @property
    def pieces(self) -> list[int]:
        """Indices of the parts that were not cut: they are all of the mesh."""
        return np.flatnonzero(self.halves[:, 0] == 0).tolist()


class _Part(NamedTuple):
    """What of a mesh lies between planes."""

    triangles: Array  # (N, 3, 3) [m]
    planes: Array  # (P, 4), rows (n, d) with n · x <= d in the part
    corners: Array  # of its hull (C, 3) [m]
    volume: float  # of its hull [m³]


def convex_tree(
    triangles: Array, most: int = MOST_PIECES, least_gain: float = LEAST_GAIN
) -> ConvexTree:
    """Cut a mesh into convex pieces whose union encloses it.

    The mesh is cut by planes along the axes of its frame, one after the other, each where it takes
    most from the sum of the hulls' volumes. A part is the hull of what of the triangles lies
    between its planes, and of the points there in which three planes meet inside the mesh. So the
    parts enclose every triangle, and all of the solid if the mesh is closed: an extreme point of
    the solid between planes is on its surface, where one plane or two may meet it, or on three.
    What is inside is told by the winding number.

    Args:
        triangles: the mesh (N, 3, 3) [m], which spans a volume.
        most: number of pieces at most.
        least_gain: part of the hull's volume that each cut must take away.

    Source: winding numbers by solid angles: van Oosterom and Strackee, "The Solid Angle of a Plane
    Triangle", IEEE Transactions on Biomedical Engineering, 1983.
    """
    parts = [_part(triangles, triangles, np.empty((0, 4)))]
    found, halves = {0: _halves(parts[0], triangles)}, {}
    while len(found) < most:
        gains = {k: parts[k].volume - sum(half.volume for half in found[k]) for k in found}
        k = max(gains, key=lambda k: gains[k])
        if gains[k] < least_gain * parts[0].volume:
            break
        halves[k] = len(parts), len(parts) + 1
        for half in found.pop(k):
            found[len(parts)] = _halves(half, triangles)
            parts.append(half)
    indices = [halves.get(k, (0, 0)) for k in range(len(parts))]
    return ConvexTree([part.corners for part in parts], np.array(indices, dtype=np.int64))


def _part(inside: Array, mesh: Array, planes: Array) -> _Part:
    """Return a part; of infinite volume, so that no cut makes it, if it has no convex hull."""
    corners, volume = _hull(inside.reshape(-1, 3))
    inner = _inner_corners(mesh, planes, corners)
    if len(inner) > 0:
        corners, volume = _hull(np.vstack([corners, inner]))
    try:
        convex_hull(corners)
    except RobotDescriptionError:
        volume = np.inf
    return _Part(inside, planes, corners, volume)


def _halves(part: _Part, mesh: Array) -> list[_Part]:
    """Return the two parts that the best cut makes of one."""
    low, high = part.corners.min(axis=0), part.corners.max(axis=0)
    few = part.triangles[:: len(part.triangles) // _TRIANGLES + 1]
    points = np.vstack([np.unique(few.reshape(-1, 3), axis=0), part.corners])
    cuts = [_best_cut(few, points, k, low[k], high[k]) for k in range(3)]
    _, axis, position = min(cuts)
    near = (high[axis] - low[axis]) / (_POSITIONS + 1)
    finer = _best_cut(few, points, axis, position - near, position + near)
    _, axis, position = min(*cuts, finer)
    halves = []
    for side in (1.0, -1.0):
        inside = _clipped(part.triangles, axis, position, side)
        plane = np.append(side * np.eye(3)[axis], side * position)
        halves.append(_part(inside, mesh, np.vstack([part.planes, plane])))
    return halves


def _best_cut(
    triangles: Array, points: Array, axis: int, low: float, high: float
) -> tuple[float, int, float]:
    """Return about the volume that the best of some cuts between two positions leaves, and it."""
    positions = np.linspace(low, high, _POSITIONS + 2)[1:-1]
    volumes = _volumes(triangles, points, axis, positions)
    k = int(volumes.argmin())
    return float(volumes[k]), axis, float(positions[k])


def _clipped(triangles: Array, axis: int, position: float, side: float) -> Array:
    """Return what of triangles lies on a side of a plane, in triangles (M, 3, 3)."""
    height = side * (triangles[:, :, axis] - position)
    inside = height <= 0.0
    count = inside.sum(axis=1)
    kept = [triangles[count == 3]]
    for lone in (1, 2):
        chosen = count == lone
        # Turn each so that its first corner is on the other side than both others.
        first = (inside[chosen] == (lone == 1)).argmax(axis=1)
        order = (first[:, np.newaxis] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(triangles[chosen], order[:, :, np.newaxis], 1).swapaxes(0, 1)
        ab, ac = (_crossing(a, end, axis, position) for end in (b, c))
        found = [(a, ab, ac)] if lone == 1 else [(ab, b, c), (ab, c, ac)]
        kept += [np.stack(corners, axis=1) for corners in found]
    return np.vstack(kept)


def _crossing(a: Array, b: Array, axis: int, position: float) -> Array:
    """Return where segments (N, 3) that end on both sides of a plane meet it."""
    share = (position - a[:, axis]) / (b[:, axis] - a[:, axis])
    crossing = a + share[:, np.newaxis] * (b - a)
    crossing[:, axis] = position
    return np.asarray(crossing)


def _volumes(triangles: Array, points: Array, axis: int, positions: Array) -> Array:
    """Return about the sum of both hulls' volumes for cuts at each position."""
    a, b = triangles.reshape(-1, 3), triangles[:, [1, 2, 0]].reshape(-1, 3)
    low, high = np.minimum(a, b)[:, axis], np.maximum(a, b)[:, axis]
    rings = [
        _crossing(a[crosses], b[crosses], axis, position)
        for position in positions
        for crosses in [(low < position) & (position < high)]
    ]
    slab = np.searchsorted(positions, points[:, axis])
    slabs = [points[slab == k] for k in range(len(positions) + 1)]
    below = _growing(slabs[:-1], rings)
    above = _growing(slabs[:0:-1], rings[::-1])
    return np.add(below, above[::-1])


def _growing(slabs: list[Array], rings: list[Array]) -> list[float]:
    """Return about the volume of the hull of the first slabs, each with the ring that ends it."""
    volumes, extreme = [], np.empty((0, 3))
    for slab, ring in zip(slabs, rings, strict=True):
        extreme = np.vstack([extreme, slab, ring])
        if len(extreme) > 0:
            extreme = extreme[np.unique((extreme @ _DIRECTIONS).argmax(axis=0))]
        volumes.append(_hull(extreme)[1])
    return volumes


def _hull(points: Array) -> tuple[Array, float]:
    """Return the corners of a hull and its volume; infinite for points in one plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return points, np.inf
    is_corner = np.zeros(len(points), dtype=bool)
    is_corner[hull.simplices] = True
    return points[is_corner], float(hull.volume)


def _inner_corners(mesh: Array, planes: Array, known: Array) -> Array:
    """Return where three planes meet (M, 3), on the right side of all and inside of a mesh.

    Those in the hull of known corners, which they would not change, are left out.
    """
    slack = _TOLERANCE * float(np.abs(mesh).max())
    triples = [planes[list(three)] for three in combinations(range(len(planes)), 3)]
    meet = [np.linalg.solve(t[:, :3], t[:, 3]) for t in triples if np.linalg.det(t[:, :3]) != 0.0]
    corners = np.array(meet).reshape(-1, 3)
    corners = corners[(corners @ planes[:, :3].T <= planes[:, 3] + slack).all(axis=1)]
    if len(corners) > 0:
        corners = corners[_are_outside(corners, known)]
    return corners[[abs(winding_number(mesh, corner)) > _INSIDE for corner in corners]]


def _are_outside(points: Array, corners: Array) -> NDArray[np.bool_]:
    """Return which points are not in the hull of corners; all if that has no volume."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        faces = ConvexHull(corners).equations
    except (QhullError, ValueError):
        return np.ones(len(points), dtype=np.bool_)
    return np.asarray((points @ faces[:, :3].T + faces[:, 3] > 0.0).any(axis=1))


def winding_number(mesh: Array, point: Array) -> float:
    """Return how often triangles (N, 3, 3) wind around a point (3,): 0 outside of a closed mesh."""
    a, b, c = (mesh - point).swapaxes(0, 1)
    la, lb, lc = (np.sqrt(np.einsum("ij,ij->i", edge, edge)) for edge in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", x, y) * z for x, y, z in ((a, b, lc), (b, c, la), (c, a, lb))]
    return float(np.arctan2(volume, la * lb * lc + sum(dots)).sum() / (2.0 * np.pi))
