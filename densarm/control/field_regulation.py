"""FieldRegulation: the inverse-dynamics controller that follows a planning system."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import checked_state
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.stopping_guard import StoppingGuard
from densarm.fields.velocity_field import VelocityField
from densarm.proof.straight_brake import HELD_SHARE


class FieldRegulation:
    r"""Regulate to the goal along a velocity field, without a reference in time.

    .. math:: \tau = H + M K_v (k(q) - \dot q)

    With the field of the density, k = (K_p/K_v) ∇ρ at the speed of the speed law, this is [ZNV]
    eq. 17 with a constant q_d, its attraction scaled before its damping. Where the arm could no
    longer stop in the free space ahead, it brakes in a straight line.

    Args:
        arm: the arm.
        field: the planning system k(q).
        gains: K_v is used.
        period: time between two calls [s].

    Source: [ZNV] eq. 17.
    """

    def __init__(self, arm: Arm, field: VelocityField, gains: Gains, period: float) -> None:
        self._arm = arm
        self._field = field
        self._gain = gains.velocity
        self._dynamics = InverseDynamics(arm, HELD_SHARE * arm.limits.acceleration)
        self._guard = StoppingGuard(arm, field.speed_law, gains, period)
        # Kernels are loaded, or compiled, here rather than in the first step of a control loop.
        self.torque(-np.inf, arm.configuration(np.zeros(arm.nv)), np.zeros(arm.nv))
        field.restart()

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        attract = self._gain * self._field.update(q)
        self._dynamics.update(q, v)
        wanted = self._dynamics.torque(-self._gain * v, attract)
        return self._guard.torque(t, self._dynamics, q, v, wanted, self._field.distances)
