"""TimedController: a controller that keeps the time of each of its steps."""

import time

from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.control.controller import Controller


class TimedController:
    """Passes calls on, and measures them.

    Args:
        controller: what is measured.

    Attributes:
        seconds: duration of each call so far [s].
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.seconds: list[float] = []

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        began = time.perf_counter()
        tau = self._controller.torque(t, q, v)
        self.seconds.append(time.perf_counter() - began)
        return tau
