"""PointRuns: single integrators on Rⁿ that follow a field from many starts, side by side."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.euclidean.fields import NavigationField, saturate
from densarm.euclidean.implicit import smallest_value
from densarm.simulation.plants import SingleIntegrator
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome


@dataclass(frozen=True)
class PointRuns:
    """Runs of many points side by side; a point that ended stays where it is, with u = 0."""

    time: Array
    """k Δt (K,) [s]."""
    x: Array
    """Positions (K, N, n) [m]."""
    u: Array
    """Controls held from each sample to the next (K, N, n) [m/s]; the last is zero."""
    error: Array
    """Distances from the goal (K, N) [m]."""
    smallest_h: Array
    """Smallest value of any obstacle's h (K, N), in its unit; +inf of none."""
    outcome: NDArray[np.str_]
    """The word of an `Outcome` (N,): reached, collided or timed_out."""

    @property
    def entered(self) -> NDArray[np.bool_]:
        """Whether an obstacle was entered at some sample (N,)."""
        return self.outcome == Outcome.COLLIDED  # type: ignore[no-any-return]

    def count(self, outcome: Outcome) -> int:
        """Return the number of runs with an outcome."""
        return int(np.count_nonzero(self.outcome == outcome))


def run_points(
    field: Callable[[float], NavigationField],
    plant: SingleIntegrator,
    starts: Array,
    u_max: float,
    duration: float,
    reach_radius: float | None = None,
    gain: float = 1.0,
) -> PointRuns:
    """Run single integrators by u = ū(g k(x, t)), ‖u‖∞ ≤ u_max, until each has ended.

    Contact is looked for at the samples. Of reaching the goal and entering an obstacle the first
    counts.

    Args:
        field: k, its goal and its obstacles as they are at a time [s], as `MovingDensity.at`.
        plant: what is stepped.
        starts: shape (N, n) [m].
        u_max: bound of each component of u [m/s]; infinity for none.
        duration: time after which a run ends [s].
        reach_radius: distance from the goal at which a run has reached it [m]; None if it goes on
            tracking the goal for all of the duration.
        gain: factor g > 0 of the field before the bound, [m/s] per unit of k.

    Source: [ZNV] eq. 13-14.
    """
    x, v = np.array(starts, np.float64), np.zeros_like(starts, np.float64)
    outcome = np.full(len(x), Outcome.TIMED_OUT, dtype="U10")
    active = np.ones(len(x), dtype=bool)
    samples = []
    for k in range(round(duration / plant.dt) + 1):
        now = field(k * plant.dt)
        error = np.linalg.norm(x - now.goal, axis=-1)
        smallest_h = smallest_value(now.obstacles, x)
        if reach_radius is not None:
            outcome[active & (error <= reach_radius)] = Outcome.REACHED
        outcome[active & (smallest_h <= 0.0)] = Outcome.COLLIDED
        active = outcome == Outcome.TIMED_OUT
        u = np.zeros_like(x)
        u[active] = saturate(gain * now.direction(x[active]), u_max)
        samples.append((x, u, error, smallest_h))
        if reach_radius is not None and not active.any():
            break
        stepped, v = plant.step(x, v, u)
        x = np.where(active[:, np.newaxis], stepped, x)
    u[:] = 0.0  # of the last sample, which nothing follows
    time: Array = plant.dt * np.arange(len(samples), dtype=np.float64)
    x, u, error, smallest_h = (np.array(column) for column in zip(*samples, strict=True))
    return PointRuns(time, x, u, error, smallest_h, outcome)
