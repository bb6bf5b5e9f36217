"""Fig. 2: the inverse bump Psi around a circle sensed in an ellipse, and a square in an egg."""

import math

import numpy as np
import paper_figure as paper
from matplotlib.figure import Figure

from densarm.density.inverse_bump import inverse_bump
from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.integral_curves import integral_curves
from densarm.euclidean.shapes import Ball, Egg, Ellipsoid, PNormBall
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.visualization import figure_style as style

THETA = 0.1  # large enough to be seen
EXTENT = (-3.0, 3.0, -3.0, 3.0)  # [m]
REGIONS = {
    "circle in an ellipse": UnsafeRegion(
        h=Ball(radius=1.0), s=Ellipsoid(scaling=(0.8, 1.3), radius=2.0)
    ),
    "rounded square in an egg": UnsafeRegion(
        h=PNormBall(radius=1.0, p=4.0), s=Egg(a=0.9, b=1.0, c=1.3, radius=2.0)
    ),
}


def bump(region: UnsafeRegion, x: Array) -> Array:
    return inverse_bump(region.h(x), region.s(x), THETA)


def printed_bump(region: UnsafeRegion, x: Array) -> Array:
    """Ψ as eq. 5 to 8 are printed, point by point; the library has it in logistic form."""

    def f(tau: float) -> float:
        return math.exp(-1.0 / tau) if tau > 0.0 else 0.0

    def at(h: float, s: float) -> float:
        if h <= 0.0:
            return THETA
        if s > 0.0:
            return 1.0 + THETA
        tau = h / (h - s)
        return f(tau) / (f(tau) + f(1.0 - tau)) + THETA

    return np.array([at(h, s) for h, s in zip(region.h(x), region.s(x), strict=True)])


