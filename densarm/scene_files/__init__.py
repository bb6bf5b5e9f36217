"""Scenes from other people's files."""

from pathlib import Path

from densarm.errors import FileContentError
from densarm.scene import Scene
from densarm.scene_files.motionbenchmaker import MotionProblem, read_motion_problems
from densarm.scene_files.moveit_scene import read_moveit_scene
from densarm.scene_files.moveit_yaml import read_moveit_yaml

__all__ = ["MotionProblem", "load_problems", "load_scene"]


def load_scene(path: str | Path) -> Scene:
    """Load a scene from a file, by its suffix.

    ``.scene`` is MoveIt's text format, ``.yaml`` or ``.yml`` its planning-scene message, ``.json``
    a file of MotionBenchMaker with a single problem. Poses are taken as in the world.

    Args:
        path: the file.

    Raises:
        FileContentError: it cannot be read, another suffix, or more than one scene.
    """
    file = Path(path)
    if file.suffix == ".scene":
        return read_moveit_scene(file)
    if file.suffix in (".yaml", ".yml"):
        return read_moveit_yaml(file)
    if file.suffix != ".json":
        raise FileContentError(file, "not a scene: the suffix must be .scene, .yaml, .yml or .json")
    problems = load_problems(file)
    if len(problems) != 1:
        reason = f"holds {len(problems)} problems, not one: use densarm.load_problems"
        raise FileContentError(file, reason)
    return problems[0].scene


def load_problems(path: str | Path) -> tuple[MotionProblem, ...]:
    """Load the problems of a MotionBenchMaker file in JSON: scenes with starts and goals.

    Args:
        path: the file.

    Raises:
        FileContentError: it cannot be read, or holds no such problems, with the key.
    """
    return read_motion_problems(Path(path))
