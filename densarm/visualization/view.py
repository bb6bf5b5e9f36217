"""A recorded run on the screen: live in the browser, or as one HTML file."""

from collections.abc import Callable
from pathlib import Path

from densarm.trajectory import Trajectory
from densarm.visualization.html_page import write_html
from densarm.visualization.playback import play


def view(run: Trajectory, on_url: Callable[[str], object] = print) -> None:
    """Play a run in the browser, in real time, again and again until Ctrl-C.

    Args:
        run: what to play.
        on_url: told the page's address, which opens by itself where there is a browser.

    Raises:
        KeyboardInterrupt: on Ctrl-C.
    """
    scenario = run.scenario
    goal = scenario.goal
    play(scenario.arm, scenario.scene, run.time, run.q, goal, on_url=on_url)


def save_html(run: Trajectory, path: str | Path) -> None:
    """Write one HTML file that plays a run from disk, without a network.

    Args:
        run: what to play.
        path: the file; its folder must exist.

    Raises:
        FileContentError: the file cannot be written.
    """
    scenario = run.scenario
    write_html(
        path,
        scenario.arm,
        scenario.scene,
        run.time,
        run.q,
        scenario.goal,
        title=scenario.title,
        subtitle=f"{run.outcome.description} {run.detail}".strip(),
    )
