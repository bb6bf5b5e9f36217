"""Obstacles: named bodies, at a pose or in motion, as frozen values."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.errors import DensarmError, InvalidValueError
from densarm.scene.motion import FASTEST, ObstacleMotion, near_position
from densarm.scene.shapes import (
    FARTHEST,
    LARGEST,
    box_hull,
    circumscribed_cylinder,
    extreme_points,
)
from densarm.values.arrays import Array, Vector
from densarm.values.checks import (
    finite_number,
    finite_tuple,
    positive,
    positive_tuple,
    unit_quaternion,
)
from densarm.values.documented import documented

_SAME_POSE = 1e-9  # [m], and of rotation matrices


@dataclass(frozen=True, kw_only=True)
class Obstacle(ABC):
    """A named body at a pose, the union of convex shapes. Its vectors are kept as tuples.

    Raises:
        InvalidValueError: no name, a number that is not finite, no unit quaternion, a position
            1000 km away, or, of any kind of obstacle, a size that is not positive, above 1 km, or
            next to nothing beside another; a motion faster than 100 m/s or rad/s, or one that is
            elsewhere at time zero than a pose that is given.
    """

    _SIZES: ClassVar[tuple[str, ...]] = ()
    """Fields that are positive numbers."""

    name: str
    """What messages call it; one body of a scene has it."""
    position: Vector = (0.0, 0.0, 0.0)
    """Origin of the body's frame in the world, or in the frame of the link that holds it [m]."""
    orientation_xyzw: Vector = (0.0, 0.0, 0.0, 1.0)
    """Unit quaternion x y z w of that frame."""
    motion: ObstacleMotion | None = None
    """How it moves on from its pose, which is that at time zero; None if it stands."""

    def __post_init__(self) -> None:
        name = self.name
        if not isinstance(name, str) or not name:
            raise InvalidValueError("obstacle name", name, "a non-empty string")
        quaternion = unit_quaternion(f"{name}.orientation_xyzw", self.orientation_xyzw)
        position = near_position(f"{name}.position", self.position)
        self._store(position=position, orientation_xyzw=quaternion)
        for key in self._SIZES:
            size = positive(f"{name}.{key}", getattr(self, key))
            if size > LARGEST:
                raise InvalidValueError(f"{name}.{key}", size, f"at most {LARGEST:g} m")
            self._store(**{key: size})
        if self.motion is not None:
            self._begin(self.motion)

    @cached_property
    def reach(self) -> float:
        """Largest distance of a point of it from its frame's origin [m]."""
        ends = [extreme_points(shape) for shape in self.convex_shapes()]
        return max(float(np.linalg.norm(x, axis=1).max()) + radius for x, radius in ends)

    @cached_property
    def _own_pose(self) -> pin.SE3:
        return obstacle_pose(self)

    def pose_at(self, time: float) -> pin.SE3:
        """Return the pose of its frame at a time [s]."""
        if self.motion is None:
            return obstacle_pose(self)
        return self.motion.pose(time, self._own_pose)

    def velocity_at(self, time: float) -> Array:
        """Return the velocity of its frame's origin [m/s] and of its turning [rad/s] (6,)."""
        return np.zeros(6) if self.motion is None else self.motion.velocity(time, self._own_pose)

    def speed_bound(self, begin: float, end: float) -> float:
        """Return a bound on the speed of all its points between two times [m/s]."""
        if self.motion is None:
            return 0.0
        linear, angular = self.motion.speed_bounds(begin, end, self._own_pose)
        return linear + (
            angular * (self.reach + math.hypot(*self.motion.pivot)) if angular else 0.0
        )

    @abstractmethod
    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the shapes, in the body's frame, whose distances coal differentiates."""

    def _begin(self, motion: ObstacleMotion) -> None:
        """Check a motion, and take its pose at time zero."""
        name, own = f"{self.name}.motion", obstacle_pose(self)
        if not isinstance(motion, ObstacleMotion):
            raise InvalidValueError(name, motion, "an ObstacleMotion")
        bounds = motion.speed_bounds(-math.inf, math.inf, own)
        for speed, unit in zip(bounds, ("m/s", "rad/s"), strict=True):
            if not speed <= FASTEST:
                raise InvalidValueError(f"{name} [{unit}]", speed, f"at most {FASTEST:g}")
        begun = motion.pose(0.0, own)
        if begun.isApprox(own, _SAME_POSE):
            return
        for key, value in pose_fields(begun).items():
            given = getattr(self, key)
            signs = (1.0, -1.0) if key == "orientation_xyzw" else (1.0,)
            away = min(np.abs(np.subtract(given, np.multiply(x, value))).max() for x in signs)
            if away > _SAME_POSE and given != getattr(Obstacle, key):
                raise InvalidValueError(f"{self.name}.{key}", given, f"left out, or {list(value)}")
            self._store(**{key: value})

    def _require_hull(self, key: str, sizes: tuple[float, ...]) -> None:
        """Refuse by its name what is too thin or too large for a hull."""
        try:
            self.convex_shapes()
            is_usual = max(sizes) <= LARGEST
        except DensarmError:
            is_usual = False
        if not is_usual:
            allowed = f"at most {LARGEST:g} m, each above 1 nm and a millionth of the longest"
            raise InvalidValueError(f"{self.name}.{key}", sizes, allowed)

    def _store(self, **values: Any) -> None:
        """Set fields while the obstacle is being made."""
        for field, value in values.items():
            object.__setattr__(self, field, value)


