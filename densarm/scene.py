"""Scene: the obstacles around an arm, in the world frame, and the bodies that it holds."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from densarm.attachment import Attachment
from densarm.errors import InvalidValueError
from densarm.mesh import Mesh
from densarm.obstacle_table import OBSTACLE_TYPES, obstacle_table, parse_obstacle
from densarm.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere, obstacle_pose

__all__ = [
    "OBSTACLE_TYPES",
    "Box",
    "Capsule",
    "Cylinder",
    "HalfSpace",
    "Mesh",
    "Obstacle",
    "Scene",
    "Sphere",
    "obstacle_pose",
]


@dataclass(frozen=True)
class Scene:
    """Obstacles with distinct names, and bodies that are attached to links.

    Attached bodies move with the arm and are a part of it: `Arm.holding` takes them.

    Raises:
        InvalidValueError: two bodies share a name, or an entry is not an obstacle.
    """

    obstacles: tuple[Obstacle, ...] = ()
    attachments: tuple[Attachment, ...] = ()

    def __init__(
        self, obstacles: Iterable[Obstacle] = (), attachments: Iterable[Attachment] = ()
    ) -> None:
        object.__setattr__(self, "obstacles", tuple(obstacles))
        object.__setattr__(self, "attachments", tuple(attachments))
        for obstacle in self.obstacles:
            if not isinstance(obstacle, tuple(OBSTACLE_TYPES.values())):
                kinds = ", ".join(kind.__name__ for kind in OBSTACLE_TYPES.values())
                raise InvalidValueError("obstacle", obstacle, f"one of {kinds}")
        names: set[str] = set()
        for body in (*self.obstacles, *(item.body for item in self.attachments)):
            if body.name in names:
                raise InvalidValueError("obstacle name", body.name, "used only once in a scene")
            names.add(body.name)

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
            UnknownNameError: an unknown type, or a field that the type does not have.
            InvalidValueError: a missing field, or a value that is not allowed.
            FileContentError: a mesh file that cannot be used.
        """
        obstacles: list[Obstacle] = []
        attachments: list[Attachment] = []
        for table in data:
            if not isinstance(table, Mapping):
                raise InvalidValueError("obstacle", table, "a table with the key 'type'")
            if "attached_to" in table:
                attachments.append(Attachment.from_json(table, folder))
            else:
                obstacles.append(parse_obstacle(table, folder))
        return cls(obstacles, attachments)
