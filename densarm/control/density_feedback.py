"""DensityFeedback: the plain law u = ∇ρ + d(q, q̇)."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import checked_state
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.stopping_guard import StoppingGuard
from densarm.fields.density_field import DensityField
from densarm.proof.straight_brake import HELD_SHARE


class DensityFeedback:
    r"""Apply the density's gradient as a torque, with a dissipative rest.

    .. math::

        \tau = u_\rho + d(q, \dot q), \qquad u_\rho = K_v M k \parallel \nabla\rho, \quad
        d = H(q, \dot q) - K_v M(q) \dot q

    d cancels the nonlinearities and damps. The torque u_ρ points along ∇ρ itself, so that the arm
    follows M⁻¹∇ρ, the gradient in the metric of its inertia, at the speed of the speed law; the
    inverse dynamics controllers follow ∇ρ. With V in that metric too, an `InertiaDistance`, both
    lead straight from sub-goal to sub-goal, and differ where obstacles are sensed.

    Args:
        arm: the arm.
        field: the planning system k(q).
        gains: K_v is used.
        period: time between two calls [s].

    Source: [ZNV] section V-C, u = ∇ρ + d(q, q̇).
    """

    def __init__(self, arm: Arm, field: DensityField, gains: Gains, period: float) -> None:
        self._arm = arm
        self._field = field
        self._gain = gains.velocity
        self._dynamics = InverseDynamics(arm, HELD_SHARE * arm.limits.acceleration)
        self._guard = StoppingGuard(arm, field.speed_law, gains, period)
        self._metric = 1.0 / arm.mass_matrix(field.guided.chain.q[-1]).diagonal().max()
        # Kernels are loaded, or compiled, here rather than in the first step of a control loop.
        self.torque(-np.inf, arm.configuration(np.zeros(arm.nv)), np.zeros(arm.nv))
        field.restart()

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        self._dynamics.update(q, v)
        metric = self._metric * self._dynamics.mass_matrix()
        attract = self._gain * self._field.update(q, metric)
        wanted = self._dynamics.torque(-self._gain * v, attract)
        return self._guard.torque(t, self._dynamics, q, v, wanted, self._field.distances)
