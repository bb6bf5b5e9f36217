"""``densarm view``: show a recorded run."""

from pathlib import Path

import click

from densarm.cli.exit_status import ExitStatus
from densarm.cli.picture_options import picture_options, write_pictures


@click.command()
@click.argument("run", metavar="RUN.npz")
@picture_options
def view(run: str, html: Path | None, plot: Path | None, png: Path | None, gif: Path | None) -> int:
    """Show a recorded run: in the browser until Ctrl-C, or as files.

    Without options a page opens that plays the run in real time, with play, pause and a time line.
    With options it writes the files that they name and ends.

    \b
    Examples:
      densarm run swing_up --save swing_up.npz
      densarm view swing_up.npz
      densarm view swing_up.npz --gif swing_up.gif
    """  # noqa: D301
    from densarm.trajectory import Trajectory

    trajectory = Trajectory.load(run)
    if html or plot or png or gif:
        write_pictures(trajectory, html, plot, png, gif)
        return ExitStatus.SUCCESS
    from densarm.visualization.view import view as show

    show(trajectory, on_url=lambda url: click.echo(f"{url}  (Ctrl-C ends)"))
    return ExitStatus.SUCCESS
