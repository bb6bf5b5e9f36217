"""Moving obstacles and a moving target in the plane, at obstacle speeds below and above u_max."""

from typing import Any

import numpy as np
import paper_figure as paper
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp

from densarm.arms.joint_space import EuclideanSpace
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.implicit import UnsafeRegion, smallest_value
from densarm.euclidean.moving import EllipticMotion, MovingDensity, MovingRegion
from densarm.euclidean.runs import PointRuns, run_points
from densarm.euclidean.shapes import Ball
from densarm.simulation.plants import SingleIntegrator
from densarm.values.arrays import Array
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style

U_MAX = 1.0  # [m/s]
GAIN = 2.0
DT, DURATION, SETTLED = 0.04, 20.0, 14.0  # time step, of a run, and after which it tracks [s]
RADIUS, SENSED = 0.5, 1.2  # of the obstacles and of their sensing regions [m]
TARGET = EllipticMotion((0.0, 0.0), semi_axes=(1.0, 0.6), rate=0.3)  # at most 0.3 m/s
HELD_ERROR = 0.3**2 * DT / (2.0 * GAIN)  # at most: acceleration of the target times Δt/2λ [m]
ORBITS = ((1.9, 1, 0.3), (3.1, -1, 1.5), (3.1, -1, 4.2), (4.3, 1, 5.0))  # radius [m], sense, phase
SLOW, FAST = (0.25, 0.5, 0.9), (1.25, 2.0, 3.0)  # obstacle speeds per u_max
UNBOUNDED_SPEED, UNBOUNDED_DURATION = 3.0, 12.0  # of the run in continuous time [m/s], [s]
HALF = 5.0  # starts are drawn in the square |x_i| <= HALF [m]
SHOWN, SNAPSHOT = 6, 3.0  # paths in the picture, up to this time [s]


def scene(speed: float) -> MovingDensity:
    """Four discs that circle the target's path at one speed [m/s], by turns either way."""
    region = UnsafeRegion(Ball(RADIUS), Ball(SENSED))
    unsafe = [
        MovingRegion(region, EllipticMotion((0.0, 0.0), (r, r), sense * speed / r, phase))
        for r, sense, phase in ORBITS
    ]
    parameters = DensityParameters(gauge=Gauge.LOG, blend_radius=0.1)
    return MovingDensity(unsafe, TARGET, parameters, GAIN)


def random_starts(count: int) -> Array:
    points = np.random.default_rng(9).uniform(-HALF, HALF, (2 * count + 50, 2))
    return points[smallest_value(scene(0.0).at(0.0).obstacles, points) > 0.0][:count]


def distance(h: Array) -> Array:
    """Distance from a disc [m], of h [m²]."""
    return np.sqrt(h + RADIUS**2) - RADIUS


def summary(runs: PointRuns) -> dict[str, Any]:
    entered = Proportion(int(runs.entered.sum()), len(runs.entered))
    error = runs.error[:, ~runs.entered]
    return {
        "starts": entered.total,
        "entered": entered.count,
        "entered_rate_95": entered.interval,
        "smallest_distance_m": float(distance(runs.smallest_h[:, ~runs.entered]).min()),
        "median_error_settled_m": float(np.median(error[runs.time >= SETTLED])),
        "largest_error_settled_m": float(error[runs.time >= SETTLED].max()),
        "within_1_mm_at_the_end": int((error[-1] < 1e-3).sum()),
    }


def continuous(speed: float, starts: Array) -> dict[str, Array]:
    """Unbounded control in continuous time, all starts in one system of equations."""
    field = scene(speed)
    time = np.linspace(0.0, UNBOUNDED_DURATION, 601)
    solution = solve_ivp(
        lambda t, x: field.at(t).direction(x.reshape(-1, 2)).ravel(),
        (0.0, UNBOUNDED_DURATION), starts.ravel(), method="LSODA", t_eval=time,
        rtol=1e-4, atol=1e-7, lband=1, uband=1,
    )  # fmt: skip
    x = solution.y.T.reshape(len(time), -1, 2)
    snapshots = [field.at(t) for t in time]
    return {
        "time": time,
        "error": np.array(
            [np.linalg.norm(p - s.goal, axis=1) for p, s in zip(x, snapshots, strict=True)]
        ),
        "h": np.array([smallest_value(s.obstacles, p) for p, s in zip(x, snapshots, strict=True)]),
    }


