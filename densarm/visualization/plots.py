"""Plots of a recorded run over time: joint positions, velocities, torques and clearance."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.typing import ColorType

from densarm.arrays import Array
from densarm.trajectory import Trajectory
from densarm.visualization.figure_file import save_figure

_NEAR = 0.5  # of the plotted range


def save_plot(run: Trajectory, path: str | Path) -> None:
    """Plot a run over time: joint positions, velocities and torques with limits, and clearance.

    Args:
        run: what to plot.
        path: the file, ending in .png, .pdf or .svg; its folder must exist.

    Raises:
        InvalidValueError: another ending.
        FileContentError: the file cannot be written.
    """
    save_figure(run_figure(run), path)


def run_figure(run: Trajectory) -> Figure:
    """Return the figure that `save_plot` writes."""
    arm = run.scenario.arm
    limits, angles = arm.limits, np.unwrap(arm.angles(run.q), axis=0)
    figure = Figure(figsize=(9.0, 10.0), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    end = f"{run.outcome}, {run.time[-1]:.2f} s (dashed: limits)"
    figure.suptitle(f"{run.scenario.title}\n{end}", fontsize=12)
    axes = figure.subplots(4, 1, sharex=True)
    _plot_joints(axes[0], run.time, angles, limits.lower, limits.upper, "position [rad or m]")
    _plot_joints(axes[1], run.time, run.v, -limits.velocity, limits.velocity, "velocity [per s]")
    _plot_joints(axes[2], run.time, run.tau, -limits.effort, limits.effort, "torque [N·m or N]")
    _plot_clearance(axes[3], run)
    lines = axes[0].get_lines()[: arm.nv]
    figure.legend(lines, arm.joint_names, loc="outside lower center", ncols=4, frameon=False)
    axes[3].set_xlabel("time [s]")
    return figure


def _plot_joints(
    axes: Axes, time: Array, values: Array, lower: Array, upper: Array, label: str
) -> None:
    """Plot values (N, nv), with the limits (nv,) of the joints that come near theirs."""
    lines = axes.plot(time, values, linewidth=1.3)
    near = _NEAR * max(np.ptp(values), 1e-6)
    for j, line in enumerate(lines):
        low, high = values[:, j].min() - near, values[:, j].max() + near
        for limit in (lower[j], upper[j]):
            if low < limit < high:
                _draw_limit(axes, limit, line.get_color())
    _label(axes, label)


def _plot_clearance(axes: Axes, run: Trajectory) -> None:
    margin = run.scenario.control.margin
    _label(axes, "clearance [m]")
    if not np.isfinite(run.clearance).all():
        axes.text(0.5, 0.5, "no pairs", transform=axes.transAxes, ha="center")
        return
    axes.plot(run.time, run.clearance, color="black", linewidth=1.3)
    k = int(np.argmin(run.clearance))
    smallest, at = run.clearance[k], run.time[k]
    axes.plot(at, smallest, "o", color="tab:red", markersize=4)
    axes.set_title(f"smallest {smallest * 1e3:.4g} mm at {at:.2f} s", fontsize=10, loc="right")
    axes.set_ylim(bottom=min(0.0, 1.1 * smallest))
    axes.axhspan(axes.get_ylim()[0], margin, color="tab:red", alpha=0.2, linewidth=0.0)
    _draw_limit(axes, margin, "tab:red")


def _draw_limit(axes: Axes, value: float, color: ColorType) -> None:
    axes.axhline(value, color=color, linestyle="--", linewidth=0.8, alpha=0.7)


def _label(axes: Axes, label: str) -> None:
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)
    axes.margins(x=0.0)
