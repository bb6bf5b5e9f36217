"""Fig. 8: a two-link arm swings up between obstacles that coal maps to joint space, unplanned."""

from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import paper_figure as paper
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

import densarm
from densarm.certificates.certificate import swept_result
from densarm.certificates.task import SimulationParameters
from densarm.control.controller import Gains
from densarm.control.tracking import DensityTracking
from densarm.density.goal_distance import GoalDistance, ProductDistance, TorusDistance
from densarm.density.joint_space_cover import Ellipsoid, JointSpaceCover
from densarm.density.navigation_density import Gauge, NavigationDensity
from densarm.density.unsafe_sets import ClearanceSet, UnsafeSet
from densarm.euclidean.fields import JointSpaceField, SmallestClearance
from densarm.euclidean.integral_curves import CurveParameters, IntegralCurves, integral_curves
from densarm.planning.motion import Motion, TimingParameters
from densarm.planning.smoothing import smooth_path
from densarm.planning.timing import time_path
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style
from densarm.world.swept_check import SweptVerdict
from densarm.world.world import World

START = (0.01, 0.01)  # [rad]; at (0, 0) itself every density here has a critical point
GAINS = Gains(position=1.0, velocity=10.0)  # the paper's
SIMULATION = SimulationParameters(stall_time=30.0)  # the law decays at K_p/K_v = 0.1/s
BY_TORQUE = 20  # of the random starts are also run by torque
COMPARED, FEWER = 200, 60  # at most so many starts under other V, and under another bump
SIGMA = 0.1  # sensing distance where clearance alone makes the bump [m]
CURVES = CurveParameters(tolerance=1e-3, longest_curve=30.0)  # [rad]
SNAPSHOTS = 9

scenario = densarm.load_scenario("swing_up")
arm = scenario.arm
goal = arm.postures["upright"]
world = World(arm, scenario.scene)
nearest = SmallestClearance(world)
inertia = arm.mass_matrix(goal).diagonal()
inertia_weights = np.asarray(inertia / inertia.min())


def sum_distance(weights: Array) -> TorusDistance:
    return TorusDistance(arm, weights, kappa=np.inf)


class UnbalancedDistance:
    """V = 1 − cos e₁ (1 − cos e₂), as [ZNV] section V has its brackets; 0 where that is negative.

    It is 1 at the goal and 0 along curves, on which ρ is infinite.
    """

    def evaluate(self, q: Array, towards: Array, out_gradient: Array) -> float:
        (c1, c2), (s1, s2) = (f(arm.difference(towards, q)) for f in (np.cos, np.sin))
        out_gradient[:] = s1 * (1.0 - c2), -c1 * s2
        return max(0.0, float(1.0 - c1 * (1.0 - c2)))


def density(unsafe: UnsafeSet, distance: GoalDistance) -> NavigationDensity:
    return NavigationDensity(arm, goal, [unsafe], distance)


@dataclass(frozen=True)
class Basin:
    """Which starts the planning system brings to the goal."""

    starts: Array
    """Joint positions (N, 2) [rad]."""
    curves: IntegralCurves

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether each curve ended at the goal or at an image of it, a turn away (N,)."""
        error = arm.difference(arm.configurations(self.curves.end), goal)
        return np.asarray(np.linalg.norm(error, axis=1) <= 1.1 * CURVES.reach_radius)

    @property
    def share(self) -> Proportion:
        return Proportion(int(self.reached.sum()), len(self.starts))

    @property
    def summary(self) -> dict[str, object]:
        return {
            "starts": self.share.total,
            "reached": self.share.count,
            "reached_rate_95": self.share.interval,
            "touched_an_obstacle": self.curves.count(Outcome.COLLIDED),
            "smallest_clearance_m": float(self.curves.smallest_h.min()),
        }


def basin(distance: GoalDistance, unsafe: UnsafeSet, starts: Array, record: bool = False) -> Basin:
    field = JointSpaceField(world, density(unsafe, distance))
    return Basin(starts, integral_curves(field, starts, CURVES, record))


def rim(ellipse: Ellipsoid, count: int) -> Array:
    """Points (count, 2) around an ellipse, in order [rad]."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    squares, directions = np.linalg.eigh(ellipse.shape)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    return np.asarray(ellipse.centre + circle * np.sqrt(squares) @ directions.T)


