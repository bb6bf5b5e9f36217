"""Rantzer's condition ∇·(ρk) ≥ 0, which [ZNV] Lemma 1 rests on, by gauge and by α."""

import numpy as np
import paper_figure as paper
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from densarm.arms.joint_space import EuclideanSpace
from densarm.density.goal_distance import EuclideanDistance
from densarm.density.navigation_density import DensityParameters, Gauge, NavigationDensity
from densarm.density.rantzer import RantzerCondition, rantzer_condition
from densarm.euclidean.density import EuclideanDensity, rantzer_map
from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.integral_curves import CurveParameters, integral_curves
from densarm.euclidean.shapes import Ball
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style

TARGET = np.array([4.0, -3.0])  # the scene of Fig. 3 [m]
REGION = UnsafeRegion(h=Ball(radius=2.0), s=Ball(radius=3.0))  # [m]
EXTENT = (-4.0, 5.0, -4.0, 4.0)  # of the maps [m]
BOUND = 10.0  # starts are drawn within this of the origin, along each axis [m]
MAPPED = (0.2, 1.0, 5.0, 25.0)  # α of the maps
ALPHAS = tuple(np.logspace(0.0, 3.0, 10).tolist())
THETAS = (0.0, 1e-2, 1e-1)
DIMENSIONS = range(1, 7)
SIDE = 300  # points along each axis of the grids


def density(alpha: float, theta: float = 0.0) -> EuclideanDensity:
    return EuclideanDensity([REGION], TARGET, DensityParameters(alpha, theta, Gauge.LOG))


def sensing_grid(side: int) -> Array:
    """Points of a grid that lie in the sensing region."""
    x = np.stack(style.plane_grid((-3.0, 3.0, -3.0, 3.0), side), axis=-1).reshape(-1, 2)
    return x[(REGION.s(x) < 0.0) & (REGION.h(x) > 0.0)]


def failing_share(alpha: float, theta: float, x: Array) -> dict[Gauge, float]:
    """Share of points at which the condition fails, in each gauge."""
    record = rantzer_map(density(alpha, theta), x)
    return {gauge: float((record.sign(gauge) < 0).mean()) for gauge in Gauge}


def entered(alpha: float, theta: float, count: int) -> int:
    """How many random starts outside the sensing region enter the unsafe set."""
    points = np.random.default_rng(8).uniform(-BOUND, BOUND, (2 * count + 50, 2))
    starts = points[REGION.s(points) > 0.0][:count]
    near = CurveParameters(reach_radius=0.5)  # of the target, beyond which nothing is left to enter
    return integral_curves(density(alpha, theta), starts, near).count(Outcome.COLLIDED)


def free_space_threshold(n: int, gauge: Gauge) -> float | None:
    """Smallest α in (1e-3, 10) from which the condition holds without obstacles, by bisection.

    None where it fails at 10, and 0 where it holds at 1e-3.
    """
    low, high = 1e-3, 10.0
    if free_space(n, high).sign(gauge) < 0:
        return None
    if free_space(n, low).sign(gauge) >= 0:
        return 0.0
    while high - low > 1e-7:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if free_space(n, middle).sign(gauge) >= 0 else (middle, high)
    return high


def free_space(n: int, alpha: float) -> RantzerCondition:
    """The condition by differences at a point 1 m from the goal, rounded to their accuracy."""
    parameters = DensityParameters(alpha=alpha)
    point = np.random.default_rng(n).standard_normal(n)
    free = NavigationDensity(EuclideanSpace(n), np.zeros(n), [], EuclideanDistance(), parameters)
    record = rantzer_condition(free, point / np.linalg.norm(point), step=1e-4)
    return RantzerCondition(record.laplacian.round(6), record.squared_gradient)


def expected_threshold(n: int, gauge: Gauge) -> float | None:
    """(n − 2)/4, (n − 2)/2, and any α or none."""
    if gauge is Gauge.RECIPROCAL:
        return 0.0 if n <= 2 else None
    return max(n - 2, 0) / (4.0 if gauge is Gauge.DENSITY else 2.0)


def draw_maps() -> Figure:
    figure = style.new_figure(11.0, 7.6)
    axes = figure.subplots(len(Gauge), len(MAPPED), sharex=True, sharey=True)
    first, second = style.plane_grid(EXTENT, SIDE)
    x = np.stack([first, second], axis=-1)
    free = (REGION.h(x) > 0.0) & (np.linalg.norm(x - TARGET, axis=-1) > 1e-3)
    colours = ListedColormap([style.VERMILION, "white", style.SKY])
    for column, alpha in enumerate(MAPPED):
        record = rantzer_map(density(alpha), x[free])
        for row, gauge in zip(axes, Gauge, strict=True):
            sign = np.zeros(free.shape)
            sign[free] = record.sign(gauge)
            paper.plane_axes(row[column], EXTENT, f"{gauge} gauge, α = {alpha:g}")
            row[column].imshow(sign, extent=EXTENT, origin="lower", cmap=colours, vmin=-1, vmax=1)
            paper.outline_sensing(row[column], [REGION.s], EXTENT)
            paper.shade_unsafe(row[column], [REGION.h], EXTENT)
            style.mark_goal(row[column], TARGET)
            row[column].label_outer()
    meaning = {style.SKY: "> 0", "white": "= 0", style.VERMILION: "< 0: fails"}
    figure.legend(
        handles=[Patch(facecolor=c, edgecolor=style.BLACK, label=m) for c, m in meaning.items()],
        loc="outside lower center", ncols=3, title="sign of ∇·(ρk) for θ = 0",
    )  # fmt: skip
    return figure


