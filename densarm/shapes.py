"""Collision shapes whose distance coal can differentiate, and what becomes of the others."""

from functools import lru_cache
from itertools import product

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.errors import RobotDescriptionError
from densarm.fitted_capsule import fitted_capsule

CYLINDER_SIDES = 64
"""Sides of the prism that stands for a cylinder; it exceeds the radius by 0.12 %."""

# [m], agreement of a cylinder's ends with the spheres on them: URDFs write 1.57 for a right angle.
_CAPSULE_TOLERANCE = 1e-4

_FLATNESS = 1e-6  # thickness, over the largest coordinate, of points that count as in one plane
_FARTHEST = 1e6  # [m]
_CELLS = 64  # along each side of a mesh whose hull is too fine for coal
_KEPT = 512  # hulls of boxes and cylinders, the last ones made


def convex_hull(points: Array) -> coal.ConvexBase:
    """Return the convex hull of points.

    Args:
        points: (N, 3) [m], not all in one plane.

    Raises:
        RobotDescriptionError: the points span no volume.
    """
    return _hull(np.asarray(points, dtype=np.float64), "the set of points")


@lru_cache(maxsize=_KEPT)
def circumscribed_cylinder(radius: float, length: float) -> coal.ConvexBase:
    """Return a prism that encloses the cylinder along z with the same two ends.

    Args:
        radius: of the cylinder [m].
        length: of the cylinder [m].
    """
    angle = 2.0 * np.pi * np.arange(CYLINDER_SIDES) / CYLINDER_SIDES
    corner = radius / np.cos(np.pi / CYLINDER_SIDES)
    ring = np.column_stack([corner * np.cos(angle), corner * np.sin(angle)])
    ends = [np.column_stack([ring, np.full(CYLINDER_SIDES, z)]) for z in (-length / 2, length / 2)]
    return convex_hull(np.vstack(ends))


def box_hull(size: ArrayLike) -> coal.ConvexBase:
    """Return a box as the convex hull of its corners.

    Between coal's own boxes, less than 1 µm from touching and with faces nearly parallel,
    distances err by up to the size of the box, in both directions; those of hulls do not.

    Args:
        size: full side lengths x y z [m].
    """
    return _box_hull(*np.asarray(size, dtype=np.float64).tolist())


def differentiable_geometry(
    model: pin.Model, geometry: pin.GeometryModel, shapes: str = "hull"
) -> pin.GeometryModel:
    """Return a geometry model of shapes whose distance coal differentiates.

    Spheres and capsules stay; a cylinder with an equal sphere on each end becomes one capsule, a
    box or a mesh its convex hull, any other cylinder a circumscribed prism. Each encloses what it
    stands for.

    Args:
        model: the arm's model, whose frames name the links.
        geometry: its collision geometry as the URDF gives it.
        shapes: "capsule" puts the smallest capsule around each hull; "hull" leaves them.

    Raises:
        RobotDescriptionError: a shape of another kind (ellipsoid, cone, plane, ...), of a size
            that is not positive, farther away than 1000 km, or a mesh without volume; by name.
    """
    result = pin.GeometryModel()
    by_link: dict[int, list[pin.GeometryObject]] = {}
    for item in geometry.geometryObjects:
        _require_usual_size(item, model.frames[item.parentFrame].name)
        by_link.setdefault(item.parentFrame, []).append(item)
    for frame, items in by_link.items():
        for item in _merge_capsules(items):
            item.geometry = _differentiable_shape(item, model.frames[frame].name)
            item.meshScale = np.ones(3)
            if shapes == "capsule" and isinstance(item.geometry, coal.ConvexBase):
                item.geometry, pose = fitted_capsule(np.array(item.geometry.points())).shape()
                item.placement = item.placement * pose
            result.addGeometryObject(item)
    return result


def extreme_points(shape: coal.CollisionGeometry) -> tuple[Array, float]:
    """Return points and a radius r: the shape lies in the convex hull of balls r around them.

    Args:
        shape: a sphere, capsule or convex hull.

    Returns:
        The points (N, 3) in the shape's frame [m], and r [m].
    """
    if isinstance(shape, coal.Sphere):
        return np.zeros((1, 3)), shape.radius
    if isinstance(shape, coal.Capsule):
        return np.array([[0.0, 0.0, -shape.halfLength], [0.0, 0.0, shape.halfLength]]), shape.radius
    return np.array(shape.points()), 0.0


