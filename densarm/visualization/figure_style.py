"""The one style of all figures: colours, and how they are begun and written."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.files import atomic_file
from densarm.values.outcome import FAILED, Outcome

# M. Okabe, K. Ito, Color Universal Design, 2008: told apart by colour-blind readers.
BLUE, ORANGE, GREEN, VERMILION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, GREY, BLACK = "#CC79A7", "#56B4E9", "#8C8C8C", "#000000"
DENSITY_MAP = "viridis"
"""Colour map of densities: even in lightness, so it survives grey print."""

OUTCOME_COLOUR: dict[str, str] = {
    Outcome.REACHED: BLUE,
    Outcome.STUCK: ORANGE,
    Outcome.COLLIDED: VERMILION,
    Outcome.TIMED_OUT: PURPLE,
    Outcome.INFEASIBLE: GREY,
}
END_COLOUR = {FAILED: BLACK, Outcome.NO_PATH: SKY, **OUTCOME_COLOUR}
"""Of every way that a run of many can end, `RUN_ENDS`."""

_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.0,
    "svg.hashsalt": "densarm",
}


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches, to be drawn without a display."""
    with rc_context(_STYLE):
        figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a file ending in .png, .pdf or .svg, in a folder that exists."""
    path = Path(path)
    kind = path.suffix.removeprefix(".").lower()
    if kind not in ("png", "pdf", "svg"):
        raise InvalidValueError("plot", str(path), "a file ending in .png, .pdf, .svg")
    with atomic_file(path) as file:
        figure.savefig(file, format=kind)


def plane_grid(extent: Sequence[float], resolution: int = 400) -> tuple[Array, Array]:
    """Return the coordinates (M, M) of a grid on an extent, the bounds of x₁ and x₂ in turn."""
    axes = (np.linspace(low, high, resolution) for low, high in np.reshape(extent, (2, 2)))
    first, second = np.meshgrid(*axes)
    return first, second


def mark_goal(axes: Axes, goal: Array) -> None:
    """Mark the goal by a green star."""
    axes.plot(
        *([value] for value in goal), "*", color=GREEN, markersize=13, markeredgecolor=BLACK,
        markeredgewidth=0.6, zorder=6, label="goal",
    )  # fmt: skip
