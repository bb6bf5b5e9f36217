"""FieldVelocity: the planning system of an arm as a velocity controller."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.controller import checked_state
from densarm.fields.velocity_field import VelocityField


class FieldVelocity:
    r"""Command the planning system itself.

    .. math:: u = k(q)

    Args:
        arm: the arm.
        field: k(q), within its speed law.

    Source: [ZNV] eq. 11.
    """

    def __init__(self, arm: Arm, field: VelocityField) -> None:
        self._arm = arm
        self._field = field
        # Kernels are loaded, or compiled, here rather than in the first step of a control loop.
        self.velocity(0.0, arm.configuration(np.zeros(arm.nv)), np.zeros(arm.nv))
        field.restart()

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `VelocityController.velocity`."""
        return self._field.update(checked_state(self._arm, q, v)[0])
