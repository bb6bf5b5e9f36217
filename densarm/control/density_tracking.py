"""DensityTracking: the density inverse-dynamics controller along a reference."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import checked_state
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.density import NavigationDensity, TorusDistance
from densarm.reference.reference import Reference


class DensityTracking:
    r"""Track q_d(t), obstacles acting at the true configuration.

    .. math::

        \tau = H + M \big( \ddot q_d + K_p \nabla\rho(e) - K_v \dot e \big), \qquad
        e = q \ominus q_d, \quad \rho(e) = \Psi(q) / V(q \ominus q_d)^\alpha

    In the reciprocal gauge the feedback is smooth at e = 0 and tends to -K_p e.

    Args:
        arm: the arm.
        density: its Ψ at the true configuration.
        goal_distance: the density's V, whose goal is moved along the reference.
        reference: q_d(t) and its derivatives.
        gains: K_p and K_v.

    Source: [ZNV] eq. 17.
    """

    def __init__(
        self,
        arm: Arm,
        density: NavigationDensity,
        goal_distance: TorusDistance,
        reference: Reference,
        gains: Gains,
    ) -> None:
        self._arm = arm
        self._density = density
        self._goal_distance = goal_distance
        self._reference = reference
        self._gains = gains
        self._dynamics = InverseDynamics(arm)
        self._attract = np.zeros(arm.nv)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        position, velocity, acceleration = self._reference.update(t)
        self._goal_distance.set_goal_angles(position)
        self._density.update(q)
        self._density.write_gradient(self._density.parameters.gauge, self._attract)
        self._attract *= self._gains.position
        self._dynamics.update(q, v)
        brake = acceleration - self._gains.velocity * (v - velocity)
        return self._dynamics.torque(brake, self._attract)
