"""The figure of a recorded run: joints with their limits, clearance, density, joint space."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from densarm.arms.arm import Arm
from densarm.density.navigation_density import NavigationDensity, density_towards
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.visualization.figure_style import (
    BLACK,
    BLUE,
    DENSITY_MAP,
    GREY,
    VERMILION,
    mark_goal,
    new_figure,
    plane_grid,
    save_figure,
)
from densarm.visualization.render_scene import SummaryLine
from densarm.world.world import World

_BEYOND = 0.12  # room drawn beyond limits, as a part of the distance between them
_LABEL_SIZE = 9.0  # [pt]
_NAME_LENGTH = 11.0  # characters that fit into an inch at that size
_HIGHEST = 300.0  # clearance that is of interest [mm]
_FLAT = 1e-3  # smallest height of a panel, in its unit
_DENSITY_SAMPLES = 500
_COLUMN_WIDTH, _JOINT_HEIGHT, _WIDE_HEIGHT = 3.6, 1.15, 1.9  # [inch]
_SPACE_WIDTH = 6.5  # [inch]

_RESOLUTION = 120  # samples of each joint in the joint space
_LEVELS = 18
_SHOWN = (0.05, 0.98)  # quantiles of ln ρ at the lowest and highest level: it is unbounded
_AROUND = 0.4  # drawn around the motion [rad or m]


def save_plot(run: Run, path: str | Path) -> None:
    """Plot a run: positions, velocities and torques with limits, clearance and density over time.

    For arms of two joints also their joint space: the unsafe set, level sets of ln ρ, the motion.
    Where the run has no goal, there is no density.

    Args:
        run: what to plot.
        path: the file, ending in .png, .pdf or .svg; its folder must exist.

    Raises:
        InvalidValueError: another ending.
        FileContentError: the file cannot be written.
    """
    save_figure(run_figure(run), path)


def run_figure(run: Run) -> Figure:
    """Return the figure that `save_plot` writes."""
    task, summary = run.task, SummaryLine.of(run)
    nv, world = task.arm.nv, World(task.arm, task.scene)
    density = None
    if task.goal is not None:  # the plain density, with the task's largest sensing distances
        density = density_towards(
            world,
            task.goal,
            margin=task.margin,
            kappa=task.kappa,
            parameters=task.density,
            sensing=task.sensing,
        )
    heights = [*nv * [_JOINT_HEIGHT], _WIDE_HEIGHT, *([] if density is None else [_WIDE_HEIGHT])]
    width, height = 3 * _COLUMN_WIDTH, sum(heights) + 0.9
    is_planar = nv == 2
    figure = new_figure(width + is_planar * _SPACE_WIDTH, max(height, _SPACE_WIDTH * is_planar))
    words = " · ".join(text for text, _ in summary.words)
    figure.suptitle(f"{summary.title}\n{words}", fontsize=12)
    over_time: Figure | SubFigure = figure
    if is_planar:
        over_time, space = np.ravel(
            figure.subfigures(1, 2, width_ratios=[width, _SPACE_WIDTH], squeeze=False)
        )
        _plot_joint_space(space.subplots(), run, world, density)
    _plot_over_time(over_time, heights, run, world, density)
    return figure


def _log_values(density: NavigationDensity, q: Array) -> Array:
    """Return ln ρ at configurations (N, nq), infinite where it is."""
    return np.array([density.evaluate(configuration).log_value for configuration in q])


def _plot_over_time(
    figure: Figure | SubFigure,
    heights: list[float],
    run: Run,
    world: World,
    density: NavigationDensity | None,
) -> None:
    nv = run.task.arm.nv
    grid = figure.add_gridspec(len(heights), 3, height_ratios=heights)
    first = figure.add_subplot(grid[0, 0])
    joints = [
        [first if j == k == 0 else figure.add_subplot(grid[j, k], sharex=first) for k in range(3)]
        for j in range(nv)
    ]
    _plot_joints(joints, run)
    last = figure.add_subplot(grid[nv, :], sharex=first)
    _plot_clearance(last, run)
    if density is not None:
        last.tick_params(labelbottom=False)
        last = figure.add_subplot(grid[nv + 1, :], sharex=first)
        _plot_density(last, run, world, density)
    last.set_xlabel("time [s]")
    figure.align_ylabels()
    first.set_xlim(run.time[0], max(run.time[-1], run.time[0] + 1e-3))


def _plot_joints(rows: list[list[Axes]], run: Run) -> None:
    """Plot position, velocity and torque of each joint, in a row of its own, with its limits."""
    arm = run.task.arm
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


def _plot_clearance(axes: Axes, run: Run) -> None:
    margin = 1e3 * run.task.margin
    axes.set_ylabel("clearance [mm]")
    axes.grid(alpha=0.3)
    if not np.isfinite(run.clearance).all():
        axes.text(0.5, 0.5, "no pairs", transform=axes.transAxes, ha="center")
        return
    clearance = 1e3 * run.clearance
    axes.plot(run.time, clearance, color=BLACK, linewidth=1.3)
    k = int(np.argmin(clearance))
    axes.plot(run.time[k], clearance[k], "o", color=VERMILION, markersize=4)
    words = f"smallest {clearance[k]:.4g} mm at {run.time[k]:.2f} s, margin {margin:g} mm"
    axes.set_title(words, loc="left")
    top = max(min(clearance.max(), _HIGHEST), 2.0 * clearance[k], 2.0 * margin)
    axes.set_ylim(min(-0.08 * top, 1.1 * clearance[k]), 1.05 * top)
    axes.axhspan(axes.get_ylim()[0], margin, color=VERMILION, alpha=0.18, linewidth=0.0)
    axes.axhline(margin, color=VERMILION, linewidth=0.9)


def _plot_density(axes: Axes, run: Run, world: World, density: NavigationDensity) -> None:
    rows = np.unique(np.linspace(0, len(run.time) - 1, _DENSITY_SAMPLES).astype(int))
    values = np.empty(len(rows))
    for k, row in enumerate(rows):
        world.set_time(float(run.time[row]))
        values[k] = density.evaluate(run.q[row]).log_value
    shown = np.where(np.isfinite(values), values, np.nan)
    axes.plot(run.time[rows], shown, color=BLACK, linewidth=1.3)
    axes.set_ylabel("ln ρ")
    sensed = f"{run.task.sensing.distance * 1e3:g} mm"
    axes.set_title(f"density to the goal, obstacles sensed within {sensed}", loc="left")
    axes.grid(alpha=0.3)


def _plot_joint_space(
    axes: Axes, run: Run, world: World, density: NavigationDensity | None
) -> None:
    """Plot the unsafe set, level sets of ln ρ and the motion over the positions of two joints."""
    arm, goal = run.task.arm, run.task.goal
    path = np.unwrap(arm.angles(run.q), axis=0)
    end = path[-1:] if goal is None else path[-1:] + arm.difference(run.q[-1], goal)
    first, second = plane_grid(_extent(arm, np.vstack([path, end])), _RESOLUTION)
    if density is not None:
        q = arm.configurations(np.column_stack([first.ravel(), second.ravel()]))
        value = _log_values(density, q)
        lowest, highest = np.quantile(value[np.isfinite(value)], _SHOWN)
        levels = np.linspace(lowest, highest, _LEVELS)
        height = np.clip(value, lowest - 1.0, highest + 1.0).reshape(first.shape)
        shades = axes.contourf(first, second, height, levels, cmap=DENSITY_MAP, extend="both")
        axes.figure.colorbar(shades, ax=axes, label="ln ρ", format="%.1f", shrink=0.75)
    draw_unsafe_set(axes, world, first, second, run.task.margin)
    axes.plot(*path.T, color=VERMILION, linewidth=2.0, label="motion")
    axes.plot(*path[0], "o", color=VERMILION, markeredgecolor=BLACK, markersize=7, label="start")
    if goal is not None:
        mark_goal(axes, end[0])
    axes.set_aspect("equal")
    axes.set_xlabel(f"{arm.joint_names[0]} [{joint_unit(arm, 0)}]")
    axes.set_ylabel(f"{arm.joint_names[1]} [{joint_unit(arm, 1)}]")
    shaded = "unsafe set (grey)" if density is None else "unsafe set (grey) and ln ρ to the goal"
    moving = ", obstacles as they begin" if world.fastest_obstacle > 0.0 else ""
    axes.set_title(f"joint space: {shaded}{moving}")
    axes.legend(loc="lower left", framealpha=0.95)


def draw_unsafe_set(axes: Axes, world: World, first: Array, second: Array, margin: float) -> None:
    """Draw where an arm of two joints touches something, or keeps no more than a margin [m].

    Args:
        axes: over the positions of both joints.
        world: the arm among obstacles.
        first: positions of the first joint on a grid (M, M) [rad or m].
        second: positions of the second.
        margin: distance that is unsafe.
    """
    q = world.arm.configurations(np.column_stack([first.ravel(), second.ravel()]))
    clearance = np.array([world.distances(each).min(initial=np.inf) for each in q])
    if np.isfinite(clearance).all():
        h = (clearance - margin).reshape(first.shape)
        axes.contourf(first, second, h, levels=[-np.inf, 0.0], colors=[GREY])
        axes.contour(first, second, h, levels=[0.0], colors=[BLACK], linewidths=0.9)


def _extent(arm: Arm, points: Array) -> list[float]:
    """Return the bounds of both joints in turn: their limits, or a turn around the motion."""
    extent: list[float] = []
    low, high = points.min(axis=0) - _AROUND, points.max(axis=0) + _AROUND
    for j in range(2):
        if arm.continuous[j]:
            reach = max(np.pi, (high[j] - low[j]) / 2.0)
            middle = (low[j] + high[j]) / 2.0
            extent += [middle - reach, middle + reach]
        else:
            bounds = arm.limits.lower[j], arm.limits.upper[j]
            extent += [
                b if np.isfinite(b) else e for b, e in zip(bounds, (low[j], high[j]), strict=True)
            ]
    return extent


def joint_unit(arm: Arm, joint: int) -> str:
    """Return the unit of a joint's position: "m" where it slides, else "rad"."""
    kind = arm.model.joints[joint + 1].shortname().removeprefix("JointModel")
    return "m" if kind.startswith("P") else "rad"
