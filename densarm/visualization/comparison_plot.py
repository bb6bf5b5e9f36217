"""The figure of a comparison: outcomes and measures of every method."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from densarm.outcome import RUN_ENDS, Outcome
from densarm.study.comparison import Comparison
from densarm.visualization.figure_file import save_figure
from densarm.visualization.figure_style import BLACK, BLUE, GREY, OUTCOME_COLOUR, new_figure

_PANELS = {
    "time_s": ("time [s]", 1.0),
    "path_length_rad": ("path [rad]", 1.0),
    "min_clearance_m": ("smallest clearance [mm]", 1e3),
    "effort": ("effort ∫τ² dt [N²m²s]", 1.0),
    "step_us": ("step [µs]", 1.0),
}


def save_comparison_plot(comparison: Comparison, path: str | Path) -> None:
    """Plot how the runs of each method ended, and the measures of those that reached the goal.

    Args:
        comparison: what to plot.
        path: the file, ending in .png, .pdf or .svg; its folder must exist.

    Raises:
        InvalidValueError: another ending.
        FileContentError: the file cannot be written.
    """
    save_figure(comparison_figure(comparison), path)


def comparison_figure(comparison: Comparison) -> Figure:
    """Return the figure that `save_comparison_plot` writes."""
    rows = len(comparison.methods)
    figure = new_figure(10.0, 2.4 + 0.55 * rows)
    figure.suptitle(
        f"{comparison.scenario}, {comparison.starts} starts: a dot a run that reached the goal, "
        "a line at the median (steps: of all runs)"
    )
    panels = figure.subplots(2, 3, sharey=True).ravel()
    _plot_outcomes(panels[0], comparison)
    for axes, (measure, (label, scale)) in zip(panels[1:], _PANELS.items(), strict=True):
        _plot_measure(axes, comparison, measure, scale)
        axes.set_xlabel(label)
    panels[0].set_yticks(range(rows), [result.method for result in comparison.methods])
    panels[0].set_ylim(rows - 0.5, -0.5)
    figure.legend(loc="outside lower center", ncols=len(RUN_ENDS), frameon=False)
    return figure


def _plot_outcomes(axes: Axes, comparison: Comparison) -> None:
    left = np.zeros(len(comparison.methods))
    for outcome in RUN_ENDS:
        counts = np.array([result.count(outcome) for result in comparison.methods])
        if not counts.any():
            continue
        known = outcome in list(Outcome)
        colour = OUTCOME_COLOUR.get(Outcome(outcome), GREY) if known else BLACK
        axes.barh(range(len(counts)), counts, left=left, height=0.6, color=colour, label=outcome)
        left += counts
    axes.set_xlim(0, comparison.starts)
    axes.set_xlabel("runs")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _plot_measure(axes: Axes, comparison: Comparison, measure: str, scale: float) -> None:
    for row, result in enumerate(comparison.methods):
        values = scale * np.array(result.values(measure))
        axes.plot(values, np.full(len(values), row), "o", color=BLUE, markersize=4, alpha=0.5)
        median = result.median(measure)
        if median is not None:
            axes.plot([scale * median] * 2, [row - 0.3, row + 0.3], color=BLACK, linewidth=1.5)
    axes.set_xlim(left=0.0)
    axes.grid(axis="x", alpha=0.3)
