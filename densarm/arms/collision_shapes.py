"""Collision shapes of an arm: what distances are differentiated of, capsules fitted and inertia."""

from collections.abc import Iterable
from itertools import product
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.errors import RobotDescriptionError
from densarm.scene.shapes import (
    FARTHEST,
    LARGEST,
    box_hull,
    circumscribed_cylinder,
    convex_hull,
)
from densarm.values.arrays import Array

# [m], agreement of a cylinder's ends with the spheres on them: URDFs write 1.57 for a right angle.
_CAPSULE_TOLERANCE = 1e-4

# Per size of the body: by which the solver may miss a point, and the capsule exceeds the farthest.
_TIGHTNESS = 1e-6

_THICKNESS = 1e-3  # [m] of what has none
_NOTHING = 1e-6  # per longest side, below which a body has no hull

_ROUNDS = 100
_SMALL = 1e-12  # keeps quotients of zero by zero at zero


def differentiable_geometry(
    model: pin.Model, geometry: pin.GeometryModel, shapes: str = "hull"
) -> pin.GeometryModel:
    """Return shapes whose distance coal differentiates, for the geometry that a URDF gives.

    Spheres and capsules stay; a cylinder with an equal sphere on each end becomes one capsule, a
    box or a mesh its convex hull, any other cylinder a circumscribed prism. Each encloses what it
    stands for. For shapes "capsule", the smallest capsule around each hull takes its place.
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


def thicken_flat_shapes(model: pin.Model, geometry: pin.GeometryModel) -> tuple[str, ...]:
    """Give shapes without thickness, stickers say, 1 mm of it, and return what was done.

    A distance has no gradient inside of what has no inside. Each encloses what it stands for.
    """
    remarks = []
    for item in geometry.geometryObjects:
        link, shape = model.frames[item.parentFrame].name, item.geometry
        thick = _thickened(shape, f"collision mesh {item.name!r} of link {link!r}")
        if thick is not shape:
            item.geometry = thick
            remarks.append(f"collision geometry {item.name!r} of link {link!r} is flat: 1 mm thick")
    return tuple(remarks)


def filled_links(
    model: pin.Model, geometry: pin.GeometryModel, density: float
) -> dict[int, pin.Inertia]:
    """Return the inertia of each link's shapes in its joint's frame, by the link's frame.

    Shapes are those that a URDF gives, meshes filled to their hull, of a density [kg/m³].
    """
    by_link: dict[int, list[pin.GeometryObject]] = {}
    for item in geometry.geometryObjects:
        by_link.setdefault(item.parentFrame, []).append(item)
    filled = {}
    for frame, items in by_link.items():
        solid = _merge_capsules(items)
        for item in solid:
            if isinstance(item.geometry, coal.BVHModelBase):
                item.geometry = _differentiable_shape(item, model.frames[frame].name)
        filled[frame] = _filled(solid, density)
    return filled


def evenly_filled(items: Iterable[pin.GeometryObject], mass: float) -> pin.Inertia:
    """Return the inertia of a mass [kg] that is spread evenly over the volume of shapes."""
    total = _filled(items, 1.0)
    return pin.Inertia(mass, total.lever, mass / total.mass * total.inertia)


def _filled(items: Iterable[pin.GeometryObject], density: float) -> pin.Inertia:
    total = pin.Inertia.Zero()
    for item in items:
        shape = item.geometry
        turning = np.array(shape.computeMomentofInertiaRelatedToCOM())
        symmetric = 0.5 * density * (turning + turning.T)
        mass = density * shape.computeVolume()
        total += item.placement.act(pin.Inertia(mass, np.array(shape.computeCOM()), symmetric))
    return total


class FittedCapsule(NamedTuple):
    """The points within a radius of a segment."""

    start: Array
    """One end of the segment (3,) [m]."""
    end: Array
    """The other end (3,) [m]."""
    radius: float
    """[m]."""

    @property
    def volume(self) -> float:
        """Volume of the capsule [m³]."""
        length = float(np.linalg.norm(self.end - self.start))
        return np.pi * self.radius**2 * (length + 4.0 / 3.0 * self.radius)

    def shape(self) -> tuple[coal.Capsule, pin.SE3]:
        """Return coal's capsule, whose axis is z, and its placement."""
        axis = self.end - self.start
        # Closed forms for capsules divide by the length.
        length = max(float(np.linalg.norm(axis)), 1e-3 * self.radius)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis / length).matrix()
        return coal.Capsule(self.radius, length), pin.SE3(turn, 0.5 * (self.start + self.end))


