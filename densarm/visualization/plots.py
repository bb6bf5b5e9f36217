"""The figure of a recorded run: joints with their limits, clearance, density, joint space."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.trajectory import Trajectory
from densarm.visualization.figure_file import save_figure
from densarm.visualization.figure_style import BLACK, BLUE, VERMILION, new_figure
from densarm.visualization.goal_density import goal_density, log_density
from densarm.visualization.joint_space_plot import plot_joint_space
from densarm.visualization.joint_unit import joint_unit
from densarm.visualization.summary_line import SummaryLine

_BEYOND = 0.12  # room drawn beyond limits, as a part of the distance between them
_LABEL_SIZE = 9.0  # [pt]
_NAME_LENGTH = 11.0  # characters that fit into an inch at that size
_HIGHEST = 300.0  # clearance that is of interest [mm]
_FLAT = 1e-3  # smallest height of a panel, in its unit
_DENSITY_SAMPLES = 500
_COLUMN_WIDTH, _JOINT_HEIGHT, _WIDE_HEIGHT = 3.6, 1.15, 1.9  # [inch]
_SPACE_WIDTH = 6.5  # [inch]


def save_plot(run: Trajectory, path: str | Path) -> None:
    """Plot a run: positions, velocities and torques with limits, clearance and density over time.

    For arms of two joints also their joint space: the unsafe set, level sets of ln ρ, the motion.

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
    nv, summary = run.scenario.arm.nv, SummaryLine.of(run)
    width, height = 3 * _COLUMN_WIDTH, nv * _JOINT_HEIGHT + 2 * _WIDE_HEIGHT + 0.9
    is_planar = nv == 2
    figure = new_figure(width + is_planar * _SPACE_WIDTH, max(height, _SPACE_WIDTH * is_planar))
    words = [summary.outcome, *summary.facts, summary.certificate]
    figure.suptitle(f"{summary.title}\n{' · '.join(words)}", fontsize=12)
    if is_planar:
        over_time, space = np.ravel(
            figure.subfigures(1, 2, width_ratios=[width, _SPACE_WIDTH], squeeze=False)
        )
        plot_joint_space(space.subplots(), run)
        _plot_over_time(over_time, run)
    else:
        _plot_over_time(figure, run)
    return figure


def _plot_over_time(figure: Figure | SubFigure, run: Trajectory) -> None:
    nv = run.scenario.arm.nv
    heights = [*nv * [_JOINT_HEIGHT], _WIDE_HEIGHT, _WIDE_HEIGHT]
    grid = figure.add_gridspec(nv + 2, 3, height_ratios=heights)
    first = figure.add_subplot(grid[0, 0])
    joints = [
        [first if j == k == 0 else figure.add_subplot(grid[j, k], sharex=first) for k in range(3)]
        for j in range(nv)
    ]
    _plot_joints(joints, run)
    clearance = figure.add_subplot(grid[nv, :], sharex=first)
    _plot_clearance(clearance, run)
    density = figure.add_subplot(grid[nv + 1, :], sharex=first)
    _plot_density(density, run)
    density.set_xlabel("time [s]")
    figure.align_ylabels()
    first.set_xlim(run.time[0], max(run.time[-1], run.time[0] + 1e-3))


def _plot_joints(rows: list[list[Axes]], run: Trajectory) -> None:
    """Plot position, velocity and torque of each joint, in a row of its own, with its limits."""
    arm = run.scenario.arm
    limits, angles = arm.limits, np.unwrap(arm.angles(run.q), axis=0)
    panels = (
        ("position", {"rad": "rad", "m": "m"}, angles, limits.lower, limits.upper),
        ("velocity", {"rad": "rad/s", "m": "m/s"}, run.v, -limits.velocity, limits.velocity),
        ("torque", {"rad": "N·m", "m": "N"}, run.tau, -limits.effort, limits.effort),
    )
    for column, (title, units, values, lower, upper) in enumerate(panels):
        rows[0][column].set_title(f"{title} (shaded: beyond limits)")
        for j, axes in enumerate(row[column] for row in rows):
            unit = units[joint_unit(arm, j)]
            axes.plot(run.time, values[:, j], color=BLUE, linewidth=1.3)
            _draw_limits(axes, values[:, j], lower[j], upper[j])
            is_limited = np.isfinite(upper[j] - lower[j])
            label = f"[{unit}]" if is_limited else f"[{unit}], no limit"
            name = arm.joint_names[j]
            size = min(_LABEL_SIZE, _JOINT_HEIGHT * _LABEL_SIZE * _NAME_LENGTH / len(name))
            axes.set_ylabel(f"{name}\n{label}" if column == 0 else label, fontsize=size)
            axes.tick_params(labelbottom=False)
            axes.grid(alpha=0.3)


def _draw_limits(axes: Axes, values: Array, lower: float, upper: float) -> None:
    """Shade what lies beyond the limits, and show a part of it whatever the values are."""
    low, high = min(values.min(), lower), max(values.max(), upper)
    if not np.isfinite(high - low):  # only limits can be infinite
        low, high = float(values.min()), float(values.max())
        room = max(_BEYOND * (high - low), _FLAT)
        axes.set_ylim(low - room, high + room)
        return
    room = _BEYOND * (high - low)
    axes.set_ylim(low - room, high + room)
    for limit, end in ((lower, low - room), (upper, high + room)):
        axes.axhspan(limit, end, color=VERMILION, alpha=0.18, linewidth=0.0)
        axes.axhline(limit, color=VERMILION, linewidth=0.9)


def _plot_clearance(axes: Axes, run: Trajectory) -> None:
    margin = 1e3 * run.scenario.control.margin
    axes.set_ylabel("clearance [mm]")
    axes.tick_params(labelbottom=False)
    axes.grid(alpha=0.3)
    if not np.isfinite(run.clearance).all():
        axes.text(0.5, 0.5, "no pairs", transform=axes.transAxes, ha="center")
        return
    clearance = 1e3 * run.clearance
    axes.plot(run.time, clearance, color=BLACK, linewidth=1.3)
    k = int(np.argmin(clearance))
    axes.plot(run.time[k], clearance[k], "o", color=VERMILION, markersize=4)
    words = f"smallest {clearance[k]:.4g} mm at {run.time[k]:.2f} s, margin {margin:g} mm"
    axes.set_title(words, loc="right")
    top = max(min(clearance.max(), _HIGHEST), 2.0 * clearance[k], 2.0 * margin)
    axes.set_ylim(min(-0.08 * top, 1.1 * clearance[k]), 1.05 * top)
    axes.axhspan(axes.get_ylim()[0], margin, color=VERMILION, alpha=0.18, linewidth=0.0)
    axes.axhline(margin, color=VERMILION, linewidth=0.9)


def _plot_density(axes: Axes, run: Trajectory) -> None:
    scenario = run.scenario
    density = goal_density(scenario, Clearance(scenario.arm, scenario.scene))
    rows = np.unique(np.linspace(0, len(run.time) - 1, _DENSITY_SAMPLES).astype(int))
    axes.plot(run.time[rows], log_density(density, run.q[rows]), color=BLACK, linewidth=1.3)
    axes.set_ylabel("ln ρ")
    sensed = f"{scenario.sensing.distance * 1e3:g} mm"
    axes.set_title(f"density to the goal, obstacles sensed within {sensed}", loc="right")
    axes.grid(alpha=0.3)
