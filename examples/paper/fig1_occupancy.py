"""Fig. 1: the density is an occupancy measure: the time that its own trajectories spend.

With k = ∇ρ, starts drawn with density g = ∇·(ρk), and those that cross the border into the
picture, spend the time ρ(x) dx around x, for ρ solves ∇·(ρk) = g. Where g is negative it
counts so. The time is measured along trajectories and compared with ρ cell by cell.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import paper_figure as paper
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity, rantzer_map
from densarm.euclidean.implicit import Placed, UnsafeRegion, smallest_value
from densarm.euclidean.integral_curves import CurveParameters, IntegralCurves, integral_curves
from densarm.euclidean.shapes import Ball, Ellipsoid
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.visualization import figure_style as style

GOAL = np.array([3.0, -2.7])  # [m]
HALF = 5.0  # the picture is the square |x_i| <= HALF [m]
FINER = 3  # starts per grid step in sensing regions, where the source changes sign
CELLS = 40  # along each axis
DELTA = 1.0  # radius around the goal beyond which ρ is compared, as X_1 in the paper [m]
EXTENT = (-HALF, HALF, -HALF, HALF)
CELL_SIZE = 2.0 * HALF / CELLS  # [m]
STRETCH = CELL_SIZE / 4.0  # length over which time is counted in one cell [m]
FIELD = EuclideanDensity(
    [
        UnsafeRegion(h=Ball(1.0), s=Ball(2.0)),
        UnsafeRegion(
            h=Placed(Ellipsoid((0.6, 1.0), 0.8), (-2.2, 3.0), 0.4),
            s=Placed(Ellipsoid((0.6, 1.0), 1.4), (-2.2, 3.0), 0.4),
        ),
        UnsafeRegion(h=Placed(Ball(0.7), (2.8, 1.5)), s=Placed(Ball(1.4), (2.8, 1.5))),
    ],
    GOAL,
    DensityParameters(alpha=1.0, gauge=Gauge.LOG),
)


def source(x: Array) -> Array:
    """g = ∇·(ρ∇ρ) = ρ² (Δ ln ρ + 2 ‖∇ ln ρ‖²) at points (N, 2)."""
    return np.exp(2.0 * FIELD.log_value(x)) * rantzer_map(FIELD, x, step=1e-4).margin(Gauge.DENSITY)


def weighted_starts(count: int) -> tuple[Array, Array]:
    """Starts at the middles of a fine grid and of the border's pieces, with their rates [1/s]."""
    side = int(np.sqrt(count))
    size = 2.0 * HALF / side
    coarse, fine = grid(side), grid(FINER * side)
    coarse, fine = coarse[~is_sensed(coarse, side)], fine[is_sensed(fine, side)]
    inside = np.concatenate([coarse, fine])
    area = np.append(np.full(len(coarse), size**2), np.full(len(fine), (size / FINER) ** 2))
    rate = source(inside) * area
    along = -HALF + size * (np.arange(side) + 0.5)
    edges = [np.stack([np.full(side, end), along], 1)[:, order] for end, order in BORDER]
    inflow = [
        influx(edge, end, order) * size for edge, (end, order) in zip(edges, BORDER, strict=True)
    ]
    return np.concatenate([inside, *edges]), np.concatenate([rate, *inflow])


def grid(side: int) -> Array:
    """Middles of side by side squares, (side², 2)."""
    middles = -HALF + 2.0 * HALF / side * (np.arange(side) + 0.5)
    return np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)


def is_sensed(x: Array, side: int) -> NDArray[np.bool_]:
    """Whether the coarse square that holds a point has its middle in a sensing region."""
    size = 2.0 * HALF / side
    middle = -HALF + size * (np.floor((x + HALF) / size) + 0.5)
    return smallest_value([region.s for region in FIELD.unsafe], middle) < 0.0


BORDER = [(end, order) for end in (-HALF, HALF) for order in ([0, 1], [1, 0])]


def influx(edge: Array, end: float, order: list[int]) -> Array:
    """ρ k · n into the square, at points of an edge (N, 2)."""
    inward: Array = -np.sign(end) * FIELD.gradient(edge, Gauge.LOG)[:, order[0]]
    return np.exp(2.0 * FIELD.log_value(edge)) * inward


def occupancy(curves: IntegralCurves, rate: Array) -> Array:
    """Time per area spent in each cell (CELLS, CELLS), rows along x_2, of weighted curves."""
    stretches = [stretches_of(path) for path in curves.paths]
    points = np.concatenate([middles for middles, _ in stretches])
    length = np.concatenate([lengths for _, lengths in stretches])
    weight = np.repeat(rate, [len(lengths) for _, lengths in stretches])
    speed = np.linalg.norm(FIELD.gradient(points, Gauge.DENSITY), axis=1)
    cell = np.floor((points + HALF) / CELL_SIZE).astype(int)
    held = ((cell >= 0) & (cell < CELLS)).all(axis=1)
    time = np.zeros((CELLS, CELLS))
    np.add.at(time, (cell[held, 1], cell[held, 0]), (weight * length / speed)[held])
    return time / CELL_SIZE**2


def stretches_of(path: Array) -> tuple[Array, Array]:
    """Middles (M, 2) and lengths (M,) of the stretches that a curve is cut into [m]."""
    arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    count = int(np.ceil(arc[-1] / STRETCH))
    length = arc[-1] / max(count, 1)
    at = (np.arange(count) + 0.5) * length
    middles = np.column_stack([np.interp(at, arc, path[:, i]) for i in range(2)])
    return middles, np.full(count, length)


