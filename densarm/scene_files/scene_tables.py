"""The scene of a scenario file: a file of its own, tables, or both."""

from pathlib import Path
from typing import Any

from densarm.errors import InvalidValueError
from densarm.scene import Scene
from densarm.scene_files import load_scene


def parse_scene(folder: Path, file: Any, obstacles: Any) -> Scene:
    """Return the bodies of a scene file and of tables ``[[obstacles]]``.

    Args:
        folder: where relative paths start from.
        file: the path of a scene file; empty for none.
        obstacles: the tables, in the form of `Scene.from_json`.

    Raises:
        FileContentError: the scene file, or the file of a mesh, cannot be used.
        UnknownNameError: an unknown type of obstacle, or a field that the type does not have.
        InvalidValueError: a value that is not allowed.
    """
    if not isinstance(file, str):
        raise InvalidValueError("scene", file, "the path of a scene file")
    if not isinstance(obstacles, list):
        raise InvalidValueError("obstacles", obstacles, "a list of tables [[obstacles]]")
    own = Scene.from_json(obstacles, folder)
    loaded = load_scene(folder / file) if file else Scene()
    return Scene((*loaded, *own), (*loaded.attachments, *own.attachments))
