"""Fig. 4: four complex environments, in the plane and in space, crossed from every start."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import paper_figure as paper
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from numpy.typing import ArrayLike

from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import (
    ImplicitFunction,
    Lowered,
    Placed,
    UnsafeRegion,
    smallest_value,
)
from densarm.euclidean.integral_curves import CurveParameters, IntegralCurves, integral_curves
from densarm.euclidean.shapes import (
    Ball,
    Bowtie,
    Cylinder,
    Ellipsoid,
    Oval,
    PNormBall,
    Torus,
)
from densarm.values.arrays import Array, Vector
from densarm.values.outcome import Outcome
from densarm.values.proportion import Proportion
from densarm.visualization import figure_style as style

BAR = 0.999  # of the starts, that must reach the goal
SHOWN = 48  # curves drawn in each picture
CURVES = CurveParameters(tolerance=1e-3)  # [m]

Surface = tuple[Array, Array, Array]  # its points, by coordinate [m]


@dataclass(frozen=True)
class Environment:
    name: str
    unsafe: list[UnsafeRegion]
    goal: tuple[float, ...]  # [m]
    extent: tuple[float, ...]  # [m]
    paper_starts: Callable[[np.random.Generator, int], Array]  # where the paper starts from
    surfaces: tuple[Surface, ...] = ()  # of the obstacles, in space

    def random_starts(self, random: np.random.Generator, count: int) -> Array:
        """Starts uniform in the extent outside the unsafe sets."""
        low, high = np.reshape(self.extent, (-1, 2)).T
        points = random.uniform(low, high, (3 * count + 50, low.size))
        return points[smallest_value([region.h for region in self.unsafe], points) > 0.0][:count]


def placed(
    h: ImplicitFunction,
    s: ImplicitFunction,
    position: tuple[float, ...],
    rotation: ArrayLike | None = None,
) -> UnsafeRegion:
    return UnsafeRegion(Placed(h, position, rotation), Placed(s, position, rotation))


def four_shapes(bowtie_sensing: ImplicitFunction) -> Environment:
    def on_border(random: np.random.Generator, count: int) -> Array:
        along, side = random.uniform(-10.0, 10.0, count), random.integers(4, size=count)
        across = np.where(side % 2, 10.0, -10.0)
        upright = side >= 2
        return np.stack([np.where(upright, across, along), np.where(upright, along, across)], 1)

    oval = Oval(focus=1.2, radius=1.5)
    bowtie = Bowtie(half_length=2.0, waist=0.25)
    unsafe = [
        placed(Ball(1.0), Ball(1.7), (5.0, 4.5)),
        placed(Ellipsoid((0.5, 1.0), 1.0), Ellipsoid((0.55, 1.0), 1.6), (-5.0, 4.0), 0.5),
        placed(oval, Lowered(oval, 12.0), (-4.5, -5.0), -0.7),
        placed(bowtie, bowtie_sensing, (5.0, -4.5), 0.4),
    ]
    extent = (-10.0, 10.0, -10.0, 10.0)
    return Environment("circle, ellipse, oval, bowtie", unsafe, (0.0, 0.0), extent, on_border)


def wall(x: float, y: float, half_length: float, upright: bool = True) -> UnsafeRegion:
    """A rounded wall 0.6 m thick, sensed in an ellipse that is curved more than any ρ around."""
    bulge, tip = (0.9, 0.4) if upright else (0.6, 0.3)  # [m]
    angle = np.pi / 2.0 if upright else 0.0
    return UnsafeRegion(
        Placed(PNormBall(1.0, p=4.0), (x, y), angle, (half_length, 0.3)),
        Placed(Ball(1.0), (x, y), angle, (half_length + tip, bulge)),
    )


def maze() -> Environment:
    columns = [wall(-5.5, y, 1.85) for y in (-6.9, -2.3, 2.3, 6.9)]
    columns += [wall(-1.5, y, 1.85) for y in (-9.0, -4.6, 0.0, 4.6, 9.0)]
    columns += [wall(2.5, y, 1.35) for y in (-7.2, -3.6, 0.0, 3.6, 7.2)]
    rows = [(-3.5, -1.0), (0.5, 2.3), (0.5, -2.4), (-3.5, 4.6)]
    unsafe = columns + [wall(x, y, 1.0, upright=False) for x, y in rows]

    def on_left(random: np.random.Generator, count: int) -> Array:
        return np.stack([np.full(count, -9.5), random.uniform(-10.0, 10.0, count)], 1)

    return Environment("maze", unsafe, (8.0, 0.5), (-10.0, 10.0, -10.0, 10.0), on_left)


def grid_of_spheres() -> Environment:
    places = np.stack(np.meshgrid(*[(-3.5, 0.0, 3.5)] * 3), axis=-1).reshape(-1, 3)
    return Environment(
        "grid of spheres",
        [placed(Ball(1.0), Ball(1.6), tuple(place)) for place in places],
        (8.0, 0.5, 0.3),
        (-8.0, 8.5, -6.0, 6.0, -6.0, 6.0),
        plane_starts(-8.0, 5.0),
        tuple(sphere_surface(place, 1.0) for place in places),
    )


def tori() -> Environment:
    first, second = rotation_about_y(80.0), rotation_about_y(70.0)
    torus, sensed = Torus(2.5, 0.6), Torus(2.5, 1.1)
    unsafe = [
        placed(torus, sensed, (-4.0, 0.0, 0.0), first),
        placed(torus, sensed, (4.0, 1.0, 0.0), second),
        placed(Cylinder(0.8), Cylinder(1.4), (0.0, 1.5, 0.0)),
        placed(Ball(0.9), Ball(1.5), (0.0, -2.5, -0.5)),
    ]
    surfaces = (
        torus_surface((-4.0, 0.0, 0.0), first, 2.5, 0.6),
        torus_surface((4.0, 1.0, 0.0), second, 2.5, 0.6),
        cylinder_surface((0.0, 1.5), 0.8, 6.0),
        sphere_surface((0.0, -2.5, -0.5), 0.9),
    )
    extent = (-9.0, 9.5, -6.0, 6.0, -6.0, 6.0)
    name = "two tori, unbounded cylinder, sphere"
    return Environment(name, unsafe, (9.0, 0.0, 0.0), extent, plane_starts(-9.0, 5.0), surfaces)


def plane_starts(x: float, reach: float) -> Callable[[np.random.Generator, int], Array]:
    def starts(random: np.random.Generator, count: int) -> Array:
        return np.column_stack([np.full(count, x), random.uniform(-reach, reach, (count, 2))])

    return starts


def rotation_about_y(degrees: float) -> Array:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def angles(first: float, second: float) -> tuple[Array, Array]:
    u, v = np.meshgrid(np.linspace(0.0, first, 19), np.linspace(0.0, second, 19))
    return u, v


def sphere_surface(centre: Vector, radius: float) -> Surface:
    u, v = angles(2.0 * np.pi, np.pi)
    unit = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    x, y, z = radius * unit + np.reshape(centre, (3, 1, 1))
    return x, y, z


def torus_surface(centre: Vector, rotation: Array, major: float, minor: float) -> Surface:
    u, v = angles(2.0 * np.pi, 2.0 * np.pi)
    ring = major + minor * np.cos(v)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), minor * np.sin(v)])
    x, y, z = np.tensordot(rotation, points, 1) + np.reshape(centre, (3, 1, 1))
    return x, y, z


def cylinder_surface(centre: Vector, radius: float, half_height: float) -> Surface:
    u, v = angles(2.0 * np.pi, 1.0)
    height = half_height * (2.0 * v - 1.0)
    return centre[0] + radius * np.cos(u), centre[1] + radius * np.sin(u), height


def field_of(environment: Environment) -> EuclideanDensity:
    parameters = DensityParameters(gauge=Gauge.LOG)
    return EuclideanDensity(environment.unsafe, environment.goal, parameters)


def follow(environment: Environment, count: int) -> IntegralCurves:
    """Curves from the paper's kind of starts, then from as many all over the free space."""
    random = np.random.default_rng(4)
    starts = [
        sample(random, count) for sample in (environment.paper_starts, environment.random_starts)
    ]
    return integral_curves(field_of(environment), np.concatenate(starts), CURVES, record=True)


