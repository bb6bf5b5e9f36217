"""Gauge: which monotone function of the density a gradient is taken of."""

from enum import StrEnum


class Gauge(StrEnum):
    """Functions of ρ whose gradients share their direction, hence their integral curves.

    Modifications that depend on the length of the gradient (a blend at the goal, clipping per
    joint, acceleration limits) tell the gauges apart.
    """

    DENSITY = "density"
    """∇ρ, the field of [ZNV] eq. 11: singular at the goal, flat in contact."""

    LOG = "log"
    """∇ ln ρ."""

    RECIPROCAL = "reciprocal"
    """∇(−1/ρ): smooth and zero at the goal for α = 1, unbounded in contact for θ = 0."""
