"""Obstacles as tables of TOML and JSON: their type and their fields."""

from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.mesh import Mesh
from densarm.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere

OBSTACLE_TYPES: Mapping[str, type[Any]] = {
    "sphere": Sphere,
    "box": Box,
    "capsule": Capsule,
    "cylinder": Cylinder,
    "half_space": HalfSpace,
    "mesh": Mesh,
}
"""Every kind of obstacle by the word that files use for it."""


def obstacle_table(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle as plain data; `parse_obstacle` is its inverse."""
    words = {kind: word for word, kind in OBSTACLE_TYPES.items()}
    return {"type": words[type(obstacle)], **asdict(obstacle)}  # type: ignore[call-overload]


def parse_obstacle(table: Mapping[str, Any], folder: Path | None = None) -> Obstacle:
    """Return the obstacle that a table describes.

    Args:
        table: its type and its fields.
        folder: where a relative path of a mesh starts from; None for the working directory.

    Raises:
        UnknownNameError: an unknown type, or a field that the type does not have.
        InvalidValueError: a missing field, or a value that is not allowed.
        FileContentError: a mesh file that cannot be used.
    """
    values = dict(table)
    word = values.pop("type", None)
    name = f"obstacle {values.get('name', '?')}"
    if not isinstance(word, str) or word not in OBSTACLE_TYPES:
        raise UnknownNameError(f"type of {name}", word, OBSTACLE_TYPES)
    kind = OBSTACLE_TYPES[word]
    known = {item.name: item.default is MISSING for item in fields(kind)}
    for key in values:
        if key not in known:
            raise UnknownNameError(f"key of {name} ({word})", key, known)
    for key, required in known.items():
        if required and key not in values:
            raise InvalidValueError(f"{name}.{key}", None, f"given for a {word}")
    if folder is not None and values.get("path"):
        values["path"] = str(folder / str(values["path"]))
    return kind(**values)  # type: ignore[no-any-return]
