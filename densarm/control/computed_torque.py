"""ComputedTorque: the classical tracking controller, which knows of no obstacle."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import checked_state
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.density.goal_distance import TorusDistance
from densarm.proof.straight_brake import HELD_SHARE
from densarm.reference.reference import Reference


class ComputedTorque:
    r"""Track q_d(t) by inverse dynamics and linear feedback.

    .. math::

        \tau = H + M \big( \ddot q_d - K_p e - K_v \dot e \big), \qquad e = q \ominus q_d

    The rival of `DensityTracking`, with the same gains, limits and reference.

    Args:
        arm: the arm.
        reference: q_d(t) and its derivatives.
        gains: K_p and K_v.

    Source: B. Siciliano et al., Robotics: Modelling, Planning and Control, 2009, section 8.5.
    """

    def __init__(self, arm: Arm, reference: Reference, gains: Gains) -> None:
        self._arm = arm
        self._reference = reference
        self._gains = gains
        self._dynamics = InverseDynamics(arm, HELD_SHARE * arm.limits.acceleration)
        self._wanted = TorusDistance(arm, arm.configuration(reference.position[0]))
        self._error = np.zeros(arm.nv)
        # Kernels are loaded, or compiled, here rather than in the first step of a control loop.
        self.torque(0.0, self._wanted.goal, self._error)

    @property
    def tracking_error(self) -> float:
        """Largest |e| of a joint at the last call [rad or m]."""
        return float(np.abs(self._error).max())

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        point = self._reference.update(t, lead=0.5 * self._reference.period)
        self._wanted.set_goal_angles(point[0])
        self._error = self._wanted.error(q)
        self._dynamics.update(q, v)
        brake = point[2] - self._gains.velocity * (v - point[1])
        return self._dynamics.torque(brake, -self._gains.position * self._error)
