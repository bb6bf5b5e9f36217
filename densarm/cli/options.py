"""Options that commands share: numbers, and the files to write."""

import json
import os
import tomllib
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import Any

import click

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def together(*options: Decorator) -> Decorator:
    """Return a decorator that adds several options to a command, in this order."""
    return lambda command: reduce(lambda done, option: option(done), reversed(options), command)


def number_option(name: str, default: int | None, help_text: str, least: int = 1) -> Decorator:
    """Return a decorator that adds an option of a whole number, `least` or above."""
    kind = click.IntRange(min=least)
    return click.option(name, type=kind, default=default, show_default=True, help=help_text)


def choice_option(name: str, choices: list[str], help_text: str) -> Decorator:
    """Return a decorator that adds an option of a word, by default the first of the choices."""
    kind = click.Choice(choices)
    return click.option(name, type=kind, default=choices[0], show_default=True, help=help_text)


def output_option(
    name: str, metavar: str, help_text: str, endings: tuple[str, ...] = ()
) -> Decorator:
    """Return a decorator that adds an option which names a file to write.

    Its value is a path, or None; it is checked before the command starts its work.

    Args:
        name: of the option, such as ``--save``.
        metavar: how the help calls its value.
        help_text: what is written.
        endings: those that the file may have, such as ``.png``; any where none are given.
    """

    def check(ctx: click.Context, param: click.Parameter, path: Path | None) -> Path | None:
        fault = None if path is None else _fault(path, endings)
        if fault:
            raise click.BadParameter(f"{path}: {fault}", ctx, param)
        return path

    kind = click.Path(path_type=Path)
    return click.option(name, type=kind, callback=check, metavar=metavar, help=help_text)


def read_disturbances(
    ctx: click.Context, param: click.Parameter, texts: tuple[str, ...]
) -> dict[str, Any]:
    """Return the keys of a table ``[disturbances]`` from texts NAME=VALUE, values as in JSON."""
    told = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise click.BadParameter(f"{text!r}: must be NAME=VALUE, as in payload=1", ctx, param)
        try:
            told[name] = json.loads(value)
        except ValueError:
            told[name] = value  # a name, or what its check refuses
    return told


def _read_goal(ctx: click.Context, param: click.Parameter, text: str | None) -> Any:
    """Return a goal as TOML has it; a text that is none is the name of a posture."""
    if text is None:
        return None
    try:
        return tomllib.loads(f"goal = {text}")["goal"]
    except (ValueError, RecursionError) as error:
        if text.lstrip()[:1] in ("{", "["):
            raise click.BadParameter(f"{text!r}: not as in TOML: {error}", ctx, param) from None
        return text


way_options = together(
    click.option(
        "--guide",
        type=click.Choice(["auto", "density", "direct", "path"]),
        help="What leads: the density, by via points where it is stuck, else a planner's path "
        "(auto); the first two; the first alone; the last.  [default: what the scenario says, "
        "else auto]",
    ),
    click.option(
        "--goal",
        callback=_read_goal,
        metavar="GOAL",
        help="In place of the scenario's, as in its file: a posture, [joint positions], a pose "
        "{frame = ..., position = [...]}, or a list of these.",
    ),
    number_option(
        "--seed", None, "Seed of the planner.  [default: what the scenario says, else 0]", least=0
    ),
)
"""Adds --guide, --goal and --seed, each None for the scenario's own; a goal is as TOML has it."""

plant_options = together(
    click.option(
        "--plant",
        type=click.Choice(["pinocchio", "mujoco"]),
        help="What is driven: the arm's model, or the same in MuJoCo (pip install "
        "'densarm[mujoco]').  [default: what the scenario says, else pinocchio]",
    ),
    click.option(
        "--disturb",
        "disturb",
        multiple=True,
        callback=read_disturbances,
        metavar="NAME=VALUE",
        help="How the plant differs from its model, which no controller is told: mass_scale, "
        "payload, viscous, coulomb, armature, torque_delay, torque_quantum, encoder_noise, "
        "velocity_noise, base_tilt_deg and more, in SI units; lists in brackets. May be repeated.",
    ),
)
"""Adds --plant and --disturb, a name or None and the keys of a table [disturbances]."""

worker_options = together(
    number_option("--jobs", 1, "Processes on this machine; from two on by Dask."),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Address of a Dask scheduler whose workers run it, as tcp://10.0.0.1:8786.",
    ),
)
"""Adds --jobs and --scheduler."""

PLOT_ENDINGS = (".png", ".pdf", ".svg")

picture_options = together(
    output_option("--html", "RUN.html", "Write a page that plays the run."),
    output_option(
        "--plot",
        "RUN.png",
        "Plot positions, velocities, torques, clearance and density over time.",
        PLOT_ENDINGS,
    ),
    output_option(
        "--png", "RUN.png", "Write a picture of the moment of smallest clearance.", (".png",)
    ),
    output_option("--gif", "RUN.gif", "Write an animated picture, in real time.", (".gif",)),
)
"""Adds --html, --plot, --png and --gif to a command, whose values `write_pictures` takes."""


def _fault(path: Path, endings: tuple[str, ...]) -> str | None:
    if path.is_dir():
        return "is a folder, give a file"
    if not path.parent.is_dir():
        return f"the folder {path.parent} does not exist"
    if not os.access(path.parent, os.W_OK):
        return f"the folder {path.parent} cannot be written to"
    if endings and path.suffix.lower() not in endings:
        return f"must end in {' or '.join(endings)}"
    return None
