"""Fig. 3: almost every start reaches the target; the rest, of measure zero, ends at a saddle."""

import numpy as np
import paper_figure as paper
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from densarm.density.critical_points import CriticalKind, CriticalPoint, find_critical_point
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.integral_curves import IntegralCurves, integral_curves
from densarm.euclidean.shapes import Ball
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style

TARGET = np.array([4.0, -3.0])  # [m]
REGION = UnsafeRegion(h=Ball(radius=2.0), s=Ball(radius=3.0))  # [m]
BOUND = 10.0  # starts are drawn within this of the origin, along each axis [m]
EXTENT = (-10.0, 8.0, -8.0, 10.0)  # of the pictures [m]
AWAY = -TARGET / np.linalg.norm(TARGET)  # from the target through the obstacle's centre
A, B = np.array([-7.0, 3.5]), np.array([-2.12, 1.0])  # outside and inside the sensing region [m]


def density(theta: float) -> EuclideanDensity:
    return EuclideanDensity([REGION], TARGET, DensityParameters(theta=theta, gauge=Gauge.LOG))


def random_starts(count: int) -> Array:
    points = np.random.default_rng(3).uniform(-BOUND, BOUND, (2 * count + 50, 2))
    return points[REGION.h(points) > 0.0][:count]


def critical_points(field: EuclideanDensity) -> list[CriticalPoint]:
    """Newton's method from a ring of guesses through the sensing region: what it finds there."""
    found: list[CriticalPoint] = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
        for radius in (2.3, 2.6, 2.9):
            guess = radius * np.array([np.cos(angle), np.sin(angle)])
            point = find_critical_point(lambda x: field.gradient(x, Gauge.LOG), guess)
            inside = REGION.h(point.position) > 0.0 > REGION.s(point.position)
            fresh = all(np.linalg.norm(point.position - p.position) > 1e-6 for p in found)
            if inside and point.slope < 1e-9 and fresh:
                found.append(point)
    return found


def draw(field: EuclideanDensity, saddle: CriticalPoint, ray: IntegralCurves) -> Figure:
    figure = style.new_figure(9.0, 9.0)
    axes = figure.subplots(2, 2).ravel()
    titles = (
        "(a) a line of starts, level sets of ln ρ",
        "(b) the measure-zero set ends at a saddle",
        "(c) starts outside (A) and inside (B) the sensing region",
        "(d) A and B at the rim of the sensing region",
    )
    for ax, title, extent in zip(
        axes, titles, [EXTENT] * 3 + [(-3.4, -1.2, -0.4, 1.8)], strict=True
    ):
        paper.plane_axes(ax, extent, title)
        draw_scene(ax, field, extent)
    along = np.linspace(0.0, 1.0, 40)[:, np.newaxis]
    line = np.array([-9.5, 0.0]) + along * np.array([9.0, 9.5])
    curves = integral_curves(field, line, record=True)
    paper.draw_curves(axes[0], curves.paths, paper.outcome_colours(curves.outcome))
    axes[0].plot(*line.T, ".", color=style.BLACK, markersize=3, label="starts")
    paper.draw_curves(axes[1], ray.paths, [style.BLACK] * len(ray.paths), width=1.8)
    axes[1].plot(*saddle.position, "o", color=style.PURPLE, zorder=6, label="saddle")
    pair = integral_curves(field, np.array([A, B]), record=True)
    for ax in axes[2:]:
        for path, name, colour in zip(pair.paths, "AB", (style.BLUE, style.VERMILION), strict=True):
            ax.plot(*path.T, color=colour, linewidth=1.6, zorder=4, label=name)
            ax.plot(*path[0], "o", color=colour, markersize=5, zorder=5)
    for ax in axes:
        ax.legend(loc="lower left", framealpha=0.9)
    return figure


def draw_scene(ax: Axes, field: EuclideanDensity, extent: tuple[float, ...]) -> None:
    first, second = style.plane_grid(extent)
    value = field.log_value(np.stack([first, second], axis=-1))
    levels = np.arange(-12.0, 4.0, 0.5)
    ax.contour(first, second, value, levels, colors=style.SKY, linewidths=0.5, linestyles="-")
    paper.outline_sensing(ax, [REGION.s], extent)
    paper.shade_unsafe(ax, field.obstacles, extent)
    style.mark_goal(ax, TARGET)


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=10_000, arguments=arguments)
    field, starts = density(theta=0.0), random_starts(options.starts)
    curves = integral_curves(field, starts)
    found = critical_points(field)
    saddle = found[0]
    on_ray = np.array([2.05, 2.5, 5.0, 8.0, 11.0])[:, np.newaxis] * AWAY
    ray = integral_curves(field, on_ray, record=True)
    leaks = {theta: integral_curves(density(theta), starts) for theta in (1e-3, 1e-2, 1e-1)}
    all_reach = curves.count(Outcome.REACHED) == len(starts)
    is_saddle = len(found) == 1 and saddle.kind is CriticalKind.SADDLE and saddle.slope < 1e-6
    off_saddle = np.linalg.norm(ray.end - saddle.position, axis=1).max()
    entered = ", ".join(
        f"{leak.count(Outcome.COLLIDED)} (θ = {theta:g})" for theta, leak in leaks.items()
    )
    paper.FigureReport(
        "Fig. 3",
        "With theta = 0 every random start outside the unsafe set reaches (4, -3) and none enters "
        "it; the starts polar opposite of the target, a set of measure zero, end at a saddle.",
        bool(all_reach and is_saddle and off_saddle < 1e-3),
        {
            "starts": len(starts),
            "reached": curves.count(Outcome.REACHED),
            "reached_rate_95": Proportion(curves.count(Outcome.REACHED), len(starts)).interval,
            "entered_unsafe_set": curves.count(Outcome.COLLIDED),
            "critical_points_in_sensing_region": len(found),
            "saddle_m": saddle.position.tolist(),
            "saddle_radius_m": float(np.linalg.norm(saddle.position)),
            "saddle_slope_per_m": saddle.slope,
            "saddle_hessian_eigenvalues_per_m2": saddle.eigenvalues.tolist(),
            "measure_zero_starts_end_within_m_of_saddle": float(off_saddle),
            "entered_by_theta": {
                str(theta): leak.count(Outcome.COLLIDED) for theta, leak in leaks.items()
            },
        },
        (
            (
                f"θ = 0, where the theorem asks for θ > 0: of {len(starts)} starts {entered} then "
                "enter the unsafe set."
            ),
            paper.GAUGE,
        ),
    ).write(options.out, fig3_saddle=draw(field, saddle, ray))


if __name__ == "__main__":
    main()
