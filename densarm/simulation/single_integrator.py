"""SingleIntegrator: a plant that moves with the velocity it is told, and with noise."""

from enum import StrEnum

import numpy as np

from densarm.arrays import Array
from densarm.configuration_space import ConfigurationSpace
from densarm.control.velocity_controller import VelocityController
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
    r"""A `Plant` whose input is a velocity: q̇ = u + w.

    .. math:: q^+ = q \oplus \Delta t\,(u + w)

    Under noise the velocity never settles, so that `FixedStepLoop` calls no goal reached.

    Args:
        space: of q: the joint space of an arm, or Rⁿ.
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
        space: ConfigurationSpace,
        dt: float,
        noise: float = 0.0,
        scaling: NoiseScaling = NoiseScaling.WHITE,
        seed: int = 0,
    ) -> None:
        self._space = space
        self.dt = positive("dt", dt)
        one_of("scaling", scaling, list(NoiseScaling))
        power = 1.0 if scaling == NoiseScaling.HELD else 1.0 / dt
        self._deviation = np.sqrt(non_negative("noise", noise) * power)
        self._random = np.random.default_rng(seed)

    def control(self, controller: VelocityController, t: float, q: Array, v: Array) -> Array:
        """Return the commanded velocity (nv,) [rad/s or m/s], as `Plant.control`."""
        return controller.velocity(t, q, v)

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Return configurations and velocities one time step later, as `Plant.step`.

        Args:
            q: configurations (..., nq).
            v: velocities (..., nv) [rad/s or m/s], which do not matter.
            u: commanded velocities (..., nv) [rad/s or m/s].
        """
        velocity = u + self._deviation * self._random.standard_normal(v.shape)
        return self._space.integrate(q, self.dt * velocity), velocity
