"""Workspace: where an arm's end effector can be."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array

_SAMPLES = 1000


class Workspace:
    """The positions of an arm's end effector, and random configurations that take it there.

    Args:
        arm: the arm.
    """

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self._data = arm.model.createData()
        limits, turn = arm.limits, np.where(arm.is_circle, np.pi, np.inf)
        self._lower, self._upper = np.maximum(limits.lower, -turn), np.minimum(limits.upper, turn)
        random = np.random.default_rng(0)
        tips = np.array([self.tip(self.draw(random)) for _ in range(_SAMPLES)])
        self.centre: Array = self._data.oMi[1].translation.copy()
        """Where the first joint is (3,) [m]."""
        self.reach = float(np.linalg.norm(tips - self.centre, axis=1).max())
        """Largest distance of the end effector from there, of many at random [m]."""

    def draw(self, random: np.random.Generator) -> Array:
        """Return a configuration (nq,) evenly within the limits, circles from a whole turn."""
        return self.arm.configurations(random.uniform(self._lower, self._upper))

    def tip(self, q: Array) -> Array:
        """Return the position of the end effector (3,) at q (nq,) [m]."""
        frame = self.arm.end_effector_frame
        pin.forwardKinematics(self.arm.model, self._data, q)
        return np.array(pin.updateFramePlacement(self.arm.model, self._data, frame).translation)