def rim_traps(
    ellipse: Ellipsoid, distance: GoalDistance, towards: Array, count: int = 2000
) -> Array:
    """Points (T, 2) of a rim at which V presses inwards and is smallest along the rim [rad].

    ∇V·n > 0 there, n the outward normal, and V has a local minimum on the rim. Level sets of Ψ near
    the rim follow it: at such a point the density has a spurious maximum close by, since neither
    along the rim nor across it does anything lead on. Where there is none, what V presses against
    the rim slides along it and leaves. It is what "convex and curved enough" [ZNV Remark 1] asks
    for, against the level sets of V.
    """
    points = rim(ellipse, count)
    configurations, slope = arm.configurations(points), np.zeros(2)
    value = np.array([distance.evaluate(q, towards, slope) for q in configurations])
    traps = []
    for k in np.flatnonzero((value < np.roll(value, 1)) & (value < np.roll(value, -1))):
        distance.evaluate(configurations[k], towards, slope)
        if slope @ np.linalg.solve(ellipse.shape, points[k] - ellipse.centre) > 0.0:
            traps.append(points[k])
    return np.reshape(traps, (-1, 2))


def traps_on_rims(cover: JointSpaceCover, distance: GoalDistance) -> int:
    return sum(len(rim_traps(region, distance, goal)) for region in cover.regions)


def random_starts(count: int) -> Array:
    """Uniform among the joint positions that touch nothing, within half a turn of the goal."""
    error = np.random.default_rng(8).uniform(-np.pi, np.pi, (2 * count + 50, 2))
    points = arm.angles(goal) + error
    return points[nearest(points) > 0.0][:count]


def timed(path: Array) -> Motion:
    """Time the planning system's curve, joint positions (M, 2)."""
    configurations = arm.configurations(path)
    length = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    smooth = smooth_path(world, 0.0, configurations)
    assert smooth is not None
    return time_path(arm, smooth, length, SIMULATION.control_period, TimingParameters())


def run_by_torque(unsafe: UnsafeSet, motion: Motion) -> Run:
    """Track it by [ZNV] eq. 17, with ∇(−1/ρ)."""
    controller = DensityTracking(
        world,
        motion,
        gains=GAINS,
        goal_distance=sum_distance(inertia_weights),
        unsafe_sets=[unsafe],
    )
    start = arm.configuration(motion.position[0])
    return simulate(world, controller, start, goal, parameters=SIMULATION)


def printed_torque(motion: Motion) -> float:
    """Largest torque of eq. 17 as printed, one step after e = 0 [N·m].

    The arm is where one step by M q̈_d + H leads it, at the paper's gains.
    """
    period, q, v = motion.period, arm.configurations(motion.position[:1])[0], np.zeros(arm.nv)
    wanted = motion.sample(0.0, lead=0.5 * period).acceleration
    tau = arm.mass_matrix(q) @ wanted + arm.nonlinear_effects(q, v)
    q, v = PinocchioPlant(arm, period).step(q, v, tau)
    then = motion.sample(period)
    plain = NavigationDensity(
        arm, arm.configuration(then.position), [], sum_distance(inertia_weights)
    ).evaluate(q)
    pull = GAINS.position * plain.gradient(Gauge.DENSITY)
    brake = GAINS.velocity * (v - then.velocity)
    tau = arm.mass_matrix(q) @ (wanted + pull - brake) + arm.nonlinear_effects(q, v)
    return float(np.abs(tau).max())


def is_proved_clear(run: Run) -> bool:
    """Whether the swept check proves that nothing was touched between samples either."""
    return swept_result(world, run.q, run.v, run.time[1]).verdict == SweptVerdict.CLEAR


