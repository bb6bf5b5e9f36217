"""InverseDynamics: torque for wanted accelerations, within the limits of the arm."""

import math

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.dynamics import Kinematics
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part

# Rows of the kernel's table: accelerations, the torques that they need, limits, and the result.
BRAKE, ATTRACT, _BRAKE_TORQUE, _ATTRACT_TORQUE = 0, 1, 2, 3
_ACCELERATION_LIMIT, _EFFORT_LIMIT, _ZERO, TORQUE = 4, 5, 6, 7


class InverseDynamics:
    r"""Turns a braking and an attracting part into torque, so that saturation spares braking.

    .. math:: \tau = H(q, \dot q) + M(q) (\gamma\, a_{brake} + \beta\, a_{attract})

    β in [0, 1] is the largest for which acceleration and torque limits hold with γ = 1; where
    there is none, β = 0 and γ is the largest that holds them, which leaves a brake straight.

    Args:
        arm: its dynamics and torque limits.
        acceleration_limit: on the sum of both parts (nv,) [rad/s² or m/s²]; may be infinite.
        kinematics: M, which its owner updates to q before each `update`; None for its own.

    Attributes:
        terms: M (upper triangle) and H of the last update.
        rows: table of `limited_torque` (8, nv).

    Raises:
        RobotDescriptionError: the arm has links without a mass.

    Source: [ZNV] eq. 16-17; saturation [ZNV] eq. 13-14, applied to the attraction alone.
    """

    def __init__(
        self, arm: Arm, acceleration_limit: Array, kinematics: Kinematics | None = None
    ) -> None:
        arm.require_masses("torque")
        self._updates_kinematics = kinematics is None
        self._kinematics = kinematics or Kinematics(arm)
        self.terms: tuple[Array, Array] = (
            self._kinematics.mass_matrix,
            self._kinematics.data.nle,
        )
        self.rows: Array = np.zeros((8, arm.nv))
        self.rows[_ACCELERATION_LIMIT] = acceleration_limit
        self.rows[_EFFORT_LIMIT] = arm.limits.effort

    def load(self) -> None:
        """Load, or compile, the kernel of `torque` before a control loop."""
        self.torque(self.rows[_ZERO], self.rows[_ZERO])

    def update(self, q: Array, v: Array) -> None:
        """Compute M and H at the state, q (nq,) and v (nv,)."""
        kinematics = self._kinematics
        if self._updates_kinematics:
            kinematics.update(q)
        pin.nonLinearEffects(kinematics.model, kinematics.data, q, v)

    def mass_matrix(self) -> Array:
        """Return M (nv, nv) at the updated state."""
        upper = np.triu(self._kinematics.mass_matrix)
        return np.asarray(upper + np.triu(upper, 1).T)

    def brake_torque(self, v: Array, duration: float, shortest: float) -> Array:
        """Return the torque (nv,) that stops from v (nv,) along a straight line, in a duration [s].

        It counts as `shortest` where it is shorter, or infinite: as hard as the limits allow.
        """
        longest = max(duration, shortest) if math.isfinite(duration) else shortest
        return self.torque(-v / longest, self.rows[_ZERO])

    def torque(self, brake: Array, attract: Array) -> Array:
        """Return torque (nv,) for accelerations (nv,) [rad/s²] at the updated state."""
        self.rows[BRAKE], self.rows[ATTRACT] = brake, attract
        _limited_torque(*self.terms, self.rows)
        return np.array(self.rows[TORQUE])


@compiled
def _limited_torque(mass: Array, nonlinear: Array, rows: Array) -> None:
    limited_torque(mass, nonlinear, rows)


@compiled_part
def limited_torque(mass: Array, nonlinear: Array, rows: Array) -> None:
    """Write the `TORQUE` of `InverseDynamics` for `BRAKE` and `ATTRACT`, rows of a table (8, nv).

    Of M (nv, nv) the upper triangle is read; H is `nonlinear` (nv,) [N·m or N].
    """
    gamma, beta = _shares(rows[_ZERO], rows[BRAKE], rows[ATTRACT], rows[_ACCELERATION_LIMIT])
    for i in range(nonlinear.shape[0]):
        brake, attract = 0.0, 0.0
        for j in range(nonlinear.shape[0]):
            entry = mass[i, j] if i <= j else mass[j, i]  # crba fills the upper triangle
            brake += entry * gamma * rows[BRAKE, j]
            attract += entry * beta * rows[ATTRACT, j]
        rows[_BRAKE_TORQUE, i] = brake
        rows[_ATTRACT_TORQUE, i] = attract
    effort = rows[_EFFORT_LIMIT]
    gamma, beta = _shares(nonlinear, rows[_BRAKE_TORQUE], rows[_ATTRACT_TORQUE], effort)
    for i in range(nonlinear.shape[0]):
        tau = nonlinear[i] + gamma * rows[_BRAKE_TORQUE, i] + beta * rows[_ATTRACT_TORQUE, i]
        if abs(tau) > effort[i]:
            tau = math.copysign(effort[i], tau)
        rows[TORQUE, i] = tau


@compiled_part
def _shares(offset: Array, brake: Array, attract: Array, limit: Array) -> tuple[float, float]:
    """Return (γ, β) that keep |offset + γ brake + β attract| ≤ limit, as the class says."""
    low, high, share = 0.0, 1.0, 1.0
    for i in range(limit.shape[0]):
        base, most = offset[i] + brake[i], math.copysign(limit[i], attract[i])
        # Without attraction these are infinite, of a sign that tells whether the limit holds.
        least, largest = (-most - base) / attract[i], (most - base) / attract[i]
        if least > low:
            low = least
        if largest < high:
            high = largest
        if brake[i] != 0.0:
            allowed = (math.copysign(limit[i], brake[i]) - offset[i]) / brake[i]
            if allowed < share:
                share = allowed
    if low <= high:
        return 1.0, high
    return (share if share > 0.0 else 0.0), 0.0