def fitted_capsule(points: Array) -> FittedCapsule:
    """Return a smallest capsule around points (N, 3) [m], and so around their convex hull.

    The volume π r² (‖b - a‖ + 4r/3) is minimised over the ends a, b of the axis and the radius
    r, with every point within r of the axis, from one start along each principal axis. The starts
    compete on the points farthest along some directions; then the best is made to enclose all.
    """
    centre = points.mean(axis=0)
    scale = float(np.abs(points - centre).max())
    unit = (points - centre) / scale
    chosen = _farthest_along_directions(unit)
    found = [_smallest(unit[chosen], *ends) for ends in _starts(unit)]
    best = _enclosing(unit, chosen, min(found, key=lambda capsule: capsule.volume))
    start, end = centre + scale * np.array([best.start, best.end])
    return FittedCapsule(start, end, scale * best.radius)


def _require_usual_size(item: pin.GeometryObject, link: str) -> None:
    keys, shape = ("radius", "halfLength", "halfSide"), item.geometry
    sizes = [getattr(shape, key) for key in keys if hasattr(shape, key)]
    numbers = np.hstack([*sizes, item.placement.translation])
    reason = "a size that is not positive" if not (numbers[:-3] > 0.0).all() else ""
    if not (np.abs(numbers[:-3]) <= LARGEST).all():
        reason = "a size that is not finite, or above 1 km"
    if not (np.abs(item.placement.translation) < FARTHEST).all():
        reason = "a position that is not finite, or beyond 1000 km"
    if reason:
        raise RobotDescriptionError(
            f"collision geometry {item.name!r} of link {link!r} has {reason}"
        )


def _thickened(shape: coal.CollisionGeometry, name: str) -> coal.CollisionGeometry:
    """Return a shape, or where it has no thickness one that encloses it and has."""
    if isinstance(shape, coal.Box):
        sides = _at_least_thin(2.0 * shape.halfSide)
        return shape if (sides == 2.0 * shape.halfSide).all() else coal.Box(sides)
    if isinstance(shape, coal.Cylinder | coal.Capsule):
        radius, length = shape.radius, 2.0 * shape.halfLength
        sides = _at_least_thin(np.array([2.0 * radius, length]))
        same = (sides == [2.0 * radius, length]).all()
        return shape if same else type(shape)(0.5 * sides[0], sides[1])
    if isinstance(shape, coal.BVHModelBase):
        vertices = np.array(shape.vertices())
        try:
            convex_hull(vertices, name)
        except RobotDescriptionError:
            cube = list(product((-0.5 * _THICKNESS, 0.5 * _THICKNESS), repeat=3))
            return convex_hull((vertices[:, np.newaxis] + cube).reshape(-1, 3), name)
    return shape


def _at_least_thin(sides: Array) -> Array:
    """Return sides [m], those that are as nothing beside the longest 1 mm long."""
    return np.where((sides >= 0.0) & (sides <= _NOTHING * sides.max()), _THICKNESS, sides)


def _differentiable_shape(item: pin.GeometryObject, link: str) -> coal.CollisionGeometry:
    shape = item.geometry
    if isinstance(shape, coal.Sphere | coal.Capsule | coal.ConvexBase):
        return shape
    if isinstance(shape, coal.Box):
        return box_hull(2.0 * shape.halfSide)
    if isinstance(shape, coal.Cylinder):
        return circumscribed_cylinder(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.BVHModelBase):
        return convex_hull(shape.vertices(), f"collision mesh {item.name!r} of link {link!r}")
    raise RobotDescriptionError(
        f"collision geometry {item.name!r} of link {link!r} is a {type(shape).__name__}, whose "
        "distance has no reliable gradient: use a sphere, box, capsule, cylinder or mesh"
    )


def _merge_capsules(items: list[pin.GeometryObject]) -> list[pin.GeometryObject]:
    """Return copies of the items, one capsule for each cylinder and the spheres on its ends."""
    spheres = [item for item in items if isinstance(item.geometry, coal.Sphere)]
    merged = {item.name: item.copy() for item in items}
    for cylinder in (item for item in items if isinstance(item.geometry, coal.Cylinder)):
        radius, half = cylinder.geometry.radius, cylinder.geometry.halfLength
        ends = [cylinder.placement.act(np.array([0.0, 0.0, z])) for z in (-half, half)]
        caps = [_cap(spheres, end, radius) for end in ends]
        excess = max(caps)[0]
        if excess <= _CAPSULE_TOLERANCE:
            merged[cylinder.name].geometry = coal.Capsule(radius + excess, 2.0 * half)
            for _, name in caps:
                merged.pop(name, None)
    return list(merged.values())


