"""Options of the commands that show a run, and the files that they name."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from densarm.cli.output_option import output_option

if TYPE_CHECKING:
    from densarm.trajectory import Trajectory

_OPTIONS = (
    output_option("--html", "RUN.html", "Write a page that plays the run."),
    output_option(
        "--plot",
        "RUN.png",
        "Plot positions, velocities, torques, clearance and density over time.",
        endings=(".png", ".pdf", ".svg"),
    ),
    output_option(
        "--png", "RUN.png", "Write a picture of the moment of smallest clearance.", (".png",)
    ),
    output_option("--gif", "RUN.gif", "Write an animated picture, in real time.", (".gif",)),
)


def picture_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add --html, --plot, --png and --gif to a command."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def write_pictures(
    run: "Trajectory", html: Path | None, plot: Path | None, png: Path | None, gif: Path | None
) -> None:
    """Write the files that were asked for.

    Args:
        run: what they show.
        html: a page that plays it.
        plot: its plots.
        png: a still.
        gif: an animation.

    Raises:
        FileContentError: a file cannot be written.
    """
    # Matplotlib and meshcat take a second to import.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it tells of its font cache
    if html:
        from densarm.visualization.view import save_html

        save_html(run, html)
    if plot:
        from densarm.visualization.plots import save_plot

        save_plot(run, plot)
    if png:
        from densarm.visualization.picture_file import save_picture

        save_picture(run, png)
    if gif:
        from densarm.visualization.picture_file import save_animation

        save_animation(run, gif)
