"""The program ``densarm``: what the exceptions of its commands mean to the shell."""

import sys
from collections.abc import Sequence

from densarm.cli.exit_status import ExitStatus
from densarm.errors import DensarmError


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


def _run(arguments: list[str]) -> int:
    # Imported here, so that Ctrl-C is heeded from the start.
    import click

    from densarm.cli.application import application

    try:
        status = application.main(
            arguments or ["--help"], prog_name="densarm", standalone_mode=False
        )
    except click.ClickException as error:
        return _end(error.format_message(), ExitStatus.WRONG_INPUT)
    except click.Abort:
        raise KeyboardInterrupt from None
    return int(status)


def _end(message: str, status: ExitStatus) -> ExitStatus:
    sys.stderr.write(f"densarm: {' '.join(message.split())}\n")
    return status
