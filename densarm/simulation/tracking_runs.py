"""TrackingRuns: many points of Rⁿ that follow a moving target, side by side."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.density.implicit_function import smallest_value
from densarm.fields.navigation_field import NavigationField
from densarm.fields.saturation import saturate
from densarm.simulation.single_integrator import SingleIntegrator


class MovingField(Protocol):
    """A planning system ẋ = k(x, t) on Rⁿ."""

    def at(self, time: float) -> NavigationField:
        """Return the field, its goal and its obstacles as they are at a time [s]."""
        ...


@dataclass(frozen=True)
class TrackingRuns:
    """Runs of many points; one that an obstacle met stays where it was met, with u = 0."""

    time: Array
    """k Δt (K,) [s]."""
    x: Array
    """Positions (K, N, n) [m]."""
    u: Array
    """Controls held from each sample to the next (K, N, n) [m/s]; the last is zero."""
    error: Array
    """Distances from the target (K, N) [m]."""
    smallest_h: Array
    """Smallest value of any obstacle's h (K, N), in its unit; +inf of none."""
    entered: NDArray[np.bool_]
    """Whether an obstacle was entered at some sample (N,)."""


def track_points(
    field: MovingField, plant: SingleIntegrator, starts: Array, u_max: float, duration: float
) -> TrackingRuns:
    """Run u = k(x, t), saturated, on many single integrators.

    Contact is looked for at the samples: between two of them an obstacle and a point that pass
    each other at a relative speed v overlap by at most (v Δt)²/(8 R), R the obstacle's radius of
    curvature.

    Args:
        field: k, the goal and the obstacles over time.
        plant: what is stepped.
        starts: shape (N, n) [m].
        u_max: bound of each component of u [m/s]; infinity for none.
        duration: of the runs [s].

    Returns:
        All samples of all runs.
    """
    x, v = np.array(starts, np.float64), np.zeros_like(starts, np.float64)
    steps = round(duration / plant.dt)
    positions, controls = np.empty((2, steps + 1, *x.shape))
    error, smallest = np.empty((2, steps + 1, len(x)))
    entered = np.zeros(len(x), dtype=bool)
    time: Array = plant.dt * np.arange(steps + 1, dtype=np.float64)
    for k, now in enumerate(time):
        snapshot = field.at(float(now))
        positions[k] = x
        error[k] = np.linalg.norm(x - snapshot.goal, axis=-1)
        smallest[k] = smallest_value(snapshot.obstacles, x)
        entered |= smallest[k] <= 0.0
        moving = ~entered & (k < steps)
        u = np.zeros_like(x)
        u[moving] = saturate(snapshot.direction(x[moving]), u_max)
        controls[k] = u
        stepped, v = plant.step(x, v, u)
        x = np.where(moving[:, np.newaxis], stepped, x)
    return TrackingRuns(time, positions, controls, error, smallest, entered)