def cell_average(values_per_axis: int = 6) -> tuple[Array, NDArray[np.bool_]]:
    """Mean ρ of each cell, and whether the cell is compared: clear of obstacles and goal."""
    fine = CELLS * values_per_axis
    ticks = -HALF + (np.arange(fine) + 0.5) * 2.0 * HALF / fine
    x = np.stack(np.meshgrid(ticks, ticks), axis=-1)
    blocks = (CELLS, values_per_axis, CELLS, values_per_axis)
    rho = np.exp(FIELD.log_value(x))
    clear = smallest_value(FIELD.obstacles, x) > 0.0
    clear &= np.linalg.norm(x - GOAL, axis=-1) > DELTA
    compared = np.asarray(clear.reshape(blocks).all(axis=(1, 3)))
    return rho.reshape(blocks).mean(axis=(1, 3)), compared


def cells_where(condition: Callable[[Array], NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Cells (CELLS, CELLS) all of whose corners meet a condition."""
    ticks = np.linspace(-HALF, HALF, CELLS + 1)
    met = condition(np.stack(np.meshgrid(ticks, ticks), axis=-1))
    return met[1:, 1:] & met[:-1, 1:] & met[1:, :-1] & met[:-1, :-1]


def agreement(measured: Array, rho: Array) -> dict[str, float]:
    error = np.abs(measured - rho)
    return {
        "cells": len(rho),
        "total_difference_over_total": float(error.sum() / rho.sum()),
        "median_relative_error": float(np.median(error / rho)),
        "correlation": float(np.corrcoef(measured, rho)[0, 1]),
    }


def draw(measured: Array, rho: Array) -> Figure:
    figure = style.new_figure(12.0, 3.9)
    axes = figure.subplots(1, 3)
    titles = ("(a) the navigation problem", "(b) density ρ", "(c) occupancy, measured")
    for ax, title in zip(axes, titles, strict=True):
        paper.plane_axes(ax, EXTENT, title)
        paper.outline_sensing(ax, [region.s for region in FIELD.unsafe], EXTENT)
    along = np.linspace(-4.8, 4.8, 13)
    starts = np.concatenate(
        [np.stack([np.full(13, -4.9), along], 1), np.stack([along, np.full(13, 4.9)], 1)]
    )
    curves = integral_curves(FIELD, starts, record=True)
    paper.draw_curves(axes[0], curves.paths, paper.outcome_colours(curves.outcome))
    axes[0].plot(*starts.T, ".", color=style.BLACK, markersize=4, label="starts")
    style.mark_goal(axes[0], GOAL)
    paper.shade_unsafe(axes[0], FIELD.obstacles, EXTENT)
    axes[0].legend(loc="lower left")
    for ax, values in zip(axes[1:], (rho, measured), strict=True):
        image = ax.imshow(
            np.log10(np.maximum(values, 1e-6)), extent=EXTENT, origin="lower",
            cmap=style.DENSITY_MAP, vmin=-3.0, vmax=0.5,
        )  # fmt: skip
        first, second = style.plane_grid(EXTENT)
        h = smallest_value(FIELD.obstacles, np.stack([first, second], axis=-1))
        ax.contour(first, second, h, [0.0], colors="white", linewidths=1.0)
        ax.add_patch(Circle(tuple(GOAL), DELTA, fill=False, edgecolor="white", linestyle=":"))
        figure.colorbar(image, ax=ax, label="$\\log_{10}$ of time per area [s/m²]", shrink=0.8)
    return figure


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__.splitlines()[0], starts=10_000, arguments=arguments)
    starts, rate = weighted_starts(options.starts)
    # Deep inside the sensing regions ρ, and with it the rate, is nothing.
    kept = (FIELD.log_value(starts) > -20.0) & (np.linalg.norm(starts - GOAL, axis=1) > DELTA / 2.0)
    starts, rate = starts[kept], rate[kept]
    parameters = CurveParameters(reach_radius=DELTA / 2.0)
    curves = integral_curves(FIELD, starts, parameters, record=True)
    measured, (rho, compared) = occupancy(curves, rate), cell_average()
    sensed = cells_where(lambda x: smallest_value([region.s for region in FIELD.unsafe], x) < 0.0)
    unsafe = cells_where(lambda x: smallest_value(FIELD.obstacles, x) <= 0.0)
    numbers: dict[str, Any] = {
        "starts": len(starts),
        "reached": curves.count(Outcome.REACHED),
        **{
            name: agreement(measured[cells], rho[cells])
            for name, cells in (
                ("all_cells", compared),
                ("cells_outside_sensing_regions", compared & ~sensed),
                ("cells_in_sensing_regions", compared & sensed),
            )
        },
        "share_of_source_negative": float(-rate[rate < 0.0].sum() / np.abs(rate).sum()),
        "largest_occupancy_in_unsafe_cells_s_per_m2": float(np.abs(measured[unsafe]).max()),
        "delta_m": DELTA,
    }
    paper.FigureReport(
        "Fig. 1",
        "The time that trajectories of k = ∇ρ spend per area, from starts drawn with density "
        "∇·(ρk), is ρ (to 10 % of its total), and zero in the unsafe sets.",
        numbers["all_cells"]["total_difference_over_total"] < 0.1
        and numbers["largest_occupancy_in_unsafe_cells_s_per_m2"] == 0.0,
        numbers,
        (
            paper.NO_NUMBERS,
            paper.THETA,
            f"ρ and time are compared beyond {DELTA:g} m of the goal, from starts on a fine grid.",
            (
                f"{100.0 * numbers['share_of_source_negative']:.1f} % of ∇·(ρk) is negative, in "
                "parts of the sensing regions, where the theorem has it nowhere negative."
            ),
        ),
    ).write(options.out, fig1_occupancy=draw(measured, rho))


if __name__ == "__main__":
    main()