def rays(region: UnsafeRegion, count: int = 360) -> tuple[Array, Array]:
    """Points (count, 2) on the rims of the unsafe set and of its sensing region, around 0."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    rims = []
    for function in (region.h, region.s):
        low, high = np.zeros(count), np.full(count, 4.0)
        for _ in range(60):
            middle = 0.5 * (low + high)
            inside = function(middle[:, np.newaxis] * unit) <= 0.0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        rims.append(high[:, np.newaxis] * unit)
    return rims[0], rims[1]


def largest_rim_derivative(region: UnsafeRegion, order: int, step: float = 2.5e-3) -> float:
    """Largest derivative of Ψ along a ray at the rims, from within the sensing region [1/m^order].

    Beyond each rim Ψ is constant, so that it is smooth where all of these vanish.
    """
    h_rim, s_rim = rays(region)
    outward = h_rim / np.linalg.norm(h_rim, axis=1, keepdims=True)
    weights = np.array([(-1) ** (order - k) * math.comb(order, k) for k in range(order + 1)])
    largest = 0.0
    for rim, sign in ((h_rim, 1.0), (s_rim, -1.0)):
        points = [bump(region, rim + sign * step * k * outward) for k in range(order + 1)]
        largest = max(largest, float(np.abs(weights @ points).max()) / step**order)
    return largest


def checks(region: UnsafeRegion, x: Array, starts: int) -> dict[str, float | bool]:
    """What eq. 8, the sets' own geometry and the density's purpose ask of a bump."""
    h, s, psi = region.h(x), region.s(x), bump(region, x)
    h_rim, s_rim = rays(region)
    share = np.linspace(0.0, 1.0, 200)[:, np.newaxis, np.newaxis]
    rise = np.diff(bump(region, h_rim + share * (s_rim - h_rim)), axis=0)
    few = x[:: max(1, len(x) // 20_000)]
    field = EuclideanDensity([region], (2.9, -1.1), DensityParameters(gauge=Gauge.LOG))
    around = np.random.default_rng(2).uniform(-3.0, 3.0, (4 * starts + 50, 2))
    curves = integral_curves(field, around[region.h(around) > 0.0][:starts])
    return {
        "psi_in_unsafe_set_min": float(psi[h <= 0.0].min()),
        "psi_in_unsafe_set_max": float(psi[h <= 0.0].max()),
        "psi_beyond_sensing_region_min": float(psi[(h > 0.0) & (s >= 0.0)].min()),
        "psi_beyond_sensing_region_max": float(psi[(h > 0.0) & (s >= 0.0)].max()),
        "largest_difference_from_eq_5_to_8": float(
            np.abs(printed_bump(region, few) - bump(region, few)).max()
        ),
        "largest_fall_on_the_way_out": float(-min(0.0, rise.min())),
        **{
            f"largest_derivative_of_order_{order}_at_the_rims": largest_rim_derivative(
                region, order
            )
            for order in (1, 2, 3)
        },
        "sensing_region_contains_unsafe_set": bool((s[h <= 0.0] < 0.0).all()),
        "unsafe_area_m2": float((h <= 0.0).mean() * 36.0),
        "sensing_area_m2": float(((h > 0.0) & (s < 0.0)).mean() * 36.0),
        "starts": starts,
        "reached": curves.count(Outcome.REACHED),
        "entered": curves.count(Outcome.COLLIDED),
    }


def is_inverse_bump(numbers: dict[str, float | bool]) -> bool:
    inside = (numbers["psi_in_unsafe_set_min"], numbers["psi_in_unsafe_set_max"])
    outside = (numbers["psi_beyond_sensing_region_min"], numbers["psi_beyond_sensing_region_max"])
    slopes = [numbers[f"largest_derivative_of_order_{order}_at_the_rims"] for order in (1, 2, 3)]
    return bool(
        np.allclose(inside, THETA, atol=1e-12)
        and np.allclose(outside, 1.0 + THETA, atol=1e-12)
        and numbers["largest_difference_from_eq_5_to_8"] < 1e-12
        and numbers["largest_fall_on_the_way_out"] < 1e-12
        and max(slopes) < 1e-3
        and numbers["sensing_region_contains_unsafe_set"]
        and numbers["reached"] == numbers["starts"]
    )


def draw() -> Figure:
    figure = style.new_figure(9.0, 7.2)
    # The lower, laid out alone, does not crowd the upper.
    upper, lower = figure.subfigures(2, squeeze=False).ravel()
    first, second = style.plane_grid(EXTENT)
    x = np.stack([first, second], axis=-1)
    for column, (name, region) in enumerate(REGIONS.items()):
        psi = bump(region, x)
        ax = upper.add_subplot(1, 2, 1 + column)
        paper.plane_axes(ax, EXTENT, f"({'ab'[column]}) Ψ: {name}")
        levels = np.linspace(THETA - 1e-9, 1.0 + THETA + 1e-9, 21)
        filled = ax.contourf(first, second, psi, levels, cmap=style.DENSITY_MAP)
        upper.colorbar(filled, ax=ax, label="Ψ [–]", shrink=0.85, ticks=[0.1, 0.35, 0.6, 0.85, 1.1])
        ax.contour(first, second, region.h(x), [0.0], colors="white", linewidths=1.2)
        ax.contour(first, second, region.s(x), [0.0], colors="black", linestyles="--")
        ax.text(0.0, 0.0, "$h\\leq 0$", color="white", ha="center", va="center")
        ax.text(-2.85, -2.85, "solid: $h=0$, dashed: $s=0$", fontsize=8)
        space = lower.add_subplot(1, 2, 1 + column, projection="3d")
        space.plot_surface(
            first,
            second,
            psi,
            cmap=style.DENSITY_MAP,
            rcount=60,
            ccount=60,
            linewidth=0.0,
            rasterized=True,
        )
        paper.space_axes(space, (*EXTENT, 0.0, 1.2), f"({'cd'[column]}) the same as a surface")
        space.set_box_aspect((1.0, 1.0, 0.55))
        space.set_zlabel("Ψ [–]")
    return figure


def main(arguments: list[str] | None = None) -> None:
    options = paper.figure_arguments(__doc__, starts=500, arguments=arguments)
    x = np.stack(style.plane_grid(EXTENT, 1200), axis=-1).reshape(-1, 2)
    numbers = {name: checks(region, x, options.starts) for name, region in REGIONS.items()}
    paper.FigureReport(
        "Fig. 2",
        "For a circle sensed in an ellipse and a rounded square sensed in an egg Ψ is θ on the "
        "unsafe set, 1 + θ beyond the sensing region, and rises in between, its first three "
        "derivatives zero at both rims; by it every start around the set finds its way past it.",
        all(is_inverse_bump(each) for each in numbers.values()),
        {"theta": THETA, **numbers},
        (
            f"θ = {THETA:g} in the picture, so that it is seen; curves are followed with θ = 0.",
            "Radii, the scaling vector and a, b, c are chosen: the paper gives none.",
            paper.GAUGE,
        ),
    ).write(options.out, fig2_inverse_bumps=draw())


if __name__ == "__main__":
    main()
