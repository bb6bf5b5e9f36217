"""What the scripts of the paper's figures have in common: arguments, axes, regions, a report."""

import argparse
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from densarm.euclidean.implicit import ImplicitFunction, smallest_value
from densarm.values.arrays import Array
from densarm.values.files import atomic_file
from densarm.values.outcome import Outcome
from densarm.visualization.figure_style import BLACK, GREY, OUTCOME_COLOUR, plane_grid

RESULT_FILE = "result.json"


@dataclass(frozen=True)
class FigureReport:
    """A figure's claim, whether it holds, and the numbers that tell so."""

    figure: str
    """Which figure, e.g. "Fig. 3"."""
    claim: str
    """The claim, in a sentence."""
    holds: bool
    """Whether the numbers bear the claim out."""
    numbers: dict[str, Any]
    """The numbers, by name with their unit; JSON values."""

    def write(self, folder: Path) -> None:
        """Write result.json into an existing folder and print the verdict.

        Raises:
            FileContentError: the file cannot be written.
        """
        text = json.dumps(asdict(self), indent=2, ensure_ascii=False)
        with atomic_file(folder / RESULT_FILE) as file:
            file.write((text + "\n").encode())
        verdict = "holds" if self.holds else "does not hold"
        print(f"{self.figure}: {self.claim}\n  {verdict}; see {folder / RESULT_FILE}")


@dataclass(frozen=True)
class FigureArguments:
    """Arguments of the script of a figure."""

    out: Path
    """Folder of its pictures and result.json; it exists."""
    starts: int
    """Number of starts or runs."""


def figure_arguments(
    description: str, starts: int, arguments: Sequence[str] | None = None
) -> FigureArguments:
    """Read the arguments of a figure's script and make its output folder.

    Args:
        description: what the script shows.
        starts: default number of starts.
        arguments: in place of the command line's.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="output folder")
    parser.add_argument("--starts", type=int, default=starts, help="starts (default %(default)s)")
    parsed = parser.parse_args(arguments)
    parsed.out.mkdir(parents=True, exist_ok=True)
    return FigureArguments(parsed.out, parsed.starts)


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


def legend_once(axes: Axes, location: Literal["lower left", "upper right"]) -> None:
    """Add a legend with one entry of each name, however many artists have it."""
    handles, names = axes.get_legend_handles_labels()
    entries = dict(zip(names, handles, strict=True))
    axes.legend(list(entries.values()), list(entries), loc=location, framealpha=0.95, fontsize=7)


def outcome_colours(outcomes: Iterable[str]) -> list[str]:
    """Return the colour of each outcome."""
    return [OUTCOME_COLOUR[Outcome(outcome)] for outcome in outcomes]
