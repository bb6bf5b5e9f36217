"""Fig. 2: the inverse bump Psi around a circle sensed in an ellipse, and a square in an egg."""

import numpy as np
import paper_figure as paper
from matplotlib.figure import Figure

from densarm.density.inverse_bump import inverse_bump
from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.shapes import Ball, Egg, Ellipsoid, PNormBall
from densarm.values.arrays import Array
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


def checks(region: UnsafeRegion, x: Array) -> dict[str, float | bool]:
    """Whether Psi is theta inside, 1 + theta outside, between both in the sensing region."""
    h, s, psi = region.h(x), region.s(x), bump(region, x)
    sensed = (h > 0.0) & (s < 0.0)
    rim = x[(h > 0.0) & (h < 0.02)]
    return {
        "psi_in_unsafe_set_min": float(psi[h <= 0.0].min()),
        "psi_in_unsafe_set_max": float(psi[h <= 0.0].max()),
        "psi_beyond_sensing_region_min": float(psi[(h > 0.0) & (s >= 0.0)].min()),
        "psi_beyond_sensing_region_max": float(psi[(h > 0.0) & (s >= 0.0)].max()),
        "psi_between_in_sensing_region": bool(
            (psi[sensed] >= THETA).all() and (psi[sensed] <= 1.0 + THETA).all()
        ),
        "largest_rise_within_h_below_0.02": float(bump(region, rim).max() - THETA),
        "sensing_region_contains_unsafe_set": bool((s[h <= 0.0] < 0.0).all()),
        "unsafe_area_m2": float((h <= 0.0).mean() * 36.0),
        "sensing_area_m2": float(sensed.mean() * 36.0),
    }


def is_inverse_bump(numbers: dict[str, float | bool]) -> bool:
    inside = (numbers["psi_in_unsafe_set_min"], numbers["psi_in_unsafe_set_max"])
    outside = (numbers["psi_beyond_sensing_region_min"], numbers["psi_beyond_sensing_region_max"])
    return bool(
        np.allclose(inside, THETA, atol=1e-12)
        and np.allclose(outside, 1.0 + THETA, atol=1e-12)
        and numbers["psi_between_in_sensing_region"]
        and numbers["largest_rise_within_h_below_0.02"] < 1e-9
        and numbers["sensing_region_contains_unsafe_set"]
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
    options = paper.figure_arguments(__doc__, starts=0, arguments=arguments)
    paper.save_figure(draw(), options.out, "fig2_inverse_bumps")
    x = np.stack(style.plane_grid(EXTENT, 1200), axis=-1).reshape(-1, 2)
    numbers = {name: checks(region, x) for name, region in REGIONS.items()}
    paper.FigureReport(
        "Fig. 2",
        "Psi is theta on the unsafe set, 1 + theta beyond the sensing region and passes smoothly "
        "between, for a circle sensed in an ellipse and a rounded square sensed in an egg.",
        all(is_inverse_bump(each) for each in numbers.values()),
        {"theta": THETA, **numbers},
    ).write(options.out)


if __name__ == "__main__":
    main()
