"""Plant: the simulated arm, stepped by a named integrator."""

from enum import StrEnum
from typing import Protocol

import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array


class Integrator(StrEnum):
    """How a plant advances by one step."""

    SEMI_IMPLICIT_EULER = "semi_implicit_euler"
    """v⁺ = v + a Δt, then q⁺ = q ⊕ v⁺ Δt."""
    RK4 = "rk4"
    """The classical Runge-Kutta method of order four, torque held."""


class Plant(Protocol):
    """A torque-driven arm."""

    def step(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Return the state one time step later.

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            tau: torque held during the step (nv,) [N·m or N].
        """
        ...


class PinocchioPlant:
    r"""Forward dynamics by the articulated-body algorithm.

    .. math:: \ddot q = M(q)^{-1} (\tau - H(q, \dot q))

    Args:
        arm: the arm.
        dt: time step [s].
        integrator: see `Integrator`.

    Source: Featherstone, Rigid Body Dynamics Algorithms, ch. 7.
    """

    def __init__(self, arm: Arm, dt: float, integrator: Integrator) -> None:
        self._model = arm.model
        self._data = arm.model.createData()
        self._dt = dt
        self._advance = {
            Integrator.SEMI_IMPLICIT_EULER: self._semi_implicit_euler,
            Integrator.RK4: self._rk4,
        }[integrator]

    def step(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """Act as `Plant.step`."""
        return self._advance(q, v, tau)

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        """Return the acceleration (nv,) [rad/s²] of a torque, overwritten by the next call."""
        return pin.aba(self._model, self._data, q, v, tau)  # type: ignore[no-any-return]

    def _semi_implicit_euler(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        v = v + self._dt * self.acceleration(q, v, tau)
        return pin.integrate(self._model, q, self._dt * v), v

    def _rk4(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        dt, model = self._dt, self._model
        a1 = self.acceleration(q, v, tau).copy()
        v2 = v + 0.5 * dt * a1
        a2 = self.acceleration(pin.integrate(model, q, 0.5 * dt * v), v2, tau).copy()
        v3 = v + 0.5 * dt * a2
        a3 = self.acceleration(pin.integrate(model, q, 0.5 * dt * v2), v3, tau).copy()
        v4 = v + dt * a3
        a4 = self.acceleration(pin.integrate(model, q, dt * v3), v4, tau)
        step = dt / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        return pin.integrate(model, q, step), v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
