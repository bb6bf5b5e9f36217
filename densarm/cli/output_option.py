"""An option that names a file to write, checked before the command starts its work."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click


def output_option(
    name: str, metavar: str, help_text: str, endings: tuple[str, ...] = ()
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds the option; its value is a path, or None.

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
