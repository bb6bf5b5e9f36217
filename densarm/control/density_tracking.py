"""DensityTracking: the density inverse-dynamics controller along a reference."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.control.controller import checked_state
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.density import NavigationDensity, TorusDistance
from densarm.proof.straight_brake import HELD_SHARE
from densarm.reference.reference import Reference


class DensityTracking:
    r"""Track q_d(t), obstacles acting at the true configuration.

    .. math::

        \tau = H + M \big( \ddot q_d + K_p \nabla\rho(e) - K_v \dot e \big), \qquad
        e = q \ominus q_d, \quad \rho(e) = \Psi(q) / V(q \ominus q_d)^\alpha

    In the reciprocal gauge the feedback is smooth at e = 0 and tends to -K_p e. The torque is taken
    to be held for the reference's period: q̈_d is its mean over that time.

    Args:
        arm: the arm.
        density: Ψ at the true configuration, and V, whose goal is moved along the reference.
        reference: q_d(t) and its derivatives.
        gains: K_p and K_v.

    Source: [ZNV] eq. 17.
    """

    def __init__(
        self,
        arm: Arm,
        density: NavigationDensity[TorusDistance],
        reference: Reference,
        gains: Gains,
    ) -> None:
        self._arm = arm
        self._density = density
        self._reference = reference
        self._gains = gains
        self._dynamics = InverseDynamics(arm, HELD_SHARE * arm.limits.acceleration)
        self._gauge = density.parameters.gauge
        self._brake, self._attract = np.zeros(arm.nv), np.zeros(arm.nv)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        point = self._reference.update(t, lead=0.5 * self._reference.period)
        self._density.goal_distance.set_goal_angles(point[0])
        self._density.update(q)
        self._density.write_gradient(self._gauge, self._attract)
        self._dynamics.update(q, v)
        _feedback(point, v, self._gains.position, self._gains.velocity, self._brake, self._attract)
        return self._dynamics.torque(self._brake, self._attract)


@compiled
def _feedback(
    point: Array, v: Array, position_gain: float, velocity_gain: float, brake: Array, attract: Array
) -> None:
    for i in range(v.shape[0]):
        brake[i] = point[2, i] - velocity_gain * (v[i] - point[1, i])
        attract[i] *= position_gain
