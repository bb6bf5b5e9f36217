"""The assumptions of [ZNV]'s theorem in the scenes of Figs. 3 to 7, and its bound on θ."""

from dataclasses import dataclass

import fig3_saddle
import fig4_complex_environments as fig4
import fig5_c_shape
import fig6_bounded_control
import numpy as np
import paper_figure as paper
from matplotlib.figure import Figure

from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.assumptions import SceneAssumptions, check_assumptions
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import smallest_value
from densarm.euclidean.integral_curves import CurveParameters, integral_curves
from densarm.euclidean.shapes import Ellipsoid
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.visualization import figure_style as style

EPSILON = 1e-2  # occupancy for which the bound on θ is given [s mⁿ]
THETAS = (1e-2, 1e-1, 1.0)
SIDE = {2: 400, 3: 64}  # points of the grid along each axis, by dimension
SAMPLES = 500  # points that look for each boundary
PIECES = 400  # of the way from where a curve enters to the goal
PARAMETERS = CurveParameters(tolerance=1e-3, reach_radius=0.3)


@dataclass(frozen=True)
class Scene:
    name: str
    density: EuclideanDensity
    extent: Array  # of the workspace (n, 2) [m]

    def with_theta(self, theta: float) -> EuclideanDensity:
        parameters = DensityParameters(self.density.parameters.alpha, theta, Gauge.LOG)
        return EuclideanDensity(self.density.unsafe, self.density.goal, parameters)

    def starts(self, count: int) -> list[tuple[Array, float]]:
        """Starts outside the sensing regions, and inside, each with its region's measure [mⁿ]."""
        low, high = self.extent.T
        x = np.random.default_rng(10).uniform(low, high, (200 * count + 2000, low.size))
        free = smallest_value(self.density.obstacles, x) > 0.0
        sensed = smallest_value([region.s for region in self.density.unsafe], x) < 0.0
        box = float(np.prod(high - low))
        return [
            (x[chosen][:count], box * float(chosen.mean()))
            for chosen in (free & ~sensed, free & sensed)
        ]


def scenes() -> list[Scene]:
    square = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    convex = Ellipsoid((1.0, 1.35), 2.5)
    complex_ones = [fig4.four_shapes(convex), fig4.maze(), fig4.grid_of_spheres(), fig4.tori()]
    c_extent = np.reshape(fig5_c_shape.EXTENT, (-1, 2))
    return [
        Scene("3", fig3_saddle.density(0.0), fig3_saddle.BOUND * square),
        *(
            Scene(f"4{letter}", fig4.field_of(each), np.reshape(each.extent, (-1, 2)))
            for letter, each in zip("abcd", complex_ones, strict=True)
        ),
        Scene("5, r = 2.5", fig5_c_shape.density(fig5_c_shape.C_SHAPE, 2.5), c_extent),
        Scene("5, r = 4.5", fig5_c_shape.density(fig5_c_shape.C_SHAPE, 4.5), c_extent),
        Scene("6 and 7", fig6_bounded_control.FIELD, 4.0 * square),
    ]


@dataclass(frozen=True)
class Leak:
    entered: int  # of the starts
    starts: int
    occupancy: float  # time spent in the unsafe sets, over the measure of the starts [s mⁿ]


Leaks = dict[float, tuple[Leak, ...]]  # by θ


def leaks_of(scene: Scene, theta: float, count: int) -> tuple[Leak, ...]:
    """What enters of the starts outside and inside the sensing regions, and how long it stays."""
    density, groups = scene.with_theta(theta), scene.starts(count)
    curves = integral_curves(density, np.concatenate([starts for starts, _ in groups]), PARAMETERS)
    entered = curves.outcome == Outcome.COLLIDED
    time = np.zeros(len(entered))
    time[entered] = time_inside(density, curves.end[entered])
    parts = np.split(np.arange(len(entered)), [len(groups[0][0])])
    return tuple(
        Leak(int(entered[part].sum()), len(part), measure * float(time[part].mean()))
        for part, (_, measure) in zip(parts, groups, strict=True)
    )


