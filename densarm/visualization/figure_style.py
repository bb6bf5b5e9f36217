"""The one style of the figures on the plane and in space: colours, axes, regions, curves."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from densarm.arrays import Array
from densarm.atomic_file import atomic_file
from densarm.density.implicit_function import ImplicitFunction, smallest_value
from densarm.outcome import Outcome

# M. Okabe, K. Ito, Color Universal Design, 2008: told apart by colour-blind readers.
BLUE, ORANGE, GREEN, VERMILION = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, GREY, BLACK = "#CC79A7", "#56B4E9", "#8C8C8C", "#000000"
DENSITY_MAP = "viridis"
"""Colour map of densities: even in lightness, so it survives grey print."""

OUTCOME_COLOUR = {
    Outcome.REACHED: BLUE,
    Outcome.STUCK: ORANGE,
    Outcome.COLLIDED: VERMILION,
    Outcome.TIMED_OUT: PURPLE,
    Outcome.INFEASIBLE: GREY,
}

_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.0,
    "svg.hashsalt": "densarm",
}
_RESOLUTION = 400  # samples along each axis of a region's picture


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches, to be drawn without a display."""
    with rc_context(_STYLE):
        figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as NAME.png and NAME.pdf into a folder and return both paths.

    Raises:
        FileContentError: a file cannot be written.
    """
    paths = [folder / f"{name}.{kind}" for kind in ("png", "pdf")]
    for path in paths:
        metadata = {"CreationDate": None} if path.suffix == ".pdf" else None
        with atomic_file(path) as file:
            figure.savefig(file, format=path.suffix[1:], metadata=metadata)
    return paths


def plane_axes(axes: Axes, extent: Sequence[float], title: str) -> None:
    """Set up axes of the plane, (x₁ min, x₁ max, x₂ min, x₂ max) [m], at equal scales."""
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=9.5)
    axes.set_xlabel("$x_1$ [m]")
    axes.set_ylabel("$x_2$ [m]")


def space_axes(axes: Any, extent: Sequence[float], title: str) -> None:
    """Set up axes of space, the bounds of x₁, x₂ and x₃ in turn [m], at equal scales."""
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.set_zlim(extent[4], extent[5])
    axes.set_box_aspect(np.diff(extent)[::2].tolist(), zoom=0.85)
    axes.set_title(title, fontsize=9.5)
    axes.set_xlabel("$x_1$ [m]")
    axes.set_ylabel("$x_2$ [m]")
    axes.set_zlabel("$x_3$ [m]")


def plane_grid(extent: Sequence[float], resolution: int = _RESOLUTION) -> tuple[Array, Array]:
    """Return the coordinates (M, M) of a grid on an extent as (x₁, x₂) [m]."""
    along = np.linspace(extent[0], extent[1], resolution)
    across = np.linspace(extent[2], extent[3], resolution)
    first, second = np.meshgrid(along, across)
    return first, second


def shade_unsafe(
    axes: Axes, obstacles: Sequence[ImplicitFunction], extent: Sequence[float]
) -> None:
    """Fill the unsafe sets of the plane in grey."""
    first, second = plane_grid(extent)
    h = smallest_value(obstacles, np.stack([first, second], axis=-1))
    axes.contourf(first, second, h, levels=[-np.inf, 0.0], colors=[GREY], zorder=2)
    axes.contour(first, second, h, levels=[0.0], colors=[BLACK], linewidths=0.8, zorder=2)


def outline_sensing(
    axes: Axes, sensing: Sequence[ImplicitFunction], extent: Sequence[float]
) -> None:
    """Draw the rims of the sensing regions of the plane, dashed."""
    first, second = plane_grid(extent)
    x = np.stack([first, second], axis=-1)
    for s in sensing:
        axes.contour(
            first, second, s(x), levels=[0.0], colors=[BLACK], linewidths=0.8, linestyles="--"
        )


def draw_curves(
    axes: Axes, paths: Sequence[Array], colours: Sequence[str], width: float = 0.7
) -> None:
    """Draw curves (M_i, n) of the plane or space, one colour each."""
    for path, colour in zip(paths, colours, strict=True):
        axes.plot(*path.T, color=to_rgba(colour, 0.75), linewidth=width, zorder=3)


def mark_goal(axes: Axes, goal: Array) -> None:
    """Mark the goal by a green star."""
    axes.plot(
        *([value] for value in goal), "*", color=GREEN, markersize=13, markeredgecolor=BLACK,
        markeredgewidth=0.6, zorder=6, label="goal",
    )  # fmt: skip


def legend_once(axes: Axes, location: Literal["lower left", "upper right"]) -> None:
    """Add a legend with one entry of each name, however many artists have it."""
    handles, names = axes.get_legend_handles_labels()
    entries = dict(zip(names, handles, strict=True))
    axes.legend(list(entries.values()), list(entries), loc=location, framealpha=0.95, fontsize=7)


def outcome_colours(outcomes: Sequence[str]) -> list[str]:
    """Return the colour of each outcome."""
    return [OUTCOME_COLOUR[Outcome(outcome)] for outcome in outcomes]
