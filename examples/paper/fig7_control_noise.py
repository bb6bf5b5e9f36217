"""Fig. 7: bounded control by the density with Gaussian noise on the control."""

from itertools import product
from typing import Any

import numpy as np
import paper_figure as paper
from matplotlib.figure import Figure

from densarm.arms.joint_space import EuclideanSpace
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import Placed, UnsafeRegion, smallest_value
from densarm.euclidean.runs import PointRuns, run_points
from densarm.euclidean.shapes import Ball
from densarm.simulation.plants import NoiseScaling, SingleIntegrator
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style

BEYOND = (2e-2, 1e-1)  # larger than in the paper, white: where the noise wins [m²/s]
VARIANCES = (1e-3, 5e-3)  # Σ: [m²/s] where noise is white, [m²/s²] where it is held
U_MAX = 0.2  # [m/s]
GAIN = 10.0  # factor of the gradient, before the bound
ALPHA, BLEND = 0.2, 0.1  # α, and δ of the blend at the goal [m]
DT, TIME_LIMIT, REACH_RADIUS = 0.05, 120.0, 0.1  # [s], [s], [m]
GOAL = np.array([2.5, -1.5])  # [m]
CENTRES = ((0.0, 0.0), (-0.8, -2.2), (1.2, 1.8))  # of discs of radius 0.5, sensed within 1.0 [m]
EXTENT = (-3.5, 3.5, -3.5, 3.5)  # [m]
SHOWN = 25
SHARE, LONG_LIMIT = 100, 1200.0  # starts by the paper's α and gain, for so long [s]
FEWER = 300  # at most so many starts with more noise than in the paper


def field(gauge: Gauge, alpha: float = ALPHA) -> EuclideanDensity:
    return EuclideanDensity(
        [UnsafeRegion(Placed(Ball(0.5), c), Placed(Ball(1.0), c)) for c in CENTRES],
        GOAL,
        DensityParameters(alpha, gauge=gauge, blend_radius=BLEND),
    )


def random_starts(count: int) -> Array:
    """Starts outside the sensing regions."""
    points = np.random.default_rng(7).uniform(-3.5, 3.5, (2 * count + 50, 2))
    sensing = [region.s for region in field(Gauge.LOG).unsafe]
    return points[smallest_value(sensing, points) > 0.0][:count]


def run(gauge: Gauge, scaling: NoiseScaling, variance: float, starts: Array) -> PointRuns:
    plant = SingleIntegrator(EuclideanSpace(2), DT, variance, scaling, seed=7)
    density = field(gauge)
    return run_points(lambda _: density, plant, starts, U_MAX, TIME_LIMIT, REACH_RADIUS, GAIN)


def arrivals(starts: Array) -> dict[str, int]:
    """How many starts arrive in time by α = 1 and no gain."""
    plant = SingleIntegrator(EuclideanSpace(2), DT, VARIANCES[0], NoiseScaling.WHITE, seed=7)
    density = field(Gauge.DENSITY, alpha=1.0)
    runs = run_points(lambda _: density, plant, starts, U_MAX, LONG_LIMIT, REACH_RADIUS)
    return paper.arrivals(runs, REACH_RADIUS)


def summary(runs: PointRuns) -> dict[str, object]:
    total = len(runs.outcome)
    result: dict[str, object] = {"runs": total}
    for outcome in (Outcome.REACHED, Outcome.COLLIDED, Outcome.TIMED_OUT):
        share = Proportion(runs.count(outcome), total)
        result[outcome] = share.count
        result[f"{outcome}_rate_95"] = share.interval
    return result


def draw(shown: dict[tuple[Gauge, float], PointRuns]) -> Figure:
    figure = style.new_figure(9.0, 9.2)
    for number, (ax, ((gauge, variance), runs)) in enumerate(
        zip(figure.subplots(2, 2).ravel(), shown.items(), strict=True)
    ):
        reached = Proportion(runs.count(Outcome.REACHED), len(runs.outcome))
        title = f"({'abcd'[number]}) {gauge} gauge, Σ = {variance:g} m²/s:\n{reached} reach"
        paper.plane_axes(ax, EXTENT, title)
        paper.outline_sensing(ax, [region.s for region in field(gauge).unsafe], EXTENT)
        paper.shade_unsafe(ax, field(gauge).obstacles, EXTENT)
        count = min(SHOWN, len(runs.outcome))
        paths = [runs.x[:, i] for i in range(count)]
        paper.draw_curves(ax, paths, paper.outcome_colours(runs.outcome[:count]))
        ax.plot(*runs.x[0, :count].T, ".", color=style.BLACK, markersize=4, label="starts")
        for outcome in (Outcome.REACHED, Outcome.COLLIDED, Outcome.TIMED_OUT):
            if (runs.outcome[:count] == outcome).any():
                ax.plot([], [], color=style.OUTCOME_COLOUR[outcome], label=str(outcome))
        style.mark_goal(ax, GOAL)
        ax.legend(loc="upper left", fontsize=7)
    return figure


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=1000, arguments=arguments)
    starts = random_starts(options.starts)
    numbers: dict[str, dict[str, Any]] = {}
    shown: dict[tuple[Gauge, float], PointRuns] = {}
    for gauge, scaling, variance in product((Gauge.DENSITY, Gauge.LOG), NoiseScaling, VARIANCES):
        runs = run(gauge, scaling, variance, starts)
        numbers[f"{gauge} gauge, {scaling} noise, variance {variance:g}"] = summary(runs)
        if scaling is NoiseScaling.WHITE:
            shown[gauge, variance] = runs
    beyond = {
        f"{gauge} gauge, white noise, variance {variance:g}": summary(
            run(gauge, NoiseScaling.WHITE, variance, starts[:FEWER])
        )
        for gauge, variance in product((Gauge.DENSITY, Gauge.LOG), BEYOND)
    }
    plain = arrivals(starts[:SHARE])
    collided = [each["collided"] for each in numbers.values()]
    reached = [each["reached"] for each in numbers.values()]
    paper.FigureReport(
        "Fig. 7",
        "With Gaussian noise of variance 1e-3 and 5e-3 on the control every run reaches the goal "
        "and none enters the unsafe set, however the noise is scaled and in both gauges.",
        sum(collided) == 0 and min(reached) == len(starts),
        {
            "dt_s": DT,
            "u_max_m_per_s": U_MAX,
            "gain": GAIN,
            "reach_radius_m": REACH_RADIUS,
            "alpha": ALPHA,
            **numbers,
            "beyond_the_paper": beyond,
            "alpha_1_no_gain": plain,
        },
        (
            paper.gain_departure(ALPHA, GAIN, plain),
            (
                "Σ is read in two ways: of white noise [m²/s], and of noise held for a step "
                "[m²/s²]. "
                "Both gauges run: bounded, ∇ρ and ∇ ln ρ are no longer the same control."
            ),
            paper.blend_departure(BLEND),
            f"A run has arrived within {REACH_RADIUS:g} m, and is over then.",
            paper.NO_NUMBERS,
            paper.THETA,
        ),
    ).write(options.out, fig7_control_noise=draw(shown))


if __name__ == "__main__":
    main()