def draw_motion(ax: Axes, run: Run) -> None:
    ends = [np.zeros((len(run.q), 2))]
    for angle in np.cumsum(arm.angles(run.q), axis=1).T:
        ends.append(ends[-1] + np.column_stack([np.sin(angle), -np.cos(angle)]))
    links = np.stack(ends, axis=1)
    ax.plot(*links[:, -1].T, color=style.GREY, linewidth=0.8, linestyle=":", label="tip")
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(links[:, -1], axis=0), axis=1)))
    at = np.searchsorted(travel, np.linspace(0.0, 0.999 * travel[-1], SNAPSHOTS))
    for order, k in enumerate(at):
        shade = 0.15 + 0.85 * order / (SNAPSHOTS - 1)
        ax.plot(*links[k].T, color=style.VERMILION, alpha=shade, linewidth=3.0, marker="o", ms=4.0)
        x, z = links[k, -1] + 0.2 * (links[k, -1] - links[k, 1])
        ax.text(x, z, f"{run.time[k]:.1f} s", fontsize=7, ha="center", va="center")
    for ball in scenario.scene:
        assert isinstance(ball, densarm.Sphere)
        ax.add_patch(Circle((ball.position[0], ball.position[2]), ball.radius, color=style.GREY))
    paper.plane_axes(ax, (-2.4, 2.4, -2.4, 2.4), "(a) the swing-up, by torque")
    ax.set(xlabel="$x$ [m]", ylabel="$z$ [m]")
    ax.plot(0.0, 2.0, "*", color=style.GREEN, markersize=12, markeredgecolor=style.BLACK)


def draw_traces(axes: list[Axes], run: Run) -> None:
    rows = (
        (np.unwrap(arm.angles(run.q), axis=0), np.array([np.inf, np.inf]), "$q$ [rad]"),
        (run.v, arm.limits.velocity, "$\\dot q$ [rad/s]"),
        (run.tau, arm.limits.effort, "$u$ [N·m]"),
    )
    for ax, (values, limit, label) in zip(axes, rows, strict=True):
        for j, colour in enumerate((style.BLUE, style.VERMILION)):
            ax.plot(run.time, values[:, j], color=colour, label=f"joint {j + 1}")
            for side in (-limit[j], limit[j]) if np.isfinite(limit[j]) else ():
                ax.axhline(side, color=colour, linestyle="--", linewidth=0.7)
        ax.set_ylabel(label)
        ax.margins(x=0.0)
        ax.grid(alpha=0.3)
    axes[0].set_title("(b) joint positions and velocities (dashed: limits)", fontsize=9.5)
    axes[0].legend(loc="upper left", fontsize=7, ncols=2)
    axes[2].set_title("(c) torques (dashed: limits)", fontsize=9.5)
    axes[2].set_xlabel("time [s]")


@cache
def clearance_map(extent: tuple[float, ...]) -> tuple[Array, Array, Array]:
    first, second = style.plane_grid(extent, 240)
    return first, second, nearest(np.stack([first, second], axis=-1))


def draw_joint_space(ax: Axes, cover: JointSpaceCover, title: str, beyond: float = 0.0) -> None:
    """The unsafe set and the sensing regions, from π + beyond left of hanging to as much right."""
    extent = (-np.pi - beyond, np.pi + beyond, -np.pi, np.pi)
    first, second, h = clearance_map(extent)
    ax.contourf(first, second, h, levels=[-np.inf, 0.0], colors=[style.GREY], zorder=2)
    ax.contour(first, second, h, levels=[0.0], colors=[style.BLACK], linewidths=0.8, zorder=2)
    for region in cover.regions:
        x, y = rim(region, 200).T
        for image in (-2.0 * np.pi, 0.0, 2.0 * np.pi):
            ax.plot(x + image, y, color=style.BLACK, linewidth=0.8, linestyle="--", zorder=2)
    paper.plane_axes(ax, extent, title)
    ax.set(xlabel="$q_1$ [rad]", ylabel="$q_2$ [rad]")
    for image in (-np.pi, np.pi):
        style.mark_goal(ax, np.array([image, 0.0]))


