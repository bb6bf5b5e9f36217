"""Fig. 5: out of a C-shaped unsafe set, density functions against navigation functions."""

from typing import Any

import numpy as np
import paper_figure as paper
from matplotlib.figure import Figure

from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.fields import NavigationField, NavigationFunction, PotentialField
from densarm.euclidean.implicit import Complement, UnsafeRegion
from densarm.euclidean.integral_curves import integral_curves
from densarm.euclidean.shapes import Ball, CShape, Egg
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style

GOAL = np.array([-9.0, 1.0])  # behind the closed side of the C [m]
C_SHAPE = CShape(radius=2.2, half_width=0.4, opening=0.0, sharpness=2.0)
CLOSED_C = CShape(radius=2.6, half_width=0.45, opening=1.3, sharpness=4.0)
SHALLOW_C = CShape(radius=2.2, half_width=0.4, opening=-0.5, sharpness=2.0)
WORLD = Complement(Ball(radius=25.0))  # [m]
EXTENT = (-11.0, 6.0, -6.0, 6.0)  # [m]
SHOWN = 40


def density(shape: CShape, radius: float) -> EuclideanDensity:
    sensed = Egg(a=1.0, b=1.0, c=1.1, radius=radius)
    parameters = DensityParameters(gauge=Gauge.LOG)
    return EuclideanDensity([UnsafeRegion(h=shape, s=sensed)], GOAL, parameters)


def navigation_function(shape: CShape, kappa: float) -> NavigationFunction:
    return NavigationFunction([shape, WORLD], GOAL, kappa)


def fields(shape: CShape) -> dict[str, NavigationField]:
    """The four of the paper."""
    return {
        "density, r = 2.5": density(shape, 2.5),
        "navigation function, κ = 1": navigation_function(shape, 1.0),
        ENCLOSING: density(shape, 4.5),
        "navigation function, κ = 10": navigation_function(shape, 10.0),
    }


ENCLOSING = "density, r = 4.5"
FIELDS = fields(C_SHAPE)
BEYOND: dict[str, NavigationField] = {
    "potential field, h_0 = 4": PotentialField([C_SHAPE], GOAL, influence=4.0),
    **{
        f"navigation function, κ = {kappa:g}": navigation_function(C_SHAPE, kappa)
        for kappa in (0.1, 0.3, 3.0, 30.0, 100.0)
    },
}
OTHER_SHAPES = {"tips of the C turned in": CLOSED_C, "a shallow C": SHALLOW_C}


def cavity_starts(shape: CShape, count: int) -> Array:
    """Random starts inside the C: in its ring, short of its opening, off the unsafe set."""
    points = np.random.default_rng(5).uniform(-shape.radius, shape.radius, (8 * count + 50, 2))
    inside = (np.linalg.norm(points, axis=1) < shape.radius) & (points[:, 0] < shape.opening)
    starts: Array = points[inside & (shape(points) > 0.0)][:count]
    return starts


def rates(field: NavigationField, count: int) -> dict[str, Any]:
    shape = next(h for h in field.obstacles if isinstance(h, CShape))
    curves = integral_curves(field, cavity_starts(shape, count))
    reached = Proportion(curves.count(Outcome.REACHED), count)
    return {
        "reached": reached.count,
        "reached_rate_95": reached.interval,
        "stuck": curves.count(Outcome.STUCK),
        "collided": curves.count(Outcome.COLLIDED),
        "timed_out": curves.count(Outcome.TIMED_OUT),
        "ends_m": np.unique(np.round(curves.end, 1), axis=0)[:8].tolist(),
    }


def holds(reached: dict[str, int], starts: int) -> bool:
    """Whether all of the starts reach by the enclosing density, and of each other field not all."""
    others = [count for name, count in reached.items() if name != ENCLOSING]
    return reached[ENCLOSING] == starts and max(others) < starts


def covered_share(radius: float) -> float:
    """Share of the C's area inside the egg."""
    x = np.stack(style.plane_grid((-4.0, 4.0, -4.0, 4.0)), axis=-1)
    sensed = Egg(a=1.0, b=1.0, c=1.1, radius=radius)(x) < 0.0
    return float(sensed[C_SHAPE(x) <= 0.0].mean())


def draw(numbers: dict[str, dict[str, Any]], starts: int) -> Figure:
    figure = style.new_figure(9.0, 7.2)
    axes = figure.subplots(2, 2).ravel()
    for letter, ax, (name, field) in zip("abcd", axes, FIELDS.items(), strict=True):
        curves = integral_curves(field, cavity_starts(C_SHAPE, SHOWN), record=True)
        reached = Proportion(numbers[name]["reached"], starts)
        paper.plane_axes(ax, EXTENT, f"({letter}) {name}: {100 * reached.rate:.1f} % reach")
        if isinstance(field, EuclideanDensity):
            paper.outline_sensing(ax, [field.unsafe[0].s], EXTENT)
        paper.shade_unsafe(ax, [C_SHAPE], EXTENT)
        paper.draw_curves(ax, curves.paths, paper.outcome_colours(curves.outcome))
        starts_shown = np.array([path[0] for path in curves.paths])
        ax.plot(*starts_shown.T, ".", color=style.BLACK, markersize=3, zorder=5, label="starts")
        for outcome in sorted(set(curves.outcome)):
            colour = style.OUTCOME_COLOUR[Outcome(outcome)]
            ends = curves.end[curves.outcome == outcome]
            if outcome != Outcome.REACHED:
                ax.plot(*ends.T, "X", color=colour, markersize=6, zorder=6, label=str(outcome))
        style.mark_goal(ax, GOAL)
        ax.legend(loc="upper right")
    return figure


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=1000, arguments=arguments)
    numbers = {name: rates(field, options.starts) for name, field in {**FIELDS, **BEYOND}.items()}
    reached = {name: each["reached"] for name, each in numbers.items()}
    few = max(1, options.starts // 5)
    others = {
        name: {field: rates(each, few)["reached"] for field, each in fields(shape).items()}
        for name, shape in OTHER_SHAPES.items()
    }
    escaped = max(count for name, count in reached.items() if name.startswith("navigation"))
    paper.FigureReport(
        "Fig. 5",
        "From random starts inside a C-shaped unsafe set the density whose sensing region encloses "
        "it (r = 4.5) reaches the goal always; with r = 2.5, and by navigation functions with "
        "kappa = 1 and 10 in a sphere world of radius 25 m, some starts do not.",
        holds({name: reached[name] for name in FIELDS}, options.starts),
        {
            "starts": options.starts,
            "share_of_c_inside_egg": {str(r): covered_share(r) for r in (2.5, 4.5)},
            **numbers,
            "reached_from_other_shapes": {"starts": few, **others},
            "holds_for_other_shapes": {name: holds(each, few) for name, each in others.items()},
        },
        (
            (
                "Not reproduced: that some escape by the navigation function with κ = 10. With κ "
                f"from 0.1 to 100 it leads at most {escaped} of {options.starts} to the goal."
            ),
            (
                f"The C is chosen, and the verdict hangs on it. Of {few} starts "
                f"{others['tips of the C turned in'][ENCLOSING]} reach with r = 4.5 where its tips "
                f"are turned in, and {others['a shallow C']['navigation function, κ = 1']} by the "
                "navigation function with κ = 1 where it is shallow."
            ),
            "The egg's a = b = 1, c = 1.1 and the goal are chosen: the paper gives none.",
            paper.THETA,
            paper.GAUGE,
        ),
    ).write(options.out, fig5_c_shape=draw(numbers, options.starts))


if __name__ == "__main__":
    main()