@documented
@dataclass(frozen=True, kw_only=True)
class Sphere(Obstacle):
    """A ball."""

    _SIZES = ("radius",)

    radius: float
    """Radius [m]."""

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return coal's sphere."""
        return (coal.Sphere(self.radius),)


@documented
@dataclass(frozen=True, kw_only=True)
class Box(Obstacle):
    """A box with full side lengths along its own axes, its origin in the middle."""

    size: Vector
    """Full side lengths x y z [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        size = positive_tuple(f"{self.name}.size", self.size, 3)
        self._store(size=size)
        self._require_hull("size", size)

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the hull of the corners, since coal's box errs where it nearly touches another."""
        return (box_hull(self.size),)


@documented
@dataclass(frozen=True, kw_only=True)
class Capsule(Obstacle):
    """A cylinder along its own z axis with a half ball on each end, its origin in the middle."""

    _SIZES = ("radius", "length")

    radius: float
    """Radius [m]."""
    length: float
    """Length between the centres of the half balls [m]."""

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return coal's capsule."""
        return (coal.Capsule(self.radius, self.length),)


@documented
@dataclass(frozen=True, kw_only=True)
class Cylinder(Obstacle):
    """A cylinder along its own z axis; distances are to a circumscribed 64-sided prism."""

    _SIZES = ("radius", "length")

    radius: float
    """Radius [m]."""
    length: float
    """Length [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_hull("radius and length", (self.radius, self.length))

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the circumscribed prism, since coal's cylinder has no reliable gradient."""
        return (circumscribed_cylinder(self.radius, self.length),)


@documented
@dataclass(frozen=True, kw_only=True)
class HalfSpace(Obstacle):
    """All points x of its frame with normal · x <= offset: a floor or a wall without end.

    The floor z <= 0 by default. As with every obstacle, links that no joint moves may touch it.

    Raises:
        InvalidValueError: a normal of length zero, or a number that is not finite.
    """

    normal: Vector = (0.0, 0.0, 1.0)
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
        if not abs(offset) < FARTHEST:
            raise InvalidValueError(f"{self.name}.offset", offset, "less than 1000 km away")
        self._store(normal=tuple(unit.tolist()), offset=offset)
        if not math.isfinite(self.speed_bound(-math.inf, math.inf)):
            raise InvalidValueError(f"{self.name}.motion", self.motion, "one that does not turn")

    @cached_property
    def reach(self) -> float:
        """Infinite."""
        return math.inf

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return coal's half-space."""
        return (coal.Halfspace(np.array(self.normal), self.offset),)


def obstacle_pose(obstacle: Obstacle, origin: ArrayLike = (0.0, 0.0, 0.0)) -> pin.SE3:
    """Return the pose of an obstacle's frame, seen from a point of the world (3,) [m]."""
    position = np.subtract(obstacle.position, origin)
    return pin.XYZQUATToSE3(np.array([*position, *obstacle.orientation_xyzw]))


def pose_fields(pose: pin.SE3) -> dict[str, Any]:
    """Return a pose as the fields of an obstacle, of which `obstacle_pose` makes it."""
    values = pin.SE3ToXYZQUAT(pose).tolist()
    return {"position": tuple(values[:3]), "orientation_xyzw": tuple(values[3:])}


def geometry_objects(
    obstacle: Obstacle,
    joint: int = 0,
    frame: int = 0,
    placement: pin.SE3 | None = None,
    origin: ArrayLike = (0.0, 0.0, 0.0),
) -> list[pin.GeometryObject]:
    """Return an obstacle's convex shapes as Pinocchio's geometry objects.

    A frame holds them, by its index and its placement against a joint; none if in the world, where
    they are seen from a point (3,) [m].
    """
    shapes = obstacle.convex_shapes()
    pose = obstacle_pose(obstacle, origin)
    pose = pose if placement is None else placement * pose
    return [
        pin.GeometryObject(name, joint, frame, pose, shape)
        for name, shape in zip(numbered(obstacle.name, len(shapes)), shapes, strict=True)
    ]


def numbered(name: str, count: int) -> list[str]:
    """Return names for the shapes of one body: its own for one, else with a dot and a number."""
    return [name] if count == 1 else [f"{name}.{k}" for k in range(count)]
