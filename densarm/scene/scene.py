"""Scene: the obstacles around an arm, in the world frame, and the bodies that it holds."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.scene.mesh import Mesh
from densarm.scene.motion import MOTION_TYPES, ObstacleMotion
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from densarm.scene.point_cloud import PointCloud, packed_points
from densarm.values.checks import non_negative
from densarm.values.documented import documented

_Kind = TypeVar("_Kind", Obstacle, ObstacleMotion)
_LONGEST = 80  # list of names that is told [characters]

OBSTACLE_TYPES: Mapping[str, type[Obstacle]] = {
    "sphere": Sphere,
    "box": Box,
    "capsule": Capsule,
    "cylinder": Cylinder,
    "half_space": HalfSpace,
    "mesh": Mesh,
    "point_cloud": PointCloud,
}
"""Every kind of obstacle by the word that files use for it."""


@documented
@dataclass(frozen=True)
class Attachment:
    """A body fixed to a link: an obstacle whose pose is in the frame of that link.

    It keeps clear of all obstacles and of every link, even a neighbouring one, that moves against
    its own and is not listed in `touch_links`.

    Raises:
        InvalidValueError: the body is none, has no end or is a cloud, a link without a name, or a
            mass that is not a finite number >= 0.
    """

    body: Obstacle
    """The body, its pose in the frame of the link."""
    link: str
    """Link, or other frame of the URDF, that holds it."""
    touch_links: Sequence[str] = ()
    """Links that it may touch and even enter, besides its own."""
    mass: float = 0.0
    """Mass, spread evenly over its volume [kg]; 0 leaves it out of the dynamics."""
    touch_obstacles: Sequence[str] = ()
    """Obstacles that it may touch and even enter, as what it is lifted from."""

    def __post_init__(self) -> None:
        kinds = [x for x in OBSTACLE_TYPES.values() if x not in (HalfSpace, PointCloud)]
        _require_kind("attached body", self.body, kinds)
        name = self.body.name
        if self.body.motion is not None:
            raise InvalidValueError(f"{name}.motion", self.body.motion, "none: its link moves it")
        for key, kind in (("touch_links", "links"), ("touch_obstacles", "obstacles")):
            names = getattr(self, key)
            if not isinstance(names, tuple | list) or not all(isinstance(x, str) for x in names):
                raise InvalidValueError(f"{name}.{key}", names, f"a list of names of {kind}")
            object.__setattr__(self, key, tuple(names))
        if not isinstance(self.link, str):
            raise InvalidValueError(f"{name}.attached_to", self.link, "the name of a link")
        object.__setattr__(self, "mass", non_negative(f"{name}.mass", self.mass))

    def to_json(self) -> dict[str, Any]:
        """Return the attachment as JSON data; `from_json` is its inverse."""
        holding = {"attached_to": self.link, **{key: getattr(self, key) for key in _HOLDING}}
        return {**obstacle_table(self.body), **holding}

    @classmethod
    def from_json(cls, table: Mapping[str, Any], folder: Path | None = None) -> "Attachment":
        """Build an attachment from what `parse_obstacle` takes, and ``attached_to``.

        The table may have ``touch_links``, ``mass`` and ``touch_obstacles`` too.
        """
        values = dict(table)
        link = values.pop("attached_to", None)
        holding = {key: values.pop(key) for key in _HOLDING if key in values}
        return cls(parse_obstacle(values, folder), link, **holding)


_HOLDING = ("touch_links", "mass", "touch_obstacles")


@documented
@dataclass(frozen=True)
class Scene:
    """Obstacles with distinct names, and bodies that are attached to links.

    Attached bodies move with the arm and are a part of it: `Arm.holding` takes them.

    Raises:
        InvalidValueError: two bodies share a name, or an entry is not an obstacle.
    """

    obstacles: tuple[Obstacle, ...] = ()
    """What does not belong to the arm."""
    attachments: tuple[Attachment, ...] = ()
    """What links hold."""

    def __init__(
        self, obstacles: Iterable[Obstacle] = (), attachments: Iterable[Attachment] = ()
    ) -> None:
        object.__setattr__(self, "obstacles", tuple(obstacles))
        object.__setattr__(self, "attachments", tuple(attachments))
        for obstacle in self.obstacles:
            _require_kind("obstacle", obstacle, OBSTACLE_TYPES.values())
        names: set[str] = set()
        for body in (*self.obstacles, *(item.body for item in self.attachments)):
            if body.name in names:
                raise InvalidValueError("obstacle name", body.name, "used only once in a scene")
            names.add(body.name)

    def __repr__(self) -> str:
        bodies = [*self.obstacles, *(item.body for item in self.attachments)]
        names = ", ".join(body.name for body in bodies)
        return f"Scene({names if len(names) <= _LONGEST else f'{len(bodies)} bodies'})"

    def __len__(self) -> int:
        return len(self.obstacles)

    def __iter__(self) -> Iterator[Obstacle]:
        return iter(self.obstacles)

    def to_json(self) -> list[dict[str, Any]]:
        """Return obstacles and attachments as JSON data; `from_json` is its inverse."""
        attached = [item.to_json() for item in self.attachments]
        return [*(obstacle_table(item) for item in self), *attached]

    @classmethod
    def from_json(cls, data: Iterable[Mapping[str, Any]], folder: Path | None = None) -> "Scene":
        """Build a scene from one mapping per obstacle: its type and its fields.

        Those with the key ``attached_to`` become attachments.

        Args:
            data: the mappings.
            folder: where relative paths of meshes start from; None for the working directory.

        Raises:
            DensarmError: as `parse_obstacle`, with the field.
        """
        obstacles, attachments = [], []
        for table in data:
            if not isinstance(table, Mapping):
                raise InvalidValueError("obstacle", table, "a table with the key 'type'")
            if "attached_to" in table:
                attachments.append(Attachment.from_json(table, folder))
            else:
                obstacles.append(parse_obstacle(table, folder))
        return cls(obstacles, attachments)


def obstacle_table(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle as plain data; `parse_obstacle` is its inverse."""
    table = {"type": _word(obstacle, OBSTACLE_TYPES), **asdict(obstacle)}
    if isinstance(obstacle, PointCloud):
        table["points"] = packed_points(obstacle.points)
    if obstacle.motion is None:
        del table["motion"]
    else:
        table["motion"] = {"type": _word(obstacle.motion, MOTION_TYPES), **table["motion"]}
    return table


