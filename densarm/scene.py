"""Scene: the obstacles around an arm, as frozen values in the world frame."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import coal
import numpy as np
import pinocchio as pin

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.shapes import box_hull, circumscribed_cylinder
from densarm.validation import finite_tuple, positive, unit_quaternion

Vector3 = tuple[float, ...]
_ORIGIN = (0.0, 0.0, 0.0)
_UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Obstacle(Protocol):
    """A named convex body at a fixed pose."""

    @property
    def name(self) -> str:
        """Name, unique in its scene."""

    @property
    def position(self) -> Vector3:
        """Centre in the world [m]."""

    @property
    def orientation_xyzw(self) -> tuple[float, ...]:
        """Unit quaternion x y z w of the body's frame in the world."""

    def geometry(self) -> coal.CollisionGeometry:
        """Return the shape whose distance coal differentiates."""


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A ball.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    name: str
    radius: float
    """Radius [m]."""
    position: Vector3 = _ORIGIN
    """Centre in the world [m]."""
    orientation_xyzw: tuple[float, ...] = _UPRIGHT
    """Unit quaternion x y z w."""

    def __post_init__(self) -> None:
        _check(self, "radius")

    def geometry(self) -> coal.CollisionGeometry:
        """Return coal's sphere."""
        return coal.Sphere(self.radius)


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box with full side lengths along its own axes.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    name: str
    size: Vector3
    """Full side lengths x y z [m]."""
    position: Vector3 = _ORIGIN
    """Centre in the world [m]."""
    orientation_xyzw: tuple[float, ...] = _UPRIGHT
    """Unit quaternion x y z w."""

    def __post_init__(self) -> None:
        _check(self)
        size = finite_tuple(f"{self.name}.size", self.size, 3)
        object.__setattr__(self, "size", tuple(positive(f"{self.name}.size", s) for s in size))

    def geometry(self) -> coal.CollisionGeometry:
        """Return the hull of the corners, since coal's box errs where it nearly touches another."""
        return box_hull(self.size)


@dataclass(frozen=True, kw_only=True)
class Capsule:
    """A cylinder along its own z axis with a half ball on each end.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    name: str
    radius: float
    """Radius [m]."""
    length: float
    """Length between the centres of the half balls [m]."""
    position: Vector3 = _ORIGIN
    """Centre in the world [m]."""
    orientation_xyzw: tuple[float, ...] = _UPRIGHT
    """Unit quaternion x y z w."""

    def __post_init__(self) -> None:
        _check(self, "radius", "length")

    def geometry(self) -> coal.CollisionGeometry:
        """Return coal's capsule."""
        return coal.Capsule(self.radius, self.length)


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """A cylinder along its own z axis; distances are to a circumscribed 64-sided prism.

    Raises:
        InvalidValueError: a size that is not positive, or a number that is not finite.
    """

    name: str
    radius: float
    """Radius [m]."""
    length: float
    """Length [m]."""
    position: Vector3 = _ORIGIN
    """Centre in the world [m]."""
    orientation_xyzw: tuple[float, ...] = _UPRIGHT
    """Unit quaternion x y z w."""

    def __post_init__(self) -> None:
        _check(self, "radius", "length")

    def geometry(self) -> coal.CollisionGeometry:
        """Return the circumscribed prism, since coal's cylinder has no reliable gradient."""
        return circumscribed_cylinder(self.radius, self.length)


OBSTACLE_TYPES: Mapping[str, type[Any]] = {
    "sphere": Sphere,
    "box": Box,
    "capsule": Capsule,
    "cylinder": Cylinder,
}
"""Every kind of obstacle by the word that files use for it."""


@dataclass(frozen=True)
class Scene:
    """Obstacles with distinct names.

    Raises:
        InvalidValueError: two obstacles share a name, or an entry is not an obstacle.
    """

    obstacles: tuple[Obstacle, ...] = ()

    def __init__(self, obstacles: Iterable[Obstacle] = ()) -> None:
        object.__setattr__(self, "obstacles", tuple(obstacles))
        names: set[str] = set()
        for obstacle in self.obstacles:
            if not isinstance(obstacle, tuple(OBSTACLE_TYPES.values())):
                kinds = ", ".join(kind.__name__ for kind in OBSTACLE_TYPES.values())
                raise InvalidValueError("obstacle", obstacle, f"one of {kinds}")
            if obstacle.name in names:
                raise InvalidValueError("obstacle name", obstacle.name, "used only once in a scene")
            names.add(obstacle.name)

    def __len__(self) -> int:
        return len(self.obstacles)

    def __iter__(self) -> Iterator[Obstacle]:
        return iter(self.obstacles)

    def to_json(self) -> list[dict[str, Any]]:
        """Return the obstacles as JSON data; `from_json` is its inverse."""
        words = {kind: word for word, kind in OBSTACLE_TYPES.items()}
        return [{"type": words[type(item)], **asdict(item)} for item in self]  # type: ignore[call-overload]

    @classmethod
    def from_json(cls, data: Iterable[Mapping[str, Any]]) -> "Scene":
        """Build a scene from one mapping per obstacle: its type and its fields.

        Raises:
            UnknownNameError: an unknown type, or a field that the type does not have.
            InvalidValueError: a missing field, or a value that is not allowed.
        """
        return cls(_obstacle_from_json(entry) for entry in data)


def obstacle_pose(obstacle: Obstacle) -> pin.SE3:
    """Return the pose of an obstacle's frame in the world."""
    return pin.XYZQUATToSE3(np.array([*obstacle.position, *obstacle.orientation_xyzw]))


def _obstacle_from_json(entry: Mapping[str, Any]) -> Obstacle:
    if not isinstance(entry, Mapping):
        raise InvalidValueError("obstacle", entry, "a table with the key 'type'")
    values = dict(entry)
    word = values.pop("type", None)
    name = f"obstacle {values.get('name', '?')}"
    if not isinstance(word, str) or word not in OBSTACLE_TYPES:
        raise UnknownNameError(f"type of {name}", word, OBSTACLE_TYPES)
    kind = OBSTACLE_TYPES[word]
    fields = kind.__dataclass_fields__
    for key in values:
        if key not in fields:
            raise UnknownNameError(f"key of {name} ({word})", key, fields)
    required = [key for key in fields if key in {"name", "radius", "size", "length"}]
    for key in required:
        if key not in values:
            raise InvalidValueError(f"{name}.{key}", None, f"given for a {word}")
    return kind(**values)  # type: ignore[no-any-return]


def _check(obstacle: Any, *sizes: str) -> None:
    """Check an obstacle's fields, and store them as tuples and floats."""
    name = obstacle.name
    if not isinstance(name, str) or not name:
        raise InvalidValueError("obstacle name", name, "a non-empty string")
    values: dict[str, Any] = {
        "position": finite_tuple(f"{name}.position", obstacle.position, 3),
        "orientation_xyzw": unit_quaternion(f"{name}.orientation_xyzw", obstacle.orientation_xyzw),
        **{size: positive(f"{name}.{size}", getattr(obstacle, size)) for size in sizes},
    }
    for field, value in values.items():
        object.__setattr__(obstacle, field, value)