def time_inside(density: EuclideanDensity, x: Array) -> Array:
    """Time [s] by ẋ = ∇ρ from points (N, n) straight on to the goal, until out of all sets.

    There Ψ does not change, so that ∇ρ = −2αΨ e/‖e‖^(2α + 2) points to the goal. As in the
    proof, the sets that are far count as 1, not as 1 + θ.
    """
    others = (1.0 + density.parameters.theta) ** (len(density.unsafe) - 1)
    share = (np.arange(PIECES) + 0.5) / PIECES
    way = x[:, np.newaxis] + share[:, np.newaxis] * (density.goal - x)[:, np.newaxis]
    inside = smallest_value(density.obstacles, way) <= 0.0
    inside[:, 0] = True
    inside = np.logical_and.accumulate(inside, axis=1)
    length = np.linalg.norm(density.goal - x, axis=1)
    speed = np.linalg.norm(density.gradient(way, Gauge.DENSITY), axis=-1) / others
    slowness = np.where(inside, 1.0 / np.maximum(speed, 1e-300), 0.0)
    return np.asarray(slowness.sum(axis=1) * length / PIECES)


def draw_table(
    found: dict[str, SceneAssumptions], leaks: dict[str, Leaks], alphas: dict[str, float]
) -> Figure:
    figure = style.new_figure(11.5, 3.6)
    ax = figure.subplots()
    ax.set_axis_off()
    head = [
        "Fig.", "sets", "between\nsets [m]", "between sens-\ning regions [m]",
        "set to end\nof sensing [m]", "goal to\nset [m]", "one part\neach",
        "largest\n$|∂Ψ/∂x_j|$ [1/m]", "smallest\n$|∂V/∂x_j|$ [m]",
        f"θ allowed for\nε = {EPSILON:g} s m$^n$", "starts outside sensing\nthat enter: θ = 0.1; 1",
        "sensed starts that\nenter: θ = 0; 0.1; 1",
    ]  # fmt: skip
    rows = [
        [
            name, str(len(a.volume)), metres(a.unsafe_gap),
            metres(a.sensing_gap) + (f" ({a.sensing_overlaps} overlap)" * bool(a.sensing_overlaps)),
            metres(a.start_gap), metres(a.goal_gap), "yes" if max(a.components) == 1 else "no",
            f"{a.psi_slope:.3g}" if np.isfinite(a.psi_slope) else "Ψ jumps",
            f"{a.v_slope_per_axis:g}",
            f"{a.largest_theta(EPSILON, alphas[name]):.3g}",
            percentages([leaks[name][theta][0] for theta in (0.1, 1.0)]),
            percentages([leaks[name][theta][1] for theta in (0.0, 0.1, 1.0)]),
        ]
        for name, a in found.items()
    ]  # fmt: skip
    table = ax.table(rows, colLabels=head, loc="center", cellLoc="center")
    table.auto_set_font_size(False)
    table.set_fontsize(8.0)
    table.auto_set_column_width(range(len(head)))
    table.scale(1.0, 1.6)
    for (row, _), cell in table.get_celld().items():
        cell.set_linewidth(0.4)
        if row == 0:
            cell.set_height(2.0 * cell.get_height())
        text = cell.get_text().get_text()
        if text in ("0", "0.000", "Ψ jumps") or "overlap" in text:
            cell.get_text().set_color(style.VERMILION)
    return figure


def metres(distance: float) -> str:
    return f"{distance:.3f}" if np.isfinite(distance) else "–"


def percentages(leaks: list[Leak]) -> str:
    return "; ".join(f"{100.0 * each.entered / each.starts:.1f}" for each in leaks) + " %"


