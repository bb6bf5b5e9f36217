"""Pages of the public names, one for each room that has any, from docstrings."""

import ast
from pathlib import Path

import densarm

_ALSO = {  # what public names take, return or hold, and nobody needs to import
    "arms": ["arms.description.RobotDescription", "arms.joints.JointLimits"],
    "world": ["world.world.ClearanceSample"],
    "planning": ["planning.motion.MotionSamples"],
    "control": [
        "control.disturbance_observer.ActuationParameters",
        "control.position_tracking.PositionTracking",
    ],
    "certificates": ["certificates.certificate.Check", "certificates.task.Task"],
    "simulation": ["simulation.disturbances.Push"],
    "hardware": [
        "hardware.drive.drive",
        "hardware.drive.DriveInterrupted",
        "hardware.franka.FrankaRobot",
        "hardware.robot.Reading",
        "hardware.robot.Robot",
        "hardware.universal.UniversalRobot",
    ],
    "errors": ["errors.RobotError"],
    "scenarios": ["scenarios.control.ControlParameters", "scenarios.control.ControlForm"],
}
_ROOMS = {
    "arms": "an arm from its description, and poses of its frames",
    "scene": "obstacles, how they move, and held bodies",
    "world": "an arm among obstacles",
    "density": "the navigation density and its parts",
    "planning": "motions, and guides that lead them",
    "control": "controllers, and what watches over them",
    "certificates": "what is proved of a run",
    "simulation": "plants, the closed loop and its record",
    "hardware": "real robots, and the loop that drives them; named by its modules",
    "visualization": "pages, pictures and plots of a run",
    "scenarios": "a task as a whole",
    "values": "how a run ends",
    "errors": "what is raised",
}
"""What each room's page is about, in the order of the site."""


def public_names() -> dict[str, list[str]]:
    """Return module and name of every public name, by its room, as the stub lists them."""
    stub = Path(densarm.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    found: dict[str, list[str]] = {room: [] for room in _ROOMS}
    for node in ast.parse(stub).body:
        if isinstance(node, ast.ImportFrom) and node.module:
            found[node.module.split(".")[0]] += [f"{node.module}.{x.name}" for x in node.names]
    return found


def pages() -> dict[str, str]:
    """Return the pages of all rooms, and one that lists them, by the path that each has."""
    named = public_names()
    rows, found = [], {}
    for room, about in _ROOMS.items():
        blocks = [_block(path, public=True) for path in named[room]]
        blocks += [_block(path, public=False) for path in _ALSO.get(room, [])]
        head = f"# {room}\n\n{about[0].upper()}{about[1:]}."
        found[f"reference/{room}.md"] = "\n\n".join([head, *blocks]) + "\n"
        links = [
            f"[`{x}`]({room}.md#densarm.{path})"
            for path in named[room]
            for x in [path.rpartition(".")[2]]
        ]
        rows.append(f"| [{room}]({room}.md) | {', '.join(links)} |")
    head = (
        "# Reference\n\nEvery public name, `densarm.NAME`, by the [room](../architecture.md) that "
        "it comes from. Shapes and units are in the texts.\n\n| room | names |\n|---|---|\n"
    )
    return {"reference/index.md": head + "\n".join(rows) + "\n", **found}


def _block(path: str, *, public: bool) -> str:
    name = path.rpartition(".")[2]
    heading = f"densarm.{name}" if public else name
    return f"::: densarm.{path}\n    options:\n      heading: {heading}\n      toc_label: {name}"
