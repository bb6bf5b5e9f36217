"""Collision shapes whose distance coal can differentiate, and what becomes of the others."""

import coal
import numpy as np
import pinocchio as pin

from densarm.arrays import Array
from densarm.errors import RobotDescriptionError

CYLINDER_SIDES = 64
"""Sides of the prism that stands for a cylinder; it exceeds the radius by 0.12 %."""

_CAPSULE_TOLERANCE = 1e-6  # [m], agreement of a cylinder's ends with the spheres on them


def convex_hull(points: Array) -> coal.ConvexBase:
    """Return the convex hull of points.

    Args:
        points: (N, 3) [m], not all in one plane.

    Raises:
        RobotDescriptionError: the points span no volume.
    """
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(0, len(points))
    mesh.addVertices(np.asarray(points, dtype=np.float64))
    mesh.endModel()
    return _hull_of_mesh(mesh)


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


def differentiable_geometry(model: pin.Model, geometry: pin.GeometryModel) -> pin.GeometryModel:
    """Return a geometry model of shapes whose distance coal differentiates.

    Spheres, boxes, capsules and convex hulls stay; a mesh becomes its convex hull, a cylinder
    with an equal sphere on each end one capsule, any other cylinder a circumscribed prism.

    Args:
        model: the arm's model, whose frames name the links.
        geometry: its collision geometry as the URDF gives it.

    Raises:
        RobotDescriptionError: a shape of another kind (ellipsoid, cone, plane, ...), by name.
    """
    result = pin.GeometryModel()
    by_link: dict[int, list[pin.GeometryObject]] = {}
    for item in geometry.geometryObjects:
        by_link.setdefault(item.parentFrame, []).append(item)
    for frame, items in by_link.items():
        for item in _merge_capsules(items):
            item.geometry = _differentiable_shape(item, model.frames[frame].name)
            item.meshScale = np.ones(3)
            result.addGeometryObject(item)
    return result


def extreme_points(shape: coal.CollisionGeometry) -> tuple[Array, float]:
    """Return points and a radius r: the shape lies in the convex hull of balls r around them.

    Args:
        shape: a sphere, box, capsule or convex hull.

    Returns:
        The points (N, 3) in the shape's frame [m], and r [m].
    """
    if isinstance(shape, coal.Sphere):
        return np.zeros((1, 3)), shape.radius
    if isinstance(shape, coal.Capsule):
        return np.array([[0.0, 0.0, -shape.halfLength], [0.0, 0.0, shape.halfLength]]), shape.radius
    if isinstance(shape, coal.Box):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
        return signs * np.asarray(shape.halfSide), 0.0
    return np.array([shape.point(i) for i in range(shape.num_points)]), 0.0


def _differentiable_shape(item: pin.GeometryObject, link: str) -> coal.CollisionGeometry:
    shape = item.geometry
    if isinstance(shape, coal.Sphere | coal.Box | coal.Capsule | coal.ConvexBase):
        return shape
    if isinstance(shape, coal.Cylinder):
        return circumscribed_cylinder(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.BVHModelBase):
        return _hull_of_mesh(shape, item.name)
    raise RobotDescriptionError(
        f"collision geometry {item.name!r} of link {link!r} is a {type(shape).__name__}, whose "
        "distance has no reliable gradient: use a sphere, box, capsule, cylinder or mesh"
    )


def _hull_of_mesh(mesh: coal.BVHModelBase, name: str = "points") -> coal.ConvexBase:
    try:
        mesh.buildConvexHull(True, "Qt")
    except RuntimeError:
        raise RobotDescriptionError(
            f"collision mesh {name!r} has no convex hull: its vertices span no volume"
        ) from None
    return mesh.convex


def _merge_capsules(items: list[pin.GeometryObject]) -> list[pin.GeometryObject]:
    """Replace each cylinder and the two equal spheres on its ends by one capsule."""
    spheres = [item for item in items if isinstance(item.geometry, coal.Sphere)]
    merged: list[pin.GeometryObject] = []
    used: set[str] = set()
    for item in items:
        if not isinstance(item.geometry, coal.Cylinder):
            continue
        caps = [_sphere_at_end(item, sign, spheres) for sign in (-1.0, 1.0)]
        if all(caps):
            used |= {item.name, *(cap.name for cap in caps if cap)}
            shape = coal.Capsule(item.geometry.radius, 2.0 * item.geometry.halfLength)
            merged.append(
                pin.GeometryObject(
                    item.name, item.parentJoint, item.parentFrame, item.placement, shape
                )
            )
    return [item.copy() for item in items if item.name not in used] + merged


def _sphere_at_end(
    cylinder: pin.GeometryObject, sign: float, spheres: list[pin.GeometryObject]
) -> pin.GeometryObject | None:
    end = cylinder.placement.act(np.array([0.0, 0.0, sign * cylinder.geometry.halfLength]))
    for sphere in spheres:
        offset = np.linalg.norm(sphere.placement.translation - end)
        excess = abs(sphere.geometry.radius - cylinder.geometry.radius)
        if offset + excess <= _CAPSULE_TOLERANCE:
            return sphere
    return None