def draw_density(ax: Axes, cover: JointSpaceCover, path: Array) -> None:
    draw_joint_space(ax, cover, "(d) unsafe set by coal, sensing regions (dashed), ln ρ", 0.5)
    field = JointSpaceField(world, density(cover, sum_distance(inertia_weights)))
    first, second = style.plane_grid((-np.pi - 0.5, np.pi + 0.5, -np.pi, np.pi), 150)
    value = field.height(np.stack([first, second], axis=-1))
    levels = np.arange(-5.0, 1.0, 0.15)
    ax.contour(first, second, value, levels, colors=style.SKY, linewidths=0.6, linestyles="-")
    ax.plot(*path.T, color=style.VERMILION, linewidth=1.8, zorder=5, label="planning system")
    ax.plot(*path[0], "o", color=style.VERMILION, markersize=5, zorder=6, label="start")
    paper.legend_once(ax, "lower left")


def draw_basin(ax: Axes, cover: JointSpaceCover, shown: Basin, title: str) -> None:
    draw_joint_space(ax, cover, title)
    starts, ends = ((x + np.pi) % (2.0 * np.pi) - np.pi for x in (shown.starts, shown.curves.end))
    for points, mark, size, colour, name in (
        (starts[shown.reached], ".", 3, style.BLUE, "reached"),
        (starts[~shown.reached], ".", 3, style.ORANGE, "stuck"),
        (ends[~shown.reached], "x", 5, style.VERMILION, "stuck here"),
    ):
        if len(points):
            ax.plot(*points.T, mark, color=colour, markersize=size, zorder=3, label=name)
    paper.legend_once(ax, "upper right")


def draw_runs(ax: Axes, runs: list[Run]) -> None:
    for run in runs:
        angles = arm.angles(run.q)
        breaks = np.abs(np.diff(angles, axis=0)).max(axis=1) > np.pi
        angles[1:][breaks] = np.nan
        ax.plot(*angles.T, color=style.BLACK, linewidth=0.8, zorder=4, label="by torque")
        ax.plot(*angles[0], "s", color=style.BLACK, markersize=3, zorder=5)


