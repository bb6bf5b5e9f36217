"""The program ``densarm``: its commands, and what they mean to the shell."""

import sys
from collections.abc import Sequence
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING

from densarm.errors import DensarmError

if TYPE_CHECKING:
    import click


class ExitStatus(IntEnum):
    """Exit status of every command."""

    SUCCESS = 0
    """Reached and free of collision; for `verify`, certified."""
    FAILURE = 1
    """It ran, and did not."""
    WRONG_INPUT = 2
    """One line on stderr says what is wrong with the input."""
    INTERRUPTED = 130
    """Ctrl-C."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: without the program's name; None for those of the process.

    Returns:
        The exit status.
    """
    try:
        return _run(list(sys.argv[1:] if arguments is None else arguments))
    except DensarmError as error:
        return _end(str(error), ExitStatus.WRONG_INPUT)
    except KeyboardInterrupt:
        return _end("interrupted", ExitStatus.INTERRUPTED)


@cache
def application() -> "click.Group":
    """Return the command ``densarm`` with its subcommands, which return False where they failed."""
    # Imported here, so that Ctrl-C is heeded from the start.
    import click

    import densarm
    from densarm.cli.bench import bench
    from densarm.cli.compare import compare
    from densarm.cli.list_known import list_known
    from densarm.cli.plan import plan
    from densarm.cli.recorded import verify, view
    from densarm.cli.run import run
    from densarm.cli.study import study

    @click.group("densarm", context_settings={"help_option_names": ["-h", "--help"]})
    @click.version_option(densarm.__version__, message="%(version)s")
    def group() -> None:
        """Move robot arms to a goal without touching anything, by density functions.

        \b
        Example:
          densarm run swing_up --html swing_up.html

        \b
        Exit status:
          0    reached and free of collision; for verify: certified
          1    it ran, and did not
          2    the input is wrong: one line on stderr says what and what is allowed
          130  interrupted by Ctrl-C
        """  # noqa: D301

    for command in (list_known, run, plan, view, verify, study, bench, compare):
        group.add_command(command)
    return group


def _run(arguments: list[str]) -> int:
    import logging

    import click

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it tells of its font cache
    try:
        answer = application().main(
            arguments or ["--help"], prog_name="densarm", standalone_mode=False
        )
    except click.ClickException as error:
        return _end(error.format_message(), ExitStatus.WRONG_INPUT)
    except click.Abort:
        raise KeyboardInterrupt from None
    return ExitStatus.FAILURE if answer is False else ExitStatus.SUCCESS


def _end(message: str, status: ExitStatus) -> ExitStatus:
    sys.stderr.write(f"densarm: {' '.join(message.split())}\n")
    return status
