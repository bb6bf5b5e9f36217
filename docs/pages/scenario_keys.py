"""The page of every key of a scenario file, from the dataclasses that read them."""

import inspect
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from densarm.arms.arm import load_arm
from densarm.arms.line import Line
from densarm.arms.pose import Pose
from densarm.arms.upright import TILT
from densarm.control.tracking import TRACKING_GAINS
from densarm.planning.way_points import BLEND
from densarm.scenarios import scenario
from densarm.scenarios.steps import Attach, Detach
from densarm.scene import scene
from densarm.scene.motion import MOTION_TYPES
from densarm.scene.obstacles import Obstacle
from densarm.scene.scene import OBSTACLE_TYPES, Attachment
from densarm.simulation.disturbances import Push
from densarm.values.documented import field_docs

_WORDS = {float: "number", int: "whole number", str: "text", bool: "true or false", Path: "text"}


class Key(NamedTuple):
    """A key of a table of a scenario file."""

    name: str
    kind: str
    default: str
    text: str


# Keys that no dataclass documents, or that files have in another form.
_FILE = {
    "title": Key("title", "text", "the file's name", "What pages and pictures say above it."),
    "robot": Key("robot", "table", "required", "The arm."),
    "task": Key("task", "table", "required", "Start and goal."),
    "scene": Key("scene", "text", "–", "Path of [a scene](formats.md), beside this file."),
    "obstacles": Key("obstacles", "tables", "–", "Bodies, each a table `[[obstacles]]`."),
}
_ROBOT = {
    "name": "A known robot (`densarm list`); either this or `urdf`.",
    "urdf": "Path of a URDF, or of an MJCF, beside this file.",
    "base_placement": "Pose of the base in the world: x y z [m], quaternion x y z w.",
    "frames": "Frames of one's own by name, each a table: the pose that it has in that of a link.",
}
_TASK = [
    Key(
        "start",
        "numbers or text",
        "required",
        "Joint positions [rad or m], one per joint, or the name of a posture.",
    ),
    Key(
        "goal",
        "the same or a table",
        "required",
        "The same, or [a pose](#a-pose), or a list of these, of which any will do. Left out where "
        "there are [steps](tasks.md).",
    ),
]
_STEPS = [  # one of them in each table, and what a move has besides
    Key("move_to", "as a goal", "–", "Where to go, as [task] goal."),
    Key("through", "as a goal", "–", "Beside `move_to`: way points, in their order, as goals are."),
    Key("blend", "number", f"{BLEND:g}", "Beside it: how far off each joint may be at these."),
    Key("upright", "text", "–", "Beside it: a frame, of which what points up stays up on the way."),
    Key("tilt", "number", f"{TILT:g}", "Beside it: how far that may tilt [rad]."),
    Key("line", "table", "–", "A straight way of a frame, below."),
    Key("grip", "table", "–", "Position of each joint of a gripper [rad or m], by its name."),
    Key("attach", "table", "–", "A body that is taken, below."),
    Key("detach", "text or table", "–", "A body that is put down: its name, or as below."),
    Key("wait", "number", "–", "How long to rest [s]."),
]
_GAINS = {
    name: f"{dict(field_docs(type(TRACKING_GAINS)))[name][:-1]}; {value:g} in tracking."
    for name, value in vars(TRACKING_GAINS).items()
}
_DEGREES = (
    "In place of the quaternion: turns about the world's x, y and z in this order [degrees], as "
    "URDF's rpy."
)