def parse_obstacle(table: Mapping[str, Any], folder: Path | None = None) -> Obstacle:
    """Return the obstacle that a table of TOML or JSON describes, by its type and its fields.

    Raises:
        UnknownNameError: an unknown type, or a field that the type does not have.
        InvalidValueError: a missing field, or a value that is not allowed.
        FileContentError: a mesh file, its path relative to the folder, that cannot be used.
    """
    name = f"obstacle {table.get('name', '?')}"
    kind, values = _kind_and_fields(name, table, OBSTACLE_TYPES)
    if values.get("motion") is not None:
        values["motion"] = _parse_motion(name, values["motion"])
    if folder is not None and values.get("path"):
        values["path"] = str(folder / str(values["path"]))
    return kind(**values)


def _parse_motion(name: str, table: Any) -> ObstacleMotion:
    if not isinstance(table, Mapping):
        raise InvalidValueError(f"{name}.motion", table, "a table with the key 'type'")
    kind, values = _kind_and_fields(f"{name}.motion", table, MOTION_TYPES)
    try:
        return kind(**values)
    except InvalidValueError as error:
        raise InvalidValueError(f"{name}.{error.name}", error.value, error.allowed) from None


def _kind_and_fields(
    name: str, table: Mapping[str, Any], kinds: Mapping[str, type[_Kind]]
) -> tuple[type[_Kind], dict[str, Any]]:
    """Return the dataclass that a table's type stands for, and what the table gives of it."""
    values = dict(table)
    word = values.pop("type", None)
    if not isinstance(word, str) or word not in kinds:
        raise UnknownNameError(f"type of {name}", word, kinds)
    known = {item.name: item.default is MISSING for item in fields(kinds[word])}
    for key in values:
        if key not in known:
            raise UnknownNameError(f"key of {name} ({word})", key, known)
    for key, required in known.items():
        if required and key not in values:
            raise InvalidValueError(f"{name}.{key}", None, f"given for a {word}")
    return kinds[word], values


def _word(value: object, kinds: Mapping[str, type[Any]]) -> str:
    return {kind: word for word, kind in kinds.items()}[type(value)]


def _require_kind(name: str, body: object, kinds: Iterable[type[Obstacle]]) -> None:
    if not isinstance(body, tuple(kinds)):
        names = ", ".join(kind.__name__ for kind in kinds)
        raise InvalidValueError(name, body, f"one of {names}")