def draw_occupancy(leaks: dict[str, Leaks], promised: dict[str, float]) -> Figure:
    figure = style.new_figure(8.0, 4.4)
    ax = figure.subplots()
    colours = (style.BLUE, style.ORANGE, style.GREEN, style.VERMILION, style.PURPLE, style.SKY,
               style.BLACK, style.GREY)  # fmt: skip
    for (name, by_theta), colour in zip(leaks.items(), colours, strict=False):
        spent = [by_theta[theta][1].occupancy or np.nan for theta in THETAS]
        ax.plot(THETAS, spent, "o-", color=colour, label=f"Fig. {name}")
        ax.plot(THETAS, [promised[name] * theta for theta in THETAS], ":", color=colour)
    ax.plot([], [], ":", color=style.BLACK, label="bound of the proof")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_title("time that starts in sensing regions spend in the unsafe sets", fontsize=9.5)
    ax.set_xlabel("θ")
    ax.set_ylabel("time, integrated over the starts [s m$^n$]")
    ax.grid(alpha=0.3)
    figure.legend(loc="outside right upper")
    return figure


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=100, arguments=arguments)
    every = scenes()
    found = {
        scene.name: check_assumptions(
            scene.density, scene.extent, SIDE[len(scene.extent)], SAMPLES
        )
        for scene in every
    }  # fmt: skip
    leaks = {
        scene.name: {theta: leaks_of(scene, theta, options.starts) for theta in (0.0, *THETAS)}
        for scene in every
    }
    alphas = {scene.name: scene.density.parameters.alpha for scene in every}
    promised = {name: 1.0 / a.largest_theta(1.0, alphas[name]) for name, a in found.items()}
    paper.FigureReport(
        "The theorem's assumptions",
        "Every scene of Figs. 3 to 7 meets Assumption 2 of [ZNV], and the time that starts in and "
        "out of the sensing regions spend in unsafe sets stays within the proof's bound.",
        all(a.distances_hold and a.v_slope_per_axis > 0.0 for a in found.values())
        and all(
            each.occupancy <= promised[name] * theta
            for name, by_theta in leaks.items()
            for theta, groups in by_theta.items()
            for each in groups
        ),
        {
            "starts_per_group": options.starts,
            "epsilon_s_m_n": EPSILON,
            "scenes": {
                f"Fig. {name}": scene_numbers(a, leaks[name], alphas[name])
                for name, a in found.items()
            },
        },
    ).write(
        options.out,
        assumptions_table=draw_table(found, leaks, alphas),
        assumptions_occupancy=draw_occupancy(leaks, promised),
    )


def scene_numbers(a: SceneAssumptions, by_theta: Leaks, alpha: float) -> dict[str, object]:
    return {
        "unsafe_sets": len(a.volume),
        "between_sets_m": finite(a.unsafe_gap),
        "between_sensing_regions_m": finite(a.sensing_gap),
        "sensing_overlaps": a.sensing_overlaps,
        "set_to_end_of_sensing_m": a.start_gap,
        "goal_to_set_m": a.goal_gap,
        "goal_is_sensed": a.goal_is_sensed,
        "zeta_m": a.zeta,
        "largest_number_of_parts": max(a.components),
        "sets_cut_by_the_workspace": sum(a.reaches_border),
        "largest_measure_m_n": max(a.volume),
        "smallest_v_m2": min(a.v_min),
        "smallest_v_slope_per_axis_m": a.v_slope_per_axis,
        "largest_psi_slope_per_m": finite(a.psi_slope),
        "largest_psi_curvature_per_m2": finite(a.psi_curvature),
        "alpha": alpha,
        "theta_allowed_for_epsilon": a.largest_theta(EPSILON, alpha),
        "by_theta": {
            f"{theta:g}": {
                "epsilon_of_the_bound_s_m_n": theta / a.largest_theta(1.0, alpha),
                **{
                    f"{where}_{key}": value
                    for where, each in zip(("outside", "sensed"), groups, strict=True)
                    for key, value in (
                        ("entered", each.entered), ("occupancy_s_m_n", each.occupancy)
                    )
                },
            }
            for theta, groups in by_theta.items()
        },
    }  # fmt: skip


def finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


if __name__ == "__main__":
    main()
