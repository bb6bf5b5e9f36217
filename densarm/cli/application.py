"""The command ``densarm`` and its subcommands."""

import click

import densarm
from densarm.cli.bench import bench
from densarm.cli.compare import compare
from densarm.cli.list_known import list_known
from densarm.cli.run import run
from densarm.cli.verify import verify
from densarm.cli.view import view


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(densarm.__version__, message="%(version)s")
def application() -> None:
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


for command in (list_known, run, view, verify, bench, compare):
    application.add_command(command)
