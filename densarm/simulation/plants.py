"""Plants: what a controller drives, by forward dynamics or by velocity."""

from enum import StrEnum
from typing import Protocol

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.joint_space import ConfigurationSpace
from densarm.certificates.task import Input, Integrator
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, one_of, positive


class Plant(Protocol):
    """A simulated arm. One with an attribute `input` that is "velocity" is told velocities."""

    @property
    def dt(self) -> float:
        """Time step [s]."""
        ...

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Return the state one time step later.

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            u: torque [N·m or N], or velocity, held during the step (nv,).
        """
        ...


class PinocchioPlant:
    r"""A `Plant` whose input is torque: forward dynamics by the articulated-body algorithm.

    .. math:: \ddot q = M(q)^{-1} (\tau - H(q, \dot q))

    Args:
        arm: the arm.
        dt: time step [s].
        integrator: see `Integrator`.

    Raises:
        RobotDescriptionError: the arm has links without a mass.

    Source: Featherstone, Rigid Body Dynamics Algorithms, ch. 7.
    """

    input = Input.TORQUE

    def __init__(
        self, arm: Arm, dt: float = 0.001, integrator: Integrator = Integrator.SEMI_IMPLICIT_EULER
    ) -> None:
        arm.require_masses("a plant driven by torque")
        self._model = arm.model
        self._data = arm.model.createData()
        self.dt = dt
        self._integrator = one_of("integrator", integrator, list(Integrator))

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Act as `Plant.step`, u the torque [N·m or N]."""
        dt, model, data = self.dt, self._model, self._data
        a1 = pin.aba(model, data, q, v, u).copy()
        if self._integrator == Integrator.SEMI_IMPLICIT_EULER:
            v = v + dt * a1
            return pin.integrate(model, q, dt * v), v
        v2 = v + 0.5 * dt * a1
        a2 = pin.aba(model, data, pin.integrate(model, q, 0.5 * dt * v), v2, u).copy()
        v3 = v + 0.5 * dt * a2
        a3 = pin.aba(model, data, pin.integrate(model, q, 0.5 * dt * v2), v3, u).copy()
        v4 = v + dt * a3
        a4 = pin.aba(model, data, pin.integrate(model, q, dt * v3), v4, u)
        step = dt / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        return pin.integrate(model, q, step), v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


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

    Under noise the velocity never settles, so that no goal counts as reached.

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

    input = Input.VELOCITY

    def __init__(
        self,
        space: ConfigurationSpace,
        dt: float = 0.001,
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

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Return configurations and velocities one time step later, as `Plant.step`.

        Args:
            q: configurations (..., nq).
            v: velocities (..., nv) [rad/s or m/s], which do not matter.
            u: commanded velocities (..., nv) [rad/s or m/s].
        """
        velocity = u + self._deviation * self._random.standard_normal(v.shape)
        return self._space.integrate(q, self.dt * velocity), velocity