def draw(runs: dict[float, PointRuns], free: dict[str, Array]) -> Figure:
    figure = style.new_figure(13.0, 4.3)
    plane, errors, rates = figure.subplots(1, 3)
    draw_plane(plane, runs[0.5])
    tracked = runs[0.5].error[:, ~runs[0.5].entered]
    errors.plot(runs[0.5].time, np.median(tracked, axis=1), color=style.BLUE,
                label=f"$u \\leq u_{{max}}$, Δt = {DT} s: median")  # fmt: skip
    errors.plot(runs[0.5].time, tracked.max(axis=1), "--", color=style.BLUE, label="largest")
    errors.plot(free["time"], np.median(free["error"], axis=1), color=style.VERMILION,
                label="unbounded, continuous: median")  # fmt: skip
    errors.plot(free["time"], free["error"].max(axis=1), "--", color=style.VERMILION,
                label="largest")  # fmt: skip
    errors.set_yscale("log")
    errors.set_ylim(1e-8, 1e6)  # room for the legend
    errors.set_xlabel("time [s]")
    errors.set_ylabel("distance from the target [m]")
    errors.set_title("(b) tracking error", fontsize=9.5)
    draw_rates(rates, runs)
    for ax in (errors, rates):
        ax.grid(alpha=0.3)
        ax.legend(loc="upper left")
    return figure


def draw_plane(ax: Axes, runs: PointRuns) -> None:
    extent = (-HALF, HALF, -HALF, HALF)
    paper.plane_axes(ax, extent, f"(a) the first {SNAPSHOT:g} s, obstacles at 0.5 m/s")
    field = scene(0.5)
    snapshot = field.at(SNAPSHOT)
    paper.outline_sensing(ax, [region.s for region in snapshot.unsafe], extent)
    paper.shade_unsafe(ax, snapshot.obstacles, extent)
    past = runs.time <= SNAPSHOT
    for moving in field.unsafe:
        path = np.array([moving.motion.position(t) for t in runs.time[past]])
        ax.plot(*path.T, color=style.BLACK, linewidth=1.0, linestyle=":")
    target = np.array([TARGET.position(t) for t in runs.time[past]])
    ax.plot(*target.T, color=style.GREEN, linewidth=2.5, label="path of the target")
    x = runs.x[past][:, :SHOWN]
    paper.draw_curves(ax, list(np.swapaxes(x, 0, 1)), [style.BLUE] * x.shape[1], width=1.2)
    ax.plot(*x[0].T, ".", color=style.BLACK, markersize=5, label="starts")
    style.mark_goal(ax, snapshot.goal)
    ax.legend(loc="upper left")


def draw_rates(ax: Axes, runs: dict[float, PointRuns]) -> None:
    shares = [Proportion(int(each.entered.sum()), len(each.entered)) for each in runs.values()]
    rate = 100.0 * np.array([share.rate for share in shares])
    interval = 100.0 * np.array([share.interval for share in shares]).T
    ax.errorbar(list(runs), rate, np.abs(interval - rate), fmt="o-", color=style.VERMILION,
                capsize=3, label="entered, with 95 % interval")  # fmt: skip
    ax.axvline(1.0, color=style.BLACK, linestyle="--", label="$u_{max}$")
    ax.set_xlabel("speed of the obstacles / $u_{max}$")
    ax.set_ylabel("share of the starts [%]")
    ax.set_title("(c) starts that an obstacle meets", fontsize=9.5)


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=1000, arguments=arguments)
    starts = random_starts(options.starts)
    plant = SingleIntegrator(EuclideanSpace(2), DT)
    runs = {
        ratio: run_points(scene(ratio * U_MAX).at, plant, starts, U_MAX, DURATION)
        for ratio in SLOW + FAST
    }
    free = continuous(UNBOUNDED_SPEED, starts[: max(1, options.starts // 10)])
    figure = draw(runs, free)
    slow = [runs[ratio] for ratio in SLOW]
    settled = max(summary(each)["median_error_settled_m"] for each in slow)
    paper.FigureReport(
        "Moving obstacles and target",
        "With θ = 0 in the log gauge and the target's velocity fed forward, obstacles slower than "
        "u_max enter no start, and with unbounded control neither do faster ones; the tracking "
        "error vanishes in continuous time, and with the step where control is held.",
        not any(each.entered.any() for each in slow)
        and bool((free["h"] > 0.0).all())
        and float(np.median(free["error"][-1])) < 1e-5
        and settled < HELD_ERROR,
        {
            "u_max_m_per_s": U_MAX,
            "gain": GAIN,
            "dt_s": DT,
            "target_speed_at_most_m_per_s": 0.3,
            "error_expected_of_a_held_control_m": HELD_ERROR,
            "by_obstacle_speed_per_u_max": {str(r): summary(each) for r, each in runs.items()},
            "unbounded_control_in_continuous_time": {
                "starts": free["h"].shape[1],
                "obstacle_speed_m_per_s": UNBOUNDED_SPEED,
                "entered": int((free["h"] <= 0.0).any(axis=0).sum()),
                "smallest_distance_m": float(distance(free["h"]).min()),
                "median_error_at_the_end_m": float(np.median(free["error"][-1])),
                "largest_error_at_the_end_m": float(free["error"][-1].max()),
            },
        },
    ).write(options.out, moving_scene=figure)


if __name__ == "__main__":
    main()