def _cap(spheres: list[pin.GeometryObject], end: Array, radius: float) -> tuple[float, str]:
    """Return by how much the best sphere for the end of a capsule misses it [m], and its name."""
    caps = [(np.inf, "")]
    for ball in spheres:
        offset = float(np.linalg.norm(ball.placement.translation - end))
        caps.append((offset + abs(ball.geometry.radius - radius), ball.name))
    return min(caps)


def _farthest_along_directions(points: Array) -> NDArray[np.bool_]:
    directions = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    length = np.maximum(np.linalg.norm(directions, axis=1), 1.0)
    chosen = np.zeros(len(points), dtype=bool)
    chosen[(points @ (directions / length[:, np.newaxis]).T).argmax(axis=0)] = True
    return chosen


def _starts(points: Array) -> list[tuple[Array, Array]]:
    """Return a segment along each principal axis, shortened by half the width across it."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    segments = []
    for axis in axes:
        along = points @ axis
        across = np.linalg.norm(points - np.outer(along, axis), axis=1).max()
        half = max(0.5 * np.ptp(along) - 0.5 * across, 0.05 * np.ptp(along))
        middle = 0.5 * (along.max() + along.min()) * axis
        segments.append((middle - half * axis, middle + half * axis))
    return segments


def _enclosing(points: Array, chosen: NDArray[np.bool_], capsule: FittedCapsule) -> FittedCapsule:
    """Return the optimum around all points; few touch it, so few are given to the solver."""
    for _ in range(_ROUNDS):
        distance = _distances(points, capsule.start, capsule.end)
        outside = (distance > capsule.radius + _TIGHTNESS) & ~chosen
        if not outside.any():
            break
        chosen = chosen | (distance >= np.sort(distance[outside])[-5:][0])
        capsule = _smallest(points[chosen], capsule.start, capsule.end)
    distance = _distances(points, capsule.start, capsule.end)
    return capsule._replace(radius=float(distance.max()) + _TIGHTNESS)


def _smallest(points: Array, start: Array, end: Array) -> FittedCapsule:
    """Return a locally smallest capsule around few points."""
    from scipy.optimize import minimize

    def volume(x: Array) -> float:
        return float(x[6] ** 2 * (np.linalg.norm(x[3:6] - x[:3]) + 4.0 / 3.0 * x[6]))

    def volume_gradient(x: Array) -> Array:
        axis, radius = x[3:6] - x[:3], x[6]
        length = float(np.linalg.norm(axis))
        along = radius**2 * axis / max(length, _SMALL)
        return np.array([*-along, *along, 2.0 * radius * length + 4.0 * radius**2])

    def slack(x: Array) -> Array:
        return np.asarray(x[6] - _distances(points, x[:3], x[3:6]))

    def slack_gradient(x: Array) -> Array:
        fraction, offset = _nearest(points, x[:3], x[3:6])
        normal = offset / np.maximum(np.linalg.norm(offset, axis=1), _SMALL)[:, np.newaxis]
        share = fraction[:, np.newaxis]
        return np.hstack([normal * (1.0 - share), normal * share, np.ones_like(share)])

    result = minimize(
        volume,
        np.array([*start, *end, _distances(points, start, end).max()]),
        jac=volume_gradient,
        constraints={"type": "ineq", "fun": slack, "jac": slack_gradient},
        method="SLSQP",
        options={"ftol": 1e-8},
    )
    return FittedCapsule(result.x[:3], result.x[3:6], float(result.x[6]))


def _nearest(points: Array, a: Array, b: Array) -> tuple[Array, Array]:
    """Return the fraction (N,) of the segment nearest to each point, and the way (N, 3) from it."""
    axis = b - a
    fraction = np.clip((points - a) @ axis / max(float(axis @ axis), _SMALL), 0.0, 1.0)
    return fraction, points - a - np.outer(fraction, axis)


def _distances(points: Array, a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(_nearest(points, a, b)[1], axis=1))
