"""InverseDynamics: torque for wanted accelerations, within the limits of the arm."""

import math

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.compiled import compiled


class InverseDynamics:
    r"""Turns a braking and an attracting part into torque, so that saturation spares braking.

    .. math:: \tau = H(q, \dot q) + M(q) (\gamma\, a_{brake} + \beta\, a_{attract})

    β in [0, 1] is the largest for which acceleration and torque limits hold with γ = 1; where
    there is none, β = 0 and γ is the largest that holds them, which leaves a brake straight.

    Args:
        arm: its dynamics and torque limits.
        acceleration_limit: on the sum of both parts (nv,) [rad/s² or m/s²]; may be infinite.
        mass_data: data in which M is computed at q before every update; None to compute it.

    Source: [ZNV] eq. 16-17; saturation [ZNV] eq. 13-14, applied to the attraction alone.
    """

    def __init__(
        self, arm: Arm, acceleration_limit: Array, mass_data: pin.Data | None = None
    ) -> None:
        self._model = arm.model
        self._computes_mass = mass_data is None
        self._data = arm.model.createData() if mass_data is None else mass_data
        self._mass = self._data.M
        limits_and_parts = np.zeros((5, arm.nv))
        limits_and_parts[:2] = acceleration_limit, arm.limits.effort
        self.terms: tuple[Array, Array, Array] = (self._mass, self._data.nle, limits_and_parts)
        """M and H of the last update, limits and parts, as `limited_torque` takes them."""

    def update(self, q: Array, v: Array) -> None:
        """Compute M and H at the state, q (nq,) and v (nv,)."""
        if self._computes_mass:
            pin.crba(self._model, self._data, q)
        pin.nonLinearEffects(self._model, self._data, q, v)

    def mass_matrix(self) -> Array:
        """Return M (nv, nv) at the updated state."""
        upper = np.triu(self._mass)
        return np.asarray(upper + np.triu(upper, 1).T)

    def brake_torque(self, v: Array, duration: float, shortest: float) -> Array:
        """Return the torque (nv,) of the straight brake, at the updated state.

        Args:
            v: velocity (nv,) [rad/s or m/s].
            duration: time to go [s]; if infinite the brake is as hard as the limits allow.
            shortest: time below which it does not count as shorter [s].
        """
        longest = max(duration, shortest) if math.isfinite(duration) else shortest
        return self.torque(-v / longest, np.zeros_like(v))

    def torque(self, brake: Array, attract: Array) -> Array:
        """Return torque (nv,) for accelerations (nv,) [rad/s²] at the updated state."""
        tau = np.empty(len(brake))
        limited_torque(*self.terms, brake, attract, tau)
        return tau


@compiled
def _shares(offset: Array, brake: Array, attract: Array, limit: Array) -> tuple[float, float]:
    """Return (γ, β) that keep |offset + γ brake + β attract| ≤ limit, as the class says."""
    low, high = 0.0, 1.0
    for i in range(limit.shape[0]):
        base = offset[i] + brake[i]
        if attract[i] != 0.0:
            a = (-limit[i] - base) / attract[i]
            b = (limit[i] - base) / attract[i]
            low, high = max(low, min(a, b)), min(high, max(a, b))
        elif abs(base) > limit[i]:
            high = -1.0
    if low <= high:
        return 1.0, high
    share = 1.0
    for i in range(limit.shape[0]):
        if brake[i] != 0.0:
            bound = limit[i] if brake[i] > 0.0 else -limit[i]
            share = min(share, (bound - offset[i]) / brake[i])
    return max(share, 0.0), 0.0


@compiled
def limited_torque(
    mass: Array,
    nonlinear: Array,
    limits_and_parts: Array,
    brake: Array,
    attract: Array,
    out: Array,
) -> None:
    """Write the torque of `InverseDynamics`.

    Args:
        mass: M, of which the upper triangle is read (nv, nv).
        nonlinear: H (nv,) [N·m or N].
        limits_and_parts: limits of acceleration [rad/s² or m/s²] and torque [N·m or N], zeros, and
            the parts of the torque, which are overwritten (5, nv).
        brake: its acceleration (nv,) [rad/s² or m/s²].
        attract: its acceleration (nv,) [rad/s² or m/s²].
        out: overwritten (nv,).
    """
    nv = nonlinear.shape[0]
    acceleration_limit, effort_limit = limits_and_parts[0], limits_and_parts[1]
    zero, brake_torque = limits_and_parts[2], limits_and_parts[3]
    attract_torque = limits_and_parts[4]
    gamma, beta = _shares(zero, brake, attract, acceleration_limit)
    for i in range(nv):
        brake_torque[i] = attract_torque[i] = 0.0
        for j in range(nv):
            entry = mass[i, j] if i <= j else mass[j, i]  # crba fills the upper triangle
            brake_torque[i] += entry * gamma * brake[j]
            attract_torque[i] += entry * beta * attract[j]
    gamma, beta = _shares(nonlinear, brake_torque, attract_torque, effort_limit)
    for i in range(nv):
        wanted = nonlinear[i] + gamma * brake_torque[i] + beta * attract_torque[i]
        out[i] = min(max(wanted, -effort_limit[i]), effort_limit[i])
