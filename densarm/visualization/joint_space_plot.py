"""The joint space of an arm of two joints, and a motion in it."""

import numpy as np
from matplotlib.axes import Axes

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.trajectory import Trajectory
from densarm.visualization.figure_style import (
    BLACK,
    DENSITY_MAP,
    GREY,
    VERMILION,
    mark_goal,
    plane_grid,
)
from densarm.visualization.goal_density import goal_density
from densarm.visualization.joint_unit import joint_unit

_RESOLUTION = 120  # samples of each joint
_LEVELS = 18
_LOWEST_SHARE = 0.05  # of the finite values of ln ρ that are below the lowest level
_ROOM = 0.4  # around the motion [rad or m]


def plot_joint_space(axes: Axes, run: Trajectory) -> None:
    """Plot the unsafe set, level sets of ln ρ and the motion over the positions of two joints.

    Args:
        axes: to plot on.
        run: of an arm of two joints.
    """
    scenario = run.scenario
    arm = scenario.arm
    path = np.unwrap(arm.angles(run.q), axis=0)
    goal = path[-1] + arm.difference(run.q[-1], scenario.goal)
    first, second = plane_grid(_extent(run, np.vstack([path, goal])), _RESOLUTION)
    q = arm.configurations(np.column_stack([first.ravel(), second.ravel()]))
    value, h = _density_and_clearance(run, q)
    lowest, highest = np.quantile(value[np.isfinite(value)], [_LOWEST_SHARE, 1.0])
    levels = np.linspace(lowest, highest, _LEVELS)
    height = np.maximum(value, lowest - 1.0).reshape(first.shape)
    shades = axes.contourf(first, second, height, levels, cmap=DENSITY_MAP, extend="min")
    axes.figure.colorbar(shades, ax=axes, label="ln ρ", format="%.1f", shrink=0.75)
    if np.isfinite(h).all():
        h = h.reshape(first.shape)
        axes.contourf(first, second, h, levels=[-np.inf, 0.0], colors=[GREY])
        axes.contour(first, second, h, levels=[0.0], colors=[BLACK], linewidths=0.9)
    axes.plot(*path.T, color=VERMILION, linewidth=2.0, label="motion")
    axes.plot(*path[0], "o", color=VERMILION, markeredgecolor=BLACK, markersize=7, label="start")
    mark_goal(axes, goal)
    axes.set_aspect("equal")
    axes.set_xlabel(f"{arm.joint_names[0]} [{joint_unit(arm, 0)}]")
    axes.set_ylabel(f"{arm.joint_names[1]} [{joint_unit(arm, 1)}]")
    axes.set_title("joint space: unsafe set (grey) and ln ρ to the goal")
    axes.legend(loc="lower left", framealpha=0.95)


def _density_and_clearance(run: Trajectory, q: Array) -> tuple[Array, Array]:
    """Return ln ρ and h, the smallest clearance beyond the margin [m], at q (N, nq), as (N,)."""
    scenario = run.scenario
    clearance = Clearance(scenario.arm, scenario.scene)
    density = goal_density(scenario, clearance)
    values, smallest = [], []
    for configuration in q:
        values.append(density.evaluate(configuration).log_value)
        smallest.append(clearance.distance.min(initial=np.inf))
    return np.array(values), np.array(smallest) - scenario.control.margin


def _extent(run: Trajectory, points: Array) -> list[float]:
    """Return the bounds of both joints in turn: their limits, or a turn around the motion."""
    arm, extent = run.scenario.arm, []
    low, high = points.min(axis=0) - _ROOM, points.max(axis=0) + _ROOM
    for j in range(2):
        if arm.is_circle[j]:
            reach = max(np.pi, (high[j] - low[j]) / 2.0)
            middle = (low[j] + high[j]) / 2.0
            extent += [middle - reach, middle + reach]
        else:
            bounds = arm.limits.lower[j], arm.limits.upper[j]
            extent += [
                b if np.isfinite(b) else e for b, e in zip(bounds, (low[j], high[j]), strict=True)
            ]
    return extent
