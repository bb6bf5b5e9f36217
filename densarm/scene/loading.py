"""Scenes from files, by their suffix or of a scenario, and MotionBenchMaker's problems."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.scene.mjcf import read_mjcf_scene
from densarm.scene.moveit import read_moveit_scene
from densarm.scene.moveit_yaml import read_moveit_yaml
from densarm.scene.scene import Scene
from densarm.scene.sdf import read_sdf_scene
from densarm.values.checks import finite_number, finite_tuple, non_negative_integer
from densarm.values.files import read_text

_SUFFIXES = ".scene, .yaml, .yml, .json, .xml, .sdf and .world"


@dataclass(frozen=True)
class MotionProblem:
    """One motion-planning problem of the collection [Chamzas et al., RA-L 2022]."""

    robot: str
    """The robot's name in the collection."""
    scene_name: str
    """The kind of scene, e.g. ``"bookshelf_small"``."""
    index: int
    """Number of the problem among those of its kind."""
    joints: tuple[str, ...]
    """Names of the joints that move."""
    start: tuple[float, ...]
    """Position of each of these joints at the start [rad or m]."""
    goal: tuple[float, ...]
    """Position of each at the goal [rad or m]."""
    locked_joints: Mapping[str, float]
    """Positions of the other joints, perhaps outside their limits [rad or m]."""
    scene: Scene
    """The obstacles."""


def load_scene(path: str | Path) -> Scene:
    """Load a scene from a file, by its suffix.

    ``.scene`` is MoveIt's text format, ``.yaml`` or ``.yml`` its planning-scene message, ``.json``
    a file of MotionBenchMaker with a single problem, ``.xml`` an MJCF, of which all is taken that
    is no part of an arm, ``.sdf`` or ``.world`` an SDFormat world. Poses are taken as in the world.

    Raises:
        FileContentError: it cannot be read, another suffix, more than one scene, or a shape that
            has no place here, by its name.
        DensarmError: an MJCF, and MuJoCo is not installed.
    """
    file = Path(path)
    if file.suffix == ".scene":
        return read_moveit_scene(file)
    if file.suffix in (".yaml", ".yml"):
        return read_moveit_yaml(file)
    if file.suffix == ".xml":
        return read_mjcf_scene(file)
    if file.suffix in (".sdf", ".world"):
        return read_sdf_scene(file)
    if file.suffix != ".json":
        raise FileContentError(file, f"not a scene: the suffix must be one of {_SUFFIXES}")
    problems = load_problems(file)
    if len(problems) != 1:
        reason = f"holds {len(problems)} problems, not one: use densarm.load_problems"
        raise FileContentError(file, reason)
    return problems[0].scene


def parse_scene(folder: Path, file: Any, obstacles: Any) -> Scene:
    """Return the bodies of a scenario's scene file and of its tables ``[[obstacles]]``.

    Args:
        folder: where relative paths start from.
        file: the path of a scene file; empty for none.
        obstacles: the tables, in the form of `Scene.from_json`.

    Raises:
        DensarmError: as `load_scene` and `Scene.from_json`.
    """
    if not isinstance(file, str):
        raise InvalidValueError("scene", file, "the path of a scene file")
    if not isinstance(obstacles, list):
        raise InvalidValueError("obstacles", obstacles, "a list of tables [[obstacles]]")
    own = Scene.from_json(obstacles, folder)
    loaded = load_scene(folder / file) if file else Scene()
    return Scene((*loaded, *own), (*loaded.attachments, *own.attachments))


def load_problems(path: str | Path) -> tuple[MotionProblem, ...]:
    """Load the problems of a MotionBenchMaker file in JSON: scenes with starts and goals.

    It holds ``metadata`` (robot, joints, locked_joints) and ``problems``, each with scene, index,
    start, goal, and obstacles in the form of `Scene.from_json`.

    Raises:
        FileContentError: it cannot be read, or holds no such problems, with the key.
    """
    where = ""
    try:
        data = json.loads(read_text(Path(path)))
        metadata, entries = data["metadata"], data["problems"]
        problems = []
        for k, entry in enumerate(entries):
            where = f"problems[{k}]: "
            problems.append(_problem(metadata, entry))
    except json.JSONDecodeError as error:
        raise FileContentError(path, f"line {error.lineno}: not JSON: {error.msg}") from None
    except KeyError as error:
        raise FileContentError(path, f"{where}the key {error} is missing") from None
    except (TypeError, AttributeError, RecursionError):
        raise FileContentError(path, f"{where}not of the form of a list of problems") from None
    except FileContentError:
        raise
    except DensarmError as error:
        raise FileContentError(path, f"{where}{error}") from None
    except ValueError as error:  # an integer of thousands of digits
        raise FileContentError(path, f"not JSON: {str(error).split(';')[0]}") from None
    return tuple(problems)


def _problem(metadata: Mapping[str, Any], entry: Mapping[str, Any]) -> MotionProblem:
    joints = metadata["joints"]
    if not isinstance(joints, list) or not all(isinstance(name, str) for name in joints):
        raise InvalidValueError("metadata.joints", joints, "a list of names")
    locked = metadata.get("locked_joints", {})
    return MotionProblem(
        robot=str(metadata["robot"]),
        scene_name=str(entry["scene"]),
        index=non_negative_integer("index", entry["index"]),
        joints=tuple(joints),
        start=finite_tuple("start", entry["start"], len(joints)),
        goal=finite_tuple("goal", entry["goal"], len(joints)),
        locked_joints={name: finite_number(name, value) for name, value in locked.items()},
        scene=Scene.from_json(entry["obstacles"]),
    )