def _require_usual_size(item: pin.GeometryObject, link: str) -> None:
    sizes = np.array(_sizes(item.geometry))
    numbers = np.array([*sizes, *item.placement.translation])
    reason = "a size that is not positive" if not (sizes > 0.0).all() else ""
    if not (np.abs(numbers) < _FARTHEST).all():
        reason = "a size or position that is not finite, or beyond 1000 km"
    if reason:
        raise RobotDescriptionError(
            f"collision geometry {item.name!r} of link {link!r} has {reason}"
        )


def _differentiable_shape(item: pin.GeometryObject, link: str) -> coal.CollisionGeometry:
    shape = item.geometry
    if isinstance(shape, coal.Sphere | coal.Capsule | coal.ConvexBase):
        return shape
    if isinstance(shape, coal.Box):
        return box_hull(2.0 * shape.halfSide)
    if isinstance(shape, coal.Cylinder):
        return circumscribed_cylinder(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.BVHModelBase):
        return _hull(shape.vertices(), f"collision mesh {item.name!r} of link {link!r}")
    raise RobotDescriptionError(
        f"collision geometry {item.name!r} of link {link!r} is a {type(shape).__name__}, whose "
        "distance has no reliable gradient: use a sphere, box, capsule, cylinder or mesh"
    )


def _sizes(shape: coal.CollisionGeometry) -> list[float]:
    if isinstance(shape, coal.Box):
        return list(shape.halfSide)
    return [getattr(shape, size) for size in ("radius", "halfLength") if hasattr(shape, size)]


def _hull(points: Array, name: str) -> coal.ConvexBase:
    # coal ends the process when it meets points that are not finite or that lie in one plane.
    if not (np.abs(points) < _FARTHEST).all():
        raise RobotDescriptionError(f"{name} has vertices that are not finite, or beyond 1000 km")
    if _is_flat(points):
        raise RobotDescriptionError(f"{name} has no convex hull: its vertices span no volume")
    try:
        return _qhull(points)
    except RuntimeError:  # coal takes 255 neighbours of a corner; a round face can have more
        return _qhull(_coarsened(points))


@lru_cache(maxsize=_KEPT)
def _box_hull(x: float, y: float, z: float) -> coal.ConvexBase:
    return convex_hull(np.array(list(product((-0.5, 0.5), repeat=3))) * [x, y, z])


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


def _is_flat(points: Array) -> bool:
    if len(points) < 4:
        return True
    thin = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    return bool(np.ptp(points @ thin) <= _FLATNESS * np.abs(points).max())


def _merge_capsules(items: list[pin.GeometryObject]) -> list[pin.GeometryObject]:
    """Return copies of the items, one capsule for each cylinder and the spheres on its ends."""
    spheres = [item for item in items if isinstance(item.geometry, coal.Sphere)]
    capsules: dict[str, coal.Capsule] = {}
    used: set[str] = set()
    for item in items:
        caps = _caps(item, spheres) if isinstance(item.geometry, coal.Cylinder) else None
        if caps is not None:
            excess = max(mismatch for _, mismatch in caps)
            capsules[item.name] = coal.Capsule(
                item.geometry.radius + excess, 2.0 * item.geometry.halfLength
            )
            used |= {sphere for sphere, _ in caps}
    merged = [item.copy() for item in items if item.name not in used]
    for item in merged:
        item.geometry = capsules.get(item.name, item.geometry)
    return merged


def _caps(
    cylinder: pin.GeometryObject, spheres: list[pin.GeometryObject]
) -> list[tuple[str, float]] | None:
    """Return the spheres on both ends, by name, and how far each sticks out of a capsule [m]."""
    caps = []
    for sign in (-1.0, 1.0):
        end = cylinder.placement.act(np.array([0.0, 0.0, sign * cylinder.geometry.halfLength]))
        mismatches = {
            sphere.name: float(np.linalg.norm(sphere.placement.translation - end))
            + abs(sphere.geometry.radius - cylinder.geometry.radius)
            for sphere in spheres
        }
        name = min(mismatches, key=mismatches.__getitem__, default="")
        if not name or mismatches[name] > _CAPSULE_TOLERANCE:
            return None
        caps.append((name, mismatches[name]))
    return caps