def draw_shares(
    shares: dict[tuple[float, float], dict[Gauge, float]],
    leaks: dict[tuple[float, float], Proportion],
) -> Figure:
    figure = style.new_figure(10.0, 4.2)
    gauges, leak = figure.subplots(1, 2)
    colours = (style.BLUE, style.ORANGE, style.VERMILION)
    for gauge, colour in zip(Gauge, colours, strict=True):
        share = [100.0 * shares[0.0, alpha][gauge] for alpha in ALPHAS]
        gauges.plot(ALPHAS, share, ".-", color=colour, label=f"{gauge} gauge")
    gauges.set_title("(a) θ = 0: where the condition fails", fontsize=9.5)
    gauges.set_ylabel("share of the sensing region [%]")
    leak.set_ylabel("share of the sensing region, or of the starts [%]")
    for theta, colour in zip(THETAS, colours, strict=False):
        share = [100.0 * shares[theta, alpha][Gauge.DENSITY] for alpha in ALPHAS]
        leak.plot(ALPHAS, share, "-", color=colour, label=f"θ = {theta:g}: condition fails")
        rate = [100.0 * leaks[theta, alpha].rate for alpha in ALPHAS]
        leak.plot(ALPHAS, rate, "o--", color=colour, ms=3.5, label=f"θ = {theta:g}: starts enter")
    leak.set_title("(b) density gauge: once it fails nowhere, starts enter", fontsize=9.5)
    leak.set_ylim(-2.0, 48.0)  # room for the legend
    for ax in (gauges, leak):
        ax.set_xscale("log")
        ax.set_xlabel("α")
        ax.grid(alpha=0.3)
        ax.legend(loc="center right" if ax is gauges else "upper right")
    return figure


def report(
    shares: dict[tuple[float, float], dict[Gauge, float]],
    leaks: dict[tuple[float, float], Proportion],
    starts: int,
    points: int,
) -> dict[str, object]:
    """The numbers of the report, by θ and α."""
    holding = [pair for pair in shares if shares[pair][Gauge.DENSITY] == 0.0]
    thresholds = {gauge: {n: free_space_threshold(n, gauge) for n in DIMENSIONS} for gauge in Gauge}
    return {
        "free_space_alpha_from_which_it_holds_by_gauge_and_n": thresholds,
        "free_space_largest_difference_from_closed_form": largest_difference(thresholds),
        "share_of_sensing_region_where_it_fails_theta_0": {
            f"alpha {alpha:.3g}": shares[0.0, alpha] for alpha in ALPHAS
        },
        "points_of_the_sensing_region": points,
        "starts_outside_the_sensing_region": starts,
        "density_gauge_by_theta_and_alpha": {
            f"theta {theta:g}": {
                f"alpha {alpha:.3g}": {
                    "fails_share": shares[theta, alpha][Gauge.DENSITY],
                    "entered": leaks[theta, alpha].count,
                    "entered_rate_95": leaks[theta, alpha].interval,
                }
                for alpha in ALPHAS
            }
            for theta in THETAS
        },
        "smallest_alpha_where_it_holds_everywhere": {
            f"theta {theta:g}": min((a for t, a in holding if t == theta), default=None)
            for theta in THETAS
        },
        "fewest_starts_that_enter_where_it_holds_everywhere": min(
            (leaks[pair].count for pair in holding), default=None
        ),
    }


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=1000, arguments=arguments)
    x = sensing_grid(SIDE)
    pairs = [(theta, alpha) for theta in THETAS for alpha in ALPHAS]
    shares = {(theta, alpha): failing_share(alpha, theta, x) for theta, alpha in pairs}
    leaks = {
        (theta, alpha): Proportion(entered(alpha, theta, options.starts), options.starts)
        for theta, alpha in pairs
    }
    numbers = report(shares, leaks, options.starts, len(x))
    paper.FigureReport(
        "Rantzer's condition",
        "[ZNV] Lemma 1 and theorem: a large enough α makes ∇·(ρ∇ρ) ≥ 0 almost everywhere, and "
        "almost every start outside the sensing region reaches the target without entering the "
        "unsafe set.",
        numbers["fewest_starts_that_enter_where_it_holds_everywhere"] == 0,
        numbers,
    ).write(
        options.out,
        rantzer_maps=draw_maps(),
        rantzer_shares=draw_shares(shares, leaks),
    )


def largest_difference(thresholds: dict[Gauge, dict[int, float | None]]) -> float:
    """Over gauges and dimensions; infinite where one threshold exists and the other does not."""
    largest = 0.0
    for gauge, by_n in thresholds.items():
        for n, found in by_n.items():
            expected = expected_threshold(n, gauge)
            if (found is None) != (expected is None):
                return float("inf")
            if found is not None and expected is not None:
                largest = max(largest, abs(found - expected))
    return largest


if __name__ == "__main__":
    main()
