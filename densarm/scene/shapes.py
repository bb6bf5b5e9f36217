"""Convex shapes whose distance coal can differentiate, and the points that span them."""

from functools import lru_cache
from itertools import product

import coal
import numpy as np
from numpy.typing import ArrayLike

from densarm.errors import RobotDescriptionError
from densarm.values.arrays import Array

CYLINDER_SIDES = 64
"""Sides of the prism that stands for a cylinder; it exceeds the radius by 0.12 %."""

LARGEST = 1e3
"""No point of a shape lies farther than this along an axis from its own origin [m].

coal's distances to needles of 10 km are wrong, and to cubes of 1000 km at times -1.8e308 m.
"""

FARTHEST = 1e6
"""No obstacle, shape or joint is placed as far away as this [m]."""

_FLATNESS = 1e-6  # thickness, over the largest coordinate, of points that count as in one plane
_THINNEST = 1e-9  # [m], likewise of points however near; of 1e-300 m Qhull ends the process
_CELLS = 64  # along each side of a mesh whose hull is too fine for coal
_KEPT = 8192  # hulls, the last ones asked for


def convex_hull(points: ArrayLike, name: str = "the set of points") -> coal.ConvexBase:
    """Return the convex hull of points (N, 3) [m]: for the same ones again, the same hull.

    Raises:
        RobotDescriptionError: the points, called by the name, span no volume.
    """
    return _hull(np.ascontiguousarray(points, dtype=np.float64).tobytes(), name)


def box_hull(size: ArrayLike) -> coal.ConvexBase:
    """Return a box of full side lengths x y z [m] as the convex hull of its corners."""
    # Between coal's own boxes, less than 1 µm from touching and with faces nearly parallel,
    # distances err by up to the size of the box, in both directions; those of hulls do not.
    return convex_hull(np.array(list(product((-0.5, 0.5), repeat=3))) * np.asarray(size))


def circumscribed_cylinder(radius: float, length: float) -> coal.ConvexBase:
    """Return a prism that encloses the cylinder [m] along z with the same two ends."""
    ends = [circumscribed_circle(radius, z) for z in (-length / 2, length / 2)]
    return convex_hull(np.vstack(ends))


def circumscribed_circle(radius: float, height: float) -> Array:
    """Return the corners (64, 3) of a regular polygon around a circle about the z axis [m]."""
    angle = 2.0 * np.pi * np.arange(CYLINDER_SIDES) / CYLINDER_SIDES
    corner = radius / np.cos(np.pi / CYLINDER_SIDES)
    return np.column_stack(
        [corner * np.cos(angle), corner * np.sin(angle), np.full(CYLINDER_SIDES, height)]
    )


def extreme_points(shape: coal.CollisionGeometry) -> tuple[Array, float]:
    """Return points (N, 3) and r [m]: the convex hull of balls r around them is the shape.

    It is a sphere, capsule or convex hull, and the points are in its frame.
    """
    if isinstance(shape, coal.Sphere):
        return np.zeros((1, 3)), shape.radius
    if isinstance(shape, coal.Capsule):
        return np.array([[0.0, 0.0, -shape.halfLength], [0.0, 0.0, shape.halfLength]]), shape.radius
    return np.array(shape.points()), 0.0


@lru_cache(maxsize=_KEPT)
def _hull(content: bytes, name: str) -> coal.ConvexBase:
    points = np.frombuffer(content).reshape(-1, 3)
    # coal ends the process when it meets points that are not finite or that lie in one plane.
    if not (np.abs(points) <= LARGEST).all():
        reason = "has vertices that are not finite, or beyond 1 km from its origin"
        raise RobotDescriptionError(f"{name} {reason}: is its unit right?")
    thinnest = max(_THINNEST, _FLATNESS * np.abs(points).max(initial=0.0))
    if len(points) < 4 or _thickness(points) <= thinnest:
        raise RobotDescriptionError(f"{name} has no convex hull: its vertices span no volume")
    try:
        return _qhull(points)
    except RuntimeError:  # coal takes 255 neighbours of a corner; a round face can have more
        return _qhull(_coarsened(points))


def _thickness(points: Array) -> float:
    thin = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    return float(np.ptp(points @ thin))


def _qhull(points: Array) -> coal.ConvexBase:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(0, len(points))
    mesh.addVertices(points)
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def _coarsened(points: Array) -> Array:
    """Return the corners of a grid's cells that hold the points; they enclose them."""
    low = points.min(axis=0)
    cell = (points.max(axis=0) - low) / _CELLS
    corners = np.floor((points - low) / cell)[:, np.newaxis] + list(product((0.0, 1.0), repeat=3))
    return np.asarray(low + cell * np.unique(corners.reshape(-1, 3), axis=0))
