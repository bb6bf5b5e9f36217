"""Attachment: a body that a link of an arm holds."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from densarm.errors import InvalidValueError
from densarm.obstacle_table import OBSTACLE_TYPES, obstacle_table, parse_obstacle
from densarm.obstacles import HalfSpace, Obstacle
from densarm.validation import non_negative


@dataclass(frozen=True)
class Attachment:
    """A body fixed to a link: an obstacle whose pose is in the frame of that link.

    It keeps clear of all obstacles and of every link, even a neighbouring one, that moves against
    its own and is not listed in `touch_links`.

    Raises:
        InvalidValueError: the body is none or has no end, a link without a name, or a mass that
            is not a finite number >= 0.
    """

    body: Obstacle
    """The body, its pose in the frame of the link."""
    link: str
    """Link, or other frame of the URDF, that holds it."""
    touch_links: tuple[str, ...] = ()
    """Links that it may touch and even enter, besides its own."""
    mass: float = 0.0
    """Mass, spread evenly over its volume [kg]; 0 leaves it out of the dynamics."""

    def __post_init__(self) -> None:
        kinds = tuple(kind for kind in OBSTACLE_TYPES.values() if kind is not HalfSpace)
        if not isinstance(self.body, kinds):
            names = ", ".join(kind.__name__ for kind in kinds)
            raise InvalidValueError("attached body", self.body, f"one of {names}")
        name = self.body.name
        links = self.touch_links
        if not isinstance(links, tuple | list) or not all(isinstance(x, str) for x in links):
            raise InvalidValueError(f"{name}.touch_links", links, "a list of names of links")
        if not isinstance(self.link, str):
            raise InvalidValueError(f"{name}.attached_to", self.link, "the name of a link")
        object.__setattr__(self, "touch_links", tuple(links))
        object.__setattr__(self, "mass", non_negative(f"{name}.mass", self.mass))

    def to_json(self) -> dict[str, Any]:
        """Return the attachment as JSON data; `from_json` is its inverse."""
        holding = {"attached_to": self.link, "touch_links": self.touch_links, "mass": self.mass}
        return {**obstacle_table(self.body), **holding}

    @classmethod
    def from_json(cls, table: Mapping[str, Any], folder: Path | None = None) -> "Attachment":
        """Build an attachment from the table of an obstacle with `attached_to`.

        Args:
            table: the fields of the obstacle, ``attached_to``, and optionally ``touch_links``
                and ``mass``.
            folder: where a relative path of a mesh starts from.

        Raises:
            UnknownNameError: an unknown type, or a field that the type does not have.
            InvalidValueError: a missing field, or a value that is not allowed.
            FileContentError: a mesh file that cannot be used.
        """
        values = dict(table)
        link = values.pop("attached_to", None)
        touch_links, mass = values.pop("touch_links", ()), values.pop("mass", 0.0)
        body = parse_obstacle(values, folder)
        return cls(body, link, touch_links, mass)