def rates(curves: IntegralCurves) -> dict[str, dict[str, Any]]:
    count = len(curves.outcome) // 2
    return {
        "starts_as_in_the_paper": summary(curves, slice(None, count)),
        "starts_all_over": summary(curves, slice(count, None)),
    }


def summary(curves: IntegralCurves, part: slice) -> dict[str, Any]:
    outcome = curves.outcome[part]
    count = {kind: int((outcome == kind).sum()) for kind in Outcome}
    reached = Proportion(count[Outcome.REACHED], len(outcome))
    return {
        "starts": reached.total,
        "reached": reached.count,
        "reached_rate_95": reached.interval,
        "collided": count[Outcome.COLLIDED],
        "stuck": count[Outcome.STUCK],
        "smallest_h": float(curves.smallest_h[part].min()),
        "longest_m": float(curves.length[part].max()),
    }


def draw(environments: list[Environment], followed: list[IntegralCurves]) -> Figure:
    figure = style.new_figure(10.0, 9.2)
    # Axes of space, laid out alone, do not crowd those of the plane.
    halves = figure.subfigures(2, squeeze=False).ravel()
    for number, (environment, curves) in enumerate(zip(environments, followed, strict=True)):
        space = len(environment.goal) == 3
        kind = {"projection": "3d"} if space else {}
        ax = halves[number // 2].add_subplot(1, 2, number % 2 + 1, **kind)
        title = f"({'abcd'[number]}) {environment.name}"
        shown = slice(min(SHOWN, len(curves.paths) // 2))
        if space:
            draw_space(ax, environment, title)
        else:
            draw_plane(ax, environment, title)
        paper.draw_curves(ax, curves.paths[shown], paper.outcome_colours(curves.outcome[shown]))
        style.mark_goal(ax, np.array(environment.goal))
        starts = np.array([path[0] for path in curves.paths[shown]])
        ax.plot(*starts.T, ".", color=style.BLACK, markersize=3)
    return figure


def draw_plane(ax: Axes, environment: Environment, title: str) -> None:
    paper.plane_axes(ax, environment.extent, title)
    paper.outline_sensing(ax, [region.s for region in environment.unsafe], environment.extent)
    paper.shade_unsafe(ax, [region.h for region in environment.unsafe], environment.extent)


def draw_space(ax: Axes3D, environment: Environment, title: str) -> None:
    paper.space_axes(ax, environment.extent, title)
    for surface in environment.surfaces:
        ax.plot_surface(*surface, color=style.GREY, alpha=0.35, linewidth=0.0, rasterized=True)
    ax.view_init(elev=28.0, azim=-62.0)


def meets_bar(numbers: dict[str, dict[str, Any]]) -> bool:
    return all(
        each["reached"] >= BAR * each["starts"] and each["collided"] == 0
        for each in numbers.values()
    )


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=1000, arguments=arguments)
    convex = Ellipsoid((1.0, 1.35), 2.5)
    environments = [four_shapes(convex), maze(), grid_of_spheres(), tori()]
    followed = [follow(each, options.starts) for each in environments]
    numbers = {
        each.name: rates(curves) for each, curves in zip(environments, followed, strict=True)
    }
    holds = all(meets_bar(each) for each in numbers.values())
    notched = four_shapes(Lowered(Bowtie(half_length=2.0, waist=0.25), 1.0))
    in_notches = rates(follow(notched, max(1, options.starts // 5)))
    numbers["(a) with the bowtie sensed in a region that follows its notches"] = in_notches
    stuck = sum(each["stuck"] for each in in_notches.values())
    tried = sum(each["starts"] for each in in_notches.values())
    paper.FigureReport(
        "Fig. 4",
        "In four complex environments at least 99.9 % of the starts reach the goal and none "
        "collides, with sensing regions that are convex and curved enough.",
        holds,
        numbers,
        (
            paper.NO_NUMBERS,
            (
                "Sensing regions are convex, as Remark 3 asks: with the bowtie's along its notches "
                f"{stuck} of {tried} starts are stuck."
            ),
            paper.THETA,
            paper.GAUGE,
        ),
    ).write(options.out, fig4_complex_environments=draw(environments, followed))


if __name__ == "__main__":
    main()
