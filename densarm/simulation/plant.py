"""Plant: what a controller drives, and the arm by its forward dynamics."""

from enum import StrEnum
from typing import Protocol, TypeVar

import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import Controller

C_contra = TypeVar("C_contra", contravariant=True)


class Integrator(StrEnum):
    """How a plant advances by one step."""

    SEMI_IMPLICIT_EULER = "semi_implicit_euler"
    """v⁺ = v + a Δt, then q⁺ = q ⊕ v⁺ Δt."""
    RK4 = "rk4"
    """The classical Runge-Kutta method of order four, torque held."""


class Plant(Protocol[C_contra]):
    """A simulated system, driven by the input that controllers of one kind supply."""

    @property
    def dt(self) -> float:
        """Time step [s]."""
        ...

    def control(self, controller: C_contra, t: float, q: Array, v: Array) -> Array:
        """Return the input u (nv,) that a controller chooses at a time [s] and state."""
        ...

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Return the state one time step later.

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            u: input held during the step (nv,).
        """
        ...


class PinocchioPlant:
    r"""A `Plant` whose input is torque: forward dynamics by the articulated-body algorithm.

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
        self.dt = dt
        self._advance = {
            Integrator.SEMI_IMPLICIT_EULER: self._semi_implicit_euler,
            Integrator.RK4: self._rk4,
        }[integrator]

    def control(self, controller: Controller, t: float, q: Array, v: Array) -> Array:
        """Return the torque (nv,) [N·m or N], as `Plant.control`."""
        return controller.torque(t, q, v)

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Act as `Plant.step`, u the torque [N·m or N]."""
        return self._advance(q, v, u)

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        """Return the acceleration (nv,) [rad/s²] of a torque, overwritten by the next call."""
        return pin.aba(self._model, self._data, q, v, tau)  # type: ignore[no-any-return]

    def _semi_implicit_euler(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        v = v + self.dt * self.acceleration(q, v, tau)
        return pin.integrate(self._model, q, self.dt * v), v

    def _rk4(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        dt, model = self.dt, self._model
        a1 = self.acceleration(q, v, tau).copy()
        v2 = v + 0.5 * dt * a1
        a2 = self.acceleration(pin.integrate(model, q, 0.5 * dt * v), v2, tau).copy()
        v3 = v + 0.5 * dt * a2
        a3 = self.acceleration(pin.integrate(model, q, 0.5 * dt * v2), v3, tau).copy()
        v4 = v + dt * a3
        a4 = self.acceleration(pin.integrate(model, q, dt * v3), v4, tau)
        step = dt / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        return pin.integrate(model, q, step), v + dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
