"""What the scripts of the paper's figures have in common: arguments, axes, regions, a report."""

import argparse
import json
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from densarm.euclidean.implicit import ImplicitFunction, smallest_value
from densarm.euclidean.runs import PointRuns
from densarm.values.arrays import Array
from densarm.values.files import atomic_file
from densarm.values.outcome import Outcome
from densarm.visualization.figure_style import BLACK, GREY, OUTCOME_COLOUR, plane_grid

RESULT_FILE = "result.json"
THETA = (
    "θ = 0, where the theorem asks for θ > 0: with θ > 0 starts close to an unsafe set enter it."
)
GAUGE = "Curves follow ∇ ln ρ, which has the direction of ∇ρ and not its length."
NO_NUMBERS = "Sets, sensing regions and goal are chosen: the paper gives none."
_LETTERS_PER_INCH, _LINE_HEIGHT = 17.0, 0.135  # of the text at a picture's foot [in]


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
    departures: tuple[str, ...] = ()
    """Where it departs from the paper, or chooses what that leaves open, a sentence each: the
    picture's foot, result.json and the gallery have them from here."""

    def write(self, folder: Path, **pictures: Figure) -> None:
        """Write result.json and the pictures, by name, into an existing folder; print the verdict.

        Raises:
            FileContentError: a file cannot be written.
        """
        for name, picture in pictures.items():
            save_figure(picture, folder, name, self.departures)
        text = json.dumps(asdict(self), indent=2, ensure_ascii=False)
        with atomic_file(folder / RESULT_FILE) as file:
            file.write((text + "\n").encode())
        verdict = "holds" if self.holds else "does not hold"
        print(f"{self.figure}: {self.claim}\n  {verdict}; see {folder / RESULT_FILE}")
        for departure in self.departures:
            print(f"  departs: {departure}")


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


def blend_departure(radius: float) -> str:
    """Return how the control is blended at the goal, within two radii [m]."""
    return (
        "Near the goal the control is blended into −e as Remark 2 has it, with τ = 2 − ‖e‖/δ and "
        f"δ = {radius:g} m, which the paper leaves open."
    )


def arrivals(runs: PointRuns, radius: float) -> dict[str, int]:
    """Return how many of the runs arrive within a radius [m] in 120 and in 1200 s."""
    late = [np.searchsorted(runs.time, limit + 1e-6) - 1 for limit in (120.0, 1200.0)]
    soon, all_told = (int((runs.error[k] <= radius).sum()) for k in late)
    return {
        "starts": runs.error.shape[1],
        "collided": runs.count(Outcome.COLLIDED),
        "reached_within_120_s": soon,
        "reached_within_1200_s": all_told,
    }


def gain_departure(alpha: float, gain: float, plain: dict[str, Any]) -> str:
    """Return what α and gain run, and how many starts arrive, in s, by α = 1 and no gain."""
    soon, all_told = plain["reached_within_120_s"], plain["reached_within_1200_s"]
    return (
        f"α = {alpha:g} and a gain of {gain:g}: the paper finds α of 1 to 10 to work, and has no "
        f"gain. With α = 1 and none, of {plain['starts']} starts {soon} arrive in 120 s and "
        f"{all_told} in 1200 s."
    )


def save_figure(
    figure: Figure, folder: Path, name: str, departures: Sequence[str] = ()
) -> list[Path]:
    """Write a figure, departures at its foot, as NAME.png and NAME.pdf; return both paths.

    Raises:
        FileContentError: a file cannot be written.
    """
    width, height = figure.get_size_inches()
    foot = 0.0
    if departures:
        letters = int(_LETTERS_PER_INCH * width)
        lines = [
            textwrap.fill(f"– {each}", letters, subsequent_indent="   ") for each in departures
        ]
        text = "\n".join(["Departures from the paper:", *lines])
        # Below the figure, whose layout it so leaves alone.
        figure.text(0.1 / width, 0.0, text, fontsize=7.5, va="top")
        foot = _LINE_HEIGHT * (text.count("\n") + 2)
    paths = [folder / f"{name}.{kind}" for kind in ("png", "pdf")]
    for path in paths:
        metadata = {"CreationDate": None} if path.suffix == ".pdf" else None
        shown = Bbox.from_bounds(0.0, -foot, width, height + foot)
        with atomic_file(path) as file:
            figure.savefig(file, format=path.suffix[1:], metadata=metadata, bbox_inches=shown)
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
