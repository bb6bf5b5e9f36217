"""Plants: what a controller drives, by forward dynamics or by velocity."""

from enum import StrEnum
from typing import Protocol

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.joint_space import ConfigurationSpace
from densarm.certificates.task import Input, Integrator
from densarm.errors import InvalidValueError
from densarm.simulation.disturbances import Disturbances
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, one_of, positive
from densarm.values.kernels import compiled

_SWEEPS = 200  # over the joints, in search of the friction that holds them
_SETTLED = 1e-12  # [rad/s or m/s], change of a sweep


class Plant(Protocol):
    """A simulated arm. One with an attribute `input` that is "velocity" is told velocities.

    A method `describe_contact()`, if there is one, returns what touched in the last step, as a
    phrase, and ends a run as `collided`. An attribute `disturbances` tells how it differs from the
    arm's model.
    """

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

    Where it has friction, viscous D and dry c, the velocity after a step is that of

    .. math:: (M + \Delta t D)\,\dot q^+ = M \dot q + \Delta t\,(\tau - H - f), \quad
        f_i = c_i \operatorname{sign} \dot q^+_i \ \text{or} \ \dot q^+_i = 0, |f_i| \le c_i,

    so that a joint sticks as long as friction can hold it.

    Args:
        arm: the arm.
        dt: time step [s].
        integrator: see `Integrator`.
        disturbances: how the arm differs from its model; `simulate` adds those of signals.

    Raises:
        RobotDescriptionError: the arm has links without a mass.
        InvalidValueError: friction under another integrator than the first, or disturbances of
            another arm.

    Source: Featherstone, Rigid Body Dynamics Algorithms, ch. 7; Stewart and Trinkle, An implicit
        time-stepping scheme for rigid body dynamics, 1996, for friction.
    """

    input = Input.TORQUE
    name = "pinocchio"

    def __init__(
        self,
        arm: Arm,
        dt: float = 0.001,
        integrator: Integrator = Integrator.SEMI_IMPLICIT_EULER,
        disturbances: Disturbances = Disturbances(),
    ) -> None:
        arm.require_masses("a plant driven by torque")
        self.disturbances = disturbances
        self._model = disturbances.model(arm) if disturbances.of_the_body else arm.model
        self._data = self._model.createData()
        self.dt = dt
        self._integrator = one_of("integrator", integrator, list(Integrator))
        self._viscous = disturbances.joint_values("viscous", arm)
        self._coulomb = disturbances.joint_values("coulomb", arm)
        self._has_friction = bool(self._viscous.any() or self._coulomb.any())
        self._friction = np.zeros(arm.nv)
        if self._has_friction and integrator != Integrator.SEMI_IMPLICIT_EULER:
            allowed = f"{str(Integrator.SEMI_IMPLICIT_EULER)!r} where joints have friction"
            raise InvalidValueError("integrator", str(integrator), allowed)

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Act as `Plant.step`, u the torque [N·m or N]."""
        dt, model, data = self.dt, self._model, self._data
        if self._has_friction:
            v = self._after_friction(q, v, u)
            return pin.integrate(model, q, dt * v), v
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

    def _after_friction(self, q: Array, v: Array, u: Array) -> Array:
        dt, upper = self.dt, np.triu(pin.crba(self._model, self._data, q))
        mass = upper + np.triu(upper, 1).T
        inverse = np.linalg.inv(mass + dt * np.diag(self._viscous))
        bias = pin.nonLinearEffects(self._model, self._data, q, v)
        free = inverse @ (mass @ v + dt * (u - bias))
        return _with_dry_friction(free, dt * inverse, self._coulomb, self._friction)


@compiled
def _with_dry_friction(free: Array, inverse: Array, most: Array, friction: Array) -> Array:
    """Return the velocity (nv,) [rad/s or m/s] with dry friction, by projected Gauss-Seidel.

    Args:
        free: velocity without it (nv,).
        inverse: what a unit of torque during the step adds to the velocity (nv, nv).
        most: largest friction (nv,) [N·m or N].
        friction: that of the step before, where the search begins; overwritten (nv,).
    """
    v = free - inverse @ friction
    for _ in range(_SWEEPS):
        largest = 0.0
        for i in range(v.size):
            held = friction[i] + v[i] / inverse[i, i]
            change = min(most[i], max(-most[i], held)) - friction[i]
            friction[i] += change
            v -= change * inverse[:, i]
            largest = max(largest, abs(change) * inverse[i, i])
        if largest < _SETTLED:
            break
    return v


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

    def __repr__(self) -> str:
        return f"SingleIntegrator({self._space}, dt={self.dt:g})"

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Return configurations and velocities one time step later, as `Plant.step`.

        Args:
            q: configurations (..., nq).
            v: velocities (..., nv) [rad/s or m/s], which do not matter.
            u: commanded velocities (..., nv) [rad/s or m/s].
        """
        velocity = u + self._deviation * self._random.standard_normal(v.shape)
        return self._space.integrate(q, self.dt * velocity), velocity
