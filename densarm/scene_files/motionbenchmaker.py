"""MotionBenchMaker's problems as JSON: scenes with starts and goals."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.robot.robot_description import read_text
from densarm.scene import Scene
from densarm.validation import finite_number, finite_tuple, non_negative_integer


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


def read_motion_problems(path: Path) -> tuple[MotionProblem, ...]:
    """Return the problems of a file.

    It holds ``metadata`` (robot, joints, locked_joints) and ``problems``, each with scene, index,
    start, goal, and obstacles in the form of `Scene.from_json`.

    Args:
        path: the file.

    Raises:
        FileContentError: it cannot be read, or holds no such problems, with the key.
    """
    where = ""
    try:
        data = json.loads(read_text(path))
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
