"""Fig. 6: the gradient of the density as control, bounded to u_max in the maximum norm."""

import numpy as np
import paper_figure as paper
from matplotlib.figure import Figure

from densarm.arms.joint_space import EuclideanSpace
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import Placed, UnsafeRegion, smallest_value
from densarm.euclidean.runs import PointRuns, run_points
from densarm.euclidean.shapes import Ball
from densarm.simulation.plants import SingleIntegrator
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style

U_MAX = 0.2  # [m/s]
GAIN = 5.0  # factor of the gradient of the density, whose own speed far away is a few cm/s
DT, TIME_LIMIT, REACH_RADIUS = 0.02, 120.0, 0.01  # [s], [s], [m]
SHARE = 300  # at most so many starts by the paper's α and gain, in longer steps, for longer
LONG_DT, LONG_LIMIT = 0.1, 1200.0  # [s]
GOAL = np.array([2.5, -1.5])  # [m]
CENTRES = ((0.0, 0.0), (-0.8, -2.2), (1.2, 1.8))  # of discs of radius 0.5, sensed within 1.0 [m]
EXTENT = (-4.0, 4.0, -4.0, 4.0)  # [m]
SHOWN = 8


def density(alpha: float) -> EuclideanDensity:
    return EuclideanDensity(
        [UnsafeRegion(Placed(Ball(0.5), c), Placed(Ball(1.0), c)) for c in CENTRES],
        GOAL,
        DensityParameters(alpha, gauge=Gauge.DENSITY, blend_radius=0.1),
    )


FIELD, PLAIN = density(alpha=0.2), density(alpha=1.0)


def random_starts(count: int) -> Array:
    """Starts outside the sensing regions."""
    points = np.random.default_rng(6).uniform(-4.0, 4.0, (2 * count + 50, 2))
    return points[smallest_value([region.s for region in FIELD.unsafe], points) > 0.0][:count]


def arrivals(starts: Array) -> dict[str, int]:
    """How many starts arrive in time by α = 1 and no gain."""
    plant = SingleIntegrator(EuclideanSpace(2), LONG_DT)
    runs = run_points(lambda _: PLAIN, plant, starts, U_MAX, LONG_LIMIT, REACH_RADIUS)
    return paper.arrivals(runs, REACH_RADIUS)


def draw(runs: PointRuns, starts: Array) -> Figure:
    figure = style.new_figure(10.0, 4.8)
    plane, traces = figure.subplots(1, 2, width_ratios=[1.0, 1.15])
    paper.plane_axes(plane, EXTENT, "(a) paths under bounded control")
    paper.outline_sensing(plane, [region.s for region in FIELD.unsafe], EXTENT)
    paper.shade_unsafe(plane, FIELD.obstacles, EXTENT)
    paths = [runs.x[:, i] for i in range(min(SHOWN, len(starts)))]
    paper.draw_curves(plane, paths, paper.outcome_colours(runs.outcome[: len(paths)]), width=1.0)
    plane.plot(*starts[: len(paths)].T, ".", color=style.BLACK, markersize=4, label="starts")
    style.mark_goal(plane, GOAL)
    plane.legend(loc="lower right")
    shown = int(np.argmax([np.abs(np.diff(path, axis=0)).sum() for path in paths]))
    plane.plot(*paths[shown].T, color=style.VERMILION, linewidth=2.0, zorder=4)
    moving = np.flatnonzero(np.abs(runs.u[:, shown]).max(axis=1) > 0.0)
    time, u = runs.time[moving], runs.u[moving, shown]
    wanted = GAIN * FIELD.direction(runs.x[moving, shown])
    for axis, colour in enumerate((style.BLUE, style.ORANGE)):
        traces.plot(time, wanted[:, axis], ":", color=colour, linewidth=1.2)
        traces.plot(time, u[:, axis], color=colour, label=f"$u_{axis + 1}$")
    traces.axhline(U_MAX, color=style.BLACK, linestyle="--", label="$\\pm u_{max}$")
    traces.axhline(-U_MAX, color=style.BLACK, linestyle="--")
    traces.plot([], [], ":", color=style.BLACK, label="before the bound")
    traces.set_ylim(-2.0 * U_MAX, 2.0 * U_MAX)
    traces.set_xlabel("time [s]")
    traces.set_ylabel("control [m/s]")
    traces.set_title("(b) control along the red path", fontsize=9.5)
    traces.legend(loc="upper left")
    traces.grid(alpha=0.3)
    return figure


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=1000, arguments=arguments)
    starts = random_starts(options.starts)
    plant = SingleIntegrator(EuclideanSpace(2), DT)
    runs = run_points(lambda _: FIELD, plant, starts, U_MAX, TIME_LIMIT, REACH_RADIUS, GAIN)
    plain = arrivals(starts[:SHARE])
    reached = Proportion(runs.count(Outcome.REACHED), len(starts))
    largest = float(np.abs(runs.u).max())
    at_bound = np.abs(runs.u).max(axis=-1) > U_MAX * (1.0 - 1e-9)
    paper.FigureReport(
        "Fig. 6",
        f"Bounded to u_max = {U_MAX} m/s the control {GAIN:g} ∇ρ stays within the bound, and every "
        "start outside the sensing regions reaches the goal without entering the unsafe set.",
        reached.count == reached.total and largest <= U_MAX * (1.0 + 1e-12),
        {
            "starts": reached.total,
            "reached": reached.count,
            "reached_rate_95": reached.interval,
            "collided": runs.count(Outcome.COLLIDED),
            "timed_out": runs.count(Outcome.TIMED_OUT),
            "u_max_m_per_s": U_MAX,
            "largest_control_m_per_s": largest,
            "share_of_runs_that_meet_the_bound": float(at_bound.any(axis=0).mean()),
            "longest_time_s": float(runs.time[-1]),
            "gain": GAIN,
            "alpha": FIELD.parameters.alpha,
            "alpha_1_no_gain": plain,
            "smallest_h_m2": float(smallest_value(FIELD.obstacles, runs.x).min()),
        },
        (
            paper.gain_departure(FIELD.parameters.alpha, GAIN, plain),
            paper.blend_departure(FIELD.parameters.blend_radius),
            paper.NO_NUMBERS,
            paper.THETA,
        ),
    ).write(options.out, fig6_bounded_control=draw(runs, starts))


if __name__ == "__main__":
    main()