def draw(
    cover: JointSpaceCover, path: Array, run: Run, runs: list[Run], maps: list[Basin]
) -> Figure:
    figure = style.new_figure(13.5, 9.0)
    axes = figure.subplot_mosaic([["a", [["b"], ["v"], ["c"]], "d"], ["e", "f", "g"]])
    draw_motion(axes["a"], run)
    draw_traces([axes["b"], axes["v"], axes["c"]], run)
    draw_density(axes["d"], cover, path)
    draw_runs(axes["e"], runs)
    names = ("V: sum, inertia weights", "V: sum, equal weights", "V: the paper's product")
    for name, key, shown in zip(names, "efg", maps, strict=True):
        draw_basin(axes[key], cover, shown, f"({key}) {name}:\n{shown.share} reach")
    return figure


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=1000, arguments=arguments)
    cover = JointSpaceCover(world)
    starts = random_starts(options.starts)
    weighted, equal = sum_distance(inertia_weights), sum_distance(np.ones(arm.nv))
    swing = basin(weighted, cover, np.array([START]), record=True)
    shown = basin(weighted, cover, starts, record=True)
    motion = timed(swing.curves.paths[0])
    run, printed = run_by_torque(cover, motion), printed_torque(motion)
    tracked = np.flatnonzero(shown.reached[:BY_TORQUE])
    runs = [run_by_torque(cover, timed(shown.curves.paths[k])) for k in tracked]
    few = partial(basin, starts=np.vstack([[START], starts[:COMPARED]]))
    others = [few(equal, cover), few(ProductDistance(arm), cover)]
    unbalanced = few(UnbalancedDistance(), cover)
    figure = draw(cover, swing.curves.paths[0], run, runs, [shown, *others])
    clear = [float(nearest(arm.angles(each.q)).min()) for each in (run, *runs)]
    proved = [is_proved_clear(each) for each in (run, *runs)]
    held = [each.outcome is Outcome.REACHED for each in (run, *runs)]
    ratio = max(float((np.abs(each.tau) / arm.limits.effort).max()) for each in (run, *runs))
    by_clearance = partial(basin, unsafe=ClearanceSet(world, 0.0, SIGMA), starts=starts[:FEWER])
    paper.FigureReport(
        "Fig. 8",
        "With obstacles mapped to joint space by coal and sensed in convex regions the density "
        "alone, without a planner, swings the arm up from (0.01, 0.01) by K_p = 1, K_v = 10 "
        "without contact, and its planning system reaches the goal from 99 % of all free starts.",
        bool(
            swing.reached.all()
            and np.mean(shown.reached) >= 0.99
            and shown.curves.count(Outcome.COLLIDED) == 0
            and len(runs) == len(starts[:BY_TORQUE])
            and all([*held, *proved])
        ),
        {
            "planning_system": shown.summary,
            "starts_inside_sensing_regions": sum(
                bool((cover.sensing_functions(q) < 0.0).any()) for q in arm.configurations(starts)
            ),
            "stuck_starts_rad": starts[~shown.reached].tolist(),
            "swing_up_reached_by_planning_system": bool(swing.reached.all()),
            "swing_up_reached_by_torque": held[0],
            "swing_up_duration_s": float(run.time[-1]),
            "swing_up_smallest_clearance_m": clear[0],
            "runs_by_torque": len(starts[:BY_TORQUE]),
            "runs_by_torque_reached": sum(held[1:]),
            "runs_by_torque_smallest_clearance_m": min(clear[1:]),
            "torque_runs_proved_clear_between_samples": sum(proved),
            "peak_torque_ratio": ratio,
            "torque_of_eq_17_as_printed_one_step_from_e_0_nm": printed,
            "weights_of_V": inertia_weights.tolist(),
            "traps_on_rims_inertia_weights": traps_on_rims(cover, weighted),
            "traps_on_rims_equal_weights": traps_on_rims(cover, equal),
            "sensing_semi_axes_rad": [region.semi_axes.tolist() for region in cover.regions],
            "other_densities": {
                "cover, sum with equal weights": others[0].summary,
                "cover, the paper's product": others[1].summary,
                "cover, the paper's V with its brackets as printed": unbalanced.summary,
                f"clearance sensed within {SIGMA} m, inertia weights": by_clearance(
                    weighted
                ).summary,
                f"clearance sensed within {SIGMA} m, equal weights": by_clearance(equal).summary,
            },
        },
        (
            (
                "V is the sum of w_i (1 − cos e_i), weighted by the joints' inertia: "
                f"{shown.share.count} of {shown.share.total} starts reach. The brackets of the "
                f"paper's V do not balance: read as a product, {others[1].share.count} of "
                f"{others[1].share.total} reach, as printed {unbalanced.share.count}; the equally "
                f"weighted sum {others[0].share.count}."
            ),
            (
                "Feedback is ∇(−1/ρ) in place of ∇ρ: eq. 17 as printed asks for "
                f"{printed:.2g} N·m one step of {1e3 * motion.period:g} ms from e = 0."
            ),
            (
                "The reference is the planning system's curve, timed by TOPP-RA inside the limits "
                "of the arm: its own speed ∇ρ has no bound at the goal."
            ),
            (
                "Obstacles act at q, not at the error e, and are sensed in ellipses found around "
                "their images in joint space."
            ),
            (
                "Start, (0.01, 0.01), and obstacles are those of the authors' code; (0, 0) is a "
                "critical point of every density here."
            ),
            paper.THETA,
        ),
    ).write(options.out, fig8_swing_up=figure)


if __name__ == "__main__":
    main()
