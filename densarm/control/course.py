"""Course: whether a controller keeps to its motion, and can rest on it."""

from typing import Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.control.controller import Controller
from densarm.planning.motion import Motion
from densarm.values.arrays import Array

USED_SHARE = 0.9
"""Of a motion's tube, which the arm may use."""

_RESUMING_SHARE = 0.8  # of it, or of the distance, from where a controller may go on
_LOST = 0.5  # [rad or m] off, from where no controller is left to return to its motion


class PausingController(Controller, Protocol):
    """A controller along a motion, whose reference can wait, as `DensityTracking`."""

    motion: Motion

    @property
    def reference(self) -> Array:
        """The joint positions (nv,) that were wanted at the last call [rad or m]."""
        ...

    @property
    def is_paused(self) -> bool:
        """Whether the reference was made to pause, and rests."""
        ...

    def pause(self) -> None:
        """Let the reference come to rest on its motion."""
        ...

    def resume(self, q: ArrayLike | None = None, within: float | Array = np.inf) -> bool:
        """Let it go on from where it paused, or from near q (nq,); return whether it does."""
        ...


class Course:
    """Tells how far an arm is off a controller's reference.

    Inside the tube in which its motion is proved clear nothing is wrong. Near the end of it the
    controller is to pause, and to return to its motion: an arm that was pushed off it is turned
    away from what is near so, and a straight line is not. Far from it the arm is astray, and
    without a tube at a distance [rad or m].

    Args:
        arm: the arm.
        controller: what it is driven by.
        most: the distance [rad or m]; None where nothing is looked at, so that none can be left.
    """

    def __init__(self, arm: Arm, controller: Controller, most: float | None) -> None:
        self._arm, self._controller = arm, controller
        self._most = np.inf if most is None else most
        self.pausing: PausingController | None = None
        """The controller, if it can pause."""
        self._tube: Array | None = None
        if most is not None and hasattr(controller, "pause"):
            self.pausing = cast("PausingController", controller)
            self._tube = self.pausing.motion.tube

    @property
    def is_paused(self) -> bool:
        """Whether the controller paused, and its reference rests."""
        return self.pausing is not None and self.pausing.is_paused

    def resume(self, q: Array | None) -> bool:
        """Let a controller that can pause go on, as it does; others may act as they are."""
        if self.pausing is None:
            return True
        tube = np.full(self._arm.nv, self._most) if self._tube is None else self._tube
        return self.pausing.resume(q, _RESUMING_SHARE * tube)

    def fault(self, q: Array) -> tuple[str, bool]:
        """Return in which way the arm at q (nq,) is off its course, and whether it is astray.

        The phrase is empty where nothing is wrong.
        """
        if self.pausing is None or self._tube is None:
            off = float(getattr(self._controller, "tracking_error", None) or 0.0)
            is_astray = not off <= self._most
            return f"{off:.3g} rad or m" if is_astray else "", is_astray
        wanted = self._arm.configurations(self.pausing.reference)
        error = np.abs(self._arm.difference(wanted, q))
        joint = int((error / self._tube).argmax())
        if error[joint] <= USED_SHARE * self._tube[joint]:
            return "", False
        told = f"{error[joint]:.3g} rad or m in {self._arm.joint_names[joint]}"
        is_astray = not bool(error.max() <= max(_LOST, self._tube.max()))
        return f"{told}, where {self._tube[joint]:.3g} are proved clear", is_astray
