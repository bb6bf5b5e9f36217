"""``densarm view``: play a recorded run in the browser."""

import click

from densarm.cli.exit_status import ExitStatus


@click.command()
@click.argument("run", metavar="RUN.npz")
def view(run: str) -> int:
    """Play a recorded run in the browser, in real time, until Ctrl-C.

    \b
    Example:
      densarm run swing_up --save swing_up.npz
      densarm view swing_up.npz
    """  # noqa: D301
    from densarm.trajectory import Trajectory
    from densarm.visualization.view import view as play

    play(Trajectory.load(run), on_url=lambda url: click.echo(f"{url}  (Ctrl-C ends)"))
    return ExitStatus.SUCCESS
