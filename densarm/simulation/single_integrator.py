"""SingleIntegrator: a point of Rⁿ whose velocity is the control, with noise."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.density.implicit_function import smallest_value
from densarm.fields.navigation_field import NavigationField
from densarm.fields.saturation import saturate
from densarm.outcome import Outcome
from densarm.validation import non_negative, one_of, positive


class NoiseScaling(StrEnum):
    """How the variance Σ of control noise meets the time step Δt."""

    HELD = "held"
    """w ~ N(0, Σ I) is drawn for every step and held during it: Σ in m²/s². A step moves the
    point by N(0, Σ Δt²), so that finer steps make the noise vanish."""
    WHITE = "white"
    """w is white noise of intensity Σ in m²/s: a step moves the point by N(0, Σ Δt), by
    Euler and Maruyama, so that the statistics do not depend on the step."""


class SingleIntegrator:
    r"""A `Plant` whose control is a velocity: ẋ = u + w.

    .. math:: x^+ = x + \Delta t\,(u + w)

    Args:
        dt: Δt [s].
        noise: variance Σ ≥ 0 of each component of w, in the unit of its scaling.
        scaling: see `NoiseScaling`.
        seed: of the noise.

    Raises:
        InvalidValueError: a value out of its range.

    Source: [ZNV] eq. 1 and 15.
    """

    def __init__(
        self,
        dt: float,
        noise: float = 0.0,
        scaling: NoiseScaling = NoiseScaling.WHITE,
        seed: int = 0,
    ) -> None:
        self.dt = positive("dt", dt)
        one_of("scaling", scaling, list(NoiseScaling))
        power = 1.0 if scaling == NoiseScaling.HELD else 1.0 / dt
        self._deviation = np.sqrt(non_negative("noise", noise) * power)
        self._random = np.random.default_rng(seed)

    def step(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Return position and velocity one time step later, as `Plant.step`.

        Args:
            q: positions (..., n) [m].
            v: velocities (..., n) [m/s], which do not matter.
            tau: control u (..., n) [m/s].
        """
        velocity = tau + self._deviation * self._random.standard_normal(v.shape)
        return q + self.dt * velocity, velocity


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
    x, v = np.array(starts, np.float64), np.zeros_like(starts, np.float64)
    outcome = np.full(len(x), Outcome.TIMED_OUT, dtype="U10")
    active = np.ones(len(x), dtype=bool)
    positions, controls = [], []
    for _ in range(round(time_limit / plant.dt) + 1):
        positions.append(x)
        reached = np.linalg.norm(x - field.goal, axis=-1) <= reach_radius
        outcome[active & reached] = Outcome.REACHED
        outcome[active & (smallest_value(field.obstacles, x) <= 0.0)] = Outcome.COLLIDED
        active &= outcome == Outcome.TIMED_OUT
        u = np.zeros_like(x)
        if active.any():
            u[active] = saturate(gain * field.direction(x[active]), u_max)
        controls.append(u)
        if not active.any():
            break
        stepped, v = plant.step(x, v, u)
        x = np.where(active[:, np.newaxis], stepped, x)
    controls[-1] = np.zeros_like(x)
    time: Array = plant.dt * np.arange(len(positions), dtype=np.float64)
    return PointRuns(time, np.array(positions), np.array(controls), outcome)