def scenario_tables() -> dict[str, list[Key]]:
    """Return the keys of every table, by the heading that the page gives it."""
    plain = scenario._KEYS - set(scenario.TABLES)
    own = {"gains": _GAINS}
    every = [field.name for field in fields(Obstacle)]
    return {
        "The file": [*_FILE.values(), *_keys(scenario.Scenario, plain - set(_FILE))],
        "[robot]": _keys(scenario._RobotTable, texts=_arguments_of_load_arm() | _ROBOT),
        "[task]": [*_TASK, *_keys(scenario.Scenario, {"goal_follows"})],
        **{f"[{x}]": _keys(kind, texts=own.get(x)) for x, kind in scenario.TABLES.items()},
        "pushes, of [disturbances]": _keys(Push),
        "[[obstacles]]": [
            Key("type", "text", "required", ", ".join(f'"{word}"' for word in OBSTACLE_TYPES)),
            *_keys(Obstacle),
        ],
        **{
            f'type = "{word}"': _keys(kind, [x.name for x in fields(kind) if x.name not in every])
            for word, kind in OBSTACLE_TYPES.items()
        },
        "[[obstacles]] in the hand": [
            Key("attached_to", "text", "required", "Link, or other frame of the URDF, that holds."),
            *_keys(Attachment, scene._HOLDING),
        ],
        **{f'motion = {{ type = "{x}" }}': _keys(kind) for x, kind in MOTION_TYPES.items()},
        "[[steps]]": _STEPS,
        "line, of [[steps]]": _keys(Line),
        "attach, of [[steps]]": _keys(Attach),
        "detach, of [[steps]]": _keys(Detach),
        "A pose": [*_keys(Pose), Key("orientation_rpy_deg", "numbers", "–", _DEGREES)],
    }


def page() -> str:
    """Return the page in Markdown."""
    about = (
        "Every table and key of a scenario's TOML file. `[robot]` and `[task]` are needed, all "
        "else has defaults; here is [an example](commands.md#a-scenario)."
    )
    parts = ["# Keys of a scenario", about]
    for title, keys in scenario_tables().items():
        parts.append(f"## {title}" if " " in title and "=" not in title else f"## `{title}`")
        rows = [f"| `{key.name}` | {key.kind} | {key.default} | {key.text} |" for key in keys]
        parts.append("\n".join(["| key | value | default | meaning |", "|---|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


def _keys(
    kind: type[Any], names: Collection[str] = (), texts: Mapping[str, str] | None = None
) -> list[Key]:
    """Return the keys that are fields of a dataclass, all or some, with texts of their own."""
    own = {name: text for cls in reversed(kind.__mro__) for name, text in field_docs(cls)}
    own |= texts or {}
    hints = get_type_hints(kind)
    return [
        Key(
            item.name,
            _kind(hints[item.name]),
            _default(item),
            _cell(own.get(item.name, "")) + _choices(hints[item.name]),
        )
        for item in fields(kind)
        if not names or item.name in names
    ]


def _kind(hint: Any) -> str:
    if hint in _WORDS:
        return _WORDS[hint]
    if isinstance(hint, type) and issubclass(hint, StrEnum):
        return "text"
    origin = get_origin(hint)
    options = [item for item in get_args(hint) if item not in (type(None), Ellipsis)]
    if origin in (Sequence, tuple):
        of = _kind(options[0])
        return {"text": "list of text", "table": "tables"}.get(of, "numbers")
    if origin is np.ndarray:
        return "numbers"
    if origin in (dict, Mapping) or not options:
        return "table"
    return " or ".join(dict.fromkeys(map(_kind, options)))


def _default(field: Field[Any]) -> str:
    value = field.default
    if value is MISSING:
        return "required" if field.default_factory is MISSING else "–"
    if value is None or value in ("", ()):
        return "–"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(f'{x:g}' for x in value)}]"
    return f"{value:g}" if type(value) in (int, float) else str(value).lower()


def _choices(hint: Any) -> str:
    if not (isinstance(hint, type) and issubclass(hint, StrEnum)):
        return ""
    texts = dict(field_docs(hint))
    return "".join(f'<br>"{item}": {_cell(texts.get(item.name, ""))}' for item in hint)


def _cell(text: str) -> str:
    """Return a text for a cell of a table; what is None in Python is left out of a file."""
    plain = re.sub(r"\bNone\b", "left out", " ".join(text.split()))
    return plain.replace("|", "\\|").replace("``", "`").replace("<", "&lt;")


def _arguments_of_load_arm() -> dict[str, str]:
    section = (inspect.getdoc(load_arm) or "").split("Args:\n")[1].split("\n\n")[0]
    pairs = re.findall(r"^    (\w+): (.*?)(?=^    \w|\Z)", section, re.DOTALL | re.MULTILINE)
    return {name: f"{text[0].upper()}{text[1:]}" for name, text in pairs}
