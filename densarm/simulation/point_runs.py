"""PointRuns: single integrators on Rⁿ that follow a field from many starts, side by side."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.control.saturated_velocity import SaturatedVelocity
from densarm.density.implicit_function import smallest_value
from densarm.fields.navigation_field import NavigationField
from densarm.outcome import Outcome
from densarm.simulation.single_integrator import SingleIntegrator


@dataclass(frozen=True)
class PointRuns:
    """Runs of many points side by side; a point that ended stays where it is, with u = 0."""

    time: Array
    """k Δt (K,) [s]."""
    x: Array
    """Positions (K, N, n) [m]."""
    u: Array
    """Controls held from each sample to the next (K, N, n) [m/s]; the last is zero."""
    outcome: NDArray[np.str_]
    """The word of an `Outcome` (N,): reached, collided or timed_out."""

    def count(self, outcome: Outcome) -> int:
        """Return the number of runs with an outcome."""
        return int(np.count_nonzero(self.outcome == outcome))


def run_points(
    field: NavigationField,
    plant: SingleIntegrator,
    starts: Array,
    u_max: float,
    time_limit: float,
    reach_radius: float,
    gain: float = 1.0,
) -> PointRuns:
    """Run u = gain · k(x), saturated, on many single integrators until each has ended.

    Args:
        field: k, the goal and the obstacles.
        plant: what is stepped.
        starts: shape (N, n) [m].
        u_max: bound of each component of u [m/s]; infinity for none.
        time_limit: time after which a run ends [s].
        reach_radius: distance from the goal at which a run has reached it [m].
        gain: factor > 0 of the field before the bound, [m/s] per unit of k.

    Returns:
        All samples of all runs. The first of reaching the goal and entering an obstacle counts.
    """
    controller = SaturatedVelocity(field, u_max, gain)
    x, v = np.array(starts, np.float64), np.zeros_like(starts, np.float64)
    outcome = np.full(len(x), Outcome.TIMED_OUT, dtype="U10")
    active = np.ones(len(x), dtype=bool)
    positions, controls = [], []
    for k in range(round(time_limit / plant.dt) + 1):
        positions.append(x)
        reached = np.linalg.norm(x - field.goal, axis=-1) <= reach_radius
        outcome[active & reached] = Outcome.REACHED
        outcome[active & (smallest_value(field.obstacles, x) <= 0.0)] = Outcome.COLLIDED
        active &= outcome == Outcome.TIMED_OUT
        u = np.zeros_like(x)
        if active.any():
            u[active] = plant.control(controller, k * plant.dt, x[active], v[active])
        controls.append(u)
        if not active.any():
            break
        stepped, v = plant.step(x, v, u)
        x = np.where(active[:, np.newaxis], stepped, x)
    controls[-1] = np.zeros_like(x)
    time: Array = plant.dt * np.arange(len(positions), dtype=np.float64)
    return PointRuns(time, np.array(positions), np.array(controls), outcome)
