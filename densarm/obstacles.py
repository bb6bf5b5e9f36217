"""Obstacles: named bodies at fixed poses, as frozen values."""

import math
from dataclasses import dataclass
from typing import Any, Protocol

import coal
import numpy as np
import pinocchio as pin

from densarm.errors import InvalidValueError
from densarm.shapes import box_hull, circumscribed_cylinder
from densarm.validation import finite_number, finite_tuple, positive, unit_quaternion

Vector3 = tuple[float, ...]


class Obstacle(Protocol):
    """A named body at a fixed pose, the union of convex shapes."""

    @property
    def name(self) -> str:
        """Name, unique in its scene."""

    @property
    def position(self) -> Vector3:
        """Origin of the body's frame [m]."""

    @property
    def orientation_xyzw(self) -> tuple[float, ...]:
        """Unit quaternion x y z w of the body's frame."""

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the shapes, in the body's frame, whose distances coal differentiates."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """What every obstacle has: a name and a pose.

    Raises:
        InvalidValueError: no name, a number that is not finite, or no unit quaternion.
    """

    name: str
    position: Vector3 = (0.0, 0.0, 0.0)
    """Origin of the body's frame in the world, or in the frame of the link that holds it [m]."""
    orientation_xyzw: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0)
    """Unit quaternion x y z w of that frame."""

    def __post_init__(self) -> None:
        name = self.name
        if not isinstance(name, str) or not name:
            raise InvalidValueError("obstacle name", name, "a non-empty string")
        quaternion = unit_quaternion(f"{name}.orientation_xyzw", self.orientation_xyzw)
        store(
            self,
            position=finite_tuple(f"{name}.position", self.position, 3),
            orientation_xyzw=quaternion,
        )


@dataclass(frozen=True, kw_only=True)
class Sphere(Body):
    """A ball.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    radius: float
    """Radius [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _store_sizes(self, "radius")

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return coal's sphere."""
        return (coal.Sphere(self.radius),)


@dataclass(frozen=True, kw_only=True)
class Box(Body):
    """A box with full side lengths along its own axes, its origin in the middle.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    size: Vector3
    """Full side lengths x y z [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        size = finite_tuple(f"{self.name}.size", self.size, 3)
        store(self, size=tuple(positive(f"{self.name}.size", side) for side in size))

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the hull of the corners, since coal's box errs where it nearly touches another."""
        return (box_hull(self.size),)


@dataclass(frozen=True, kw_only=True)
class Capsule(Body):
    """A cylinder along its own z axis with a half ball on each end, its origin in the middle.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    radius: float
    """Radius [m]."""
    length: float
    """Length between the centres of the half balls [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _store_sizes(self, "radius", "length")

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return coal's capsule."""
        return (coal.Capsule(self.radius, self.length),)


@dataclass(frozen=True, kw_only=True)
class Cylinder(Body):
    """A cylinder along its own z axis; distances are to a circumscribed 64-sided prism.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    radius: float
    """Radius [m]."""
    length: float
    """Length [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _store_sizes(self, "radius", "length")

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the circumscribed prism, since coal's cylinder has no reliable gradient."""
        return (circumscribed_cylinder(self.radius, self.length),)


@dataclass(frozen=True, kw_only=True)
class HalfSpace(Body):
    """All points x of its frame with normal · x <= offset: a floor or a wall without end.

    The floor z <= 0 by default. As with every obstacle, links that no joint moves may touch it.

    Raises:
        InvalidValueError: a normal of length zero, or a number that is not finite.
    """

    normal: Vector3 = (0.0, 0.0, 1.0)
    """Direction from the solid into the free space; scaled to length one."""
    offset: float = 0.0
    """Distance of the surface from the frame's origin, along the normal [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        normal = np.array(finite_tuple(f"{self.name}.normal", self.normal, 3))
        length = math.hypot(*normal)
        if not 1e-6 < length < 1e6:
            raise InvalidValueError(f"{self.name}.normal", self.normal, "a direction, not zero")
        # Scaling once more would change the last digit of what is already of unit length.
        unit = normal / length if abs(length - 1.0) > 1e-12 else normal
        offset = finite_number(f"{self.name}.offset", self.offset)
        store(self, normal=tuple(unit.tolist()), offset=offset)

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return coal's half-space."""
        return (coal.Halfspace(np.array(self.normal), self.offset),)


def obstacle_pose(obstacle: Obstacle) -> pin.SE3:
    """Return the pose of an obstacle's frame."""
    return pin.XYZQUATToSE3(np.array([*obstacle.position, *obstacle.orientation_xyzw]))


def geometry_objects(
    obstacle: Obstacle, joint: int = 0, frame: int = 0, placement: pin.SE3 | None = None
) -> list[pin.GeometryObject]:
    """Return an obstacle's convex shapes as Pinocchio's geometry objects.

    A body of one shape gives its name; of several, the name, a dot and the shape's number.

    Args:
        obstacle: the body.
        joint: index of the joint that carries it; 0 for the world.
        frame: index of the frame that holds it.
        placement: pose of that frame against the joint; None for none.
    """
    shapes = obstacle.convex_shapes()
    one = len(shapes) == 1
    names = [obstacle.name if one else f"{obstacle.name}.{k}" for k in range(len(shapes))]
    pose = obstacle_pose(obstacle) if placement is None else placement * obstacle_pose(obstacle)
    return [
        pin.GeometryObject(name, joint, frame, pose, shape)
        for name, shape in zip(names, shapes, strict=True)
    ]


def store(body: Any, **values: Any) -> None:
    """Set fields of a frozen obstacle that is being made."""
    for field, value in values.items():
        object.__setattr__(body, field, value)


def _store_sizes(body: Any, *sizes: str) -> None:
    store(body, **{key: positive(f"{body.name}.{key}", getattr(body, key)) for key in sizes})
