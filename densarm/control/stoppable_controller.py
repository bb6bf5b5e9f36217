"""StoppableController: a controller that stops when it is told to."""

from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.control.brake_and_hold import BrakeAndHold
from densarm.control.controller import Controller, checked_state, tracking_error
from densarm.control.gains import Gains


class StoppableController:
    """Hands on another controller's torque until it is stopped; then as `BrakeAndHold`.

    `GuardedController` does so where something is wrong, too.

    Args:
        arm: the arm.
        controller: acts until `stop` is called.
        gains: hold the arm at rest.
        period: time between two calls [s].
    """

    def __init__(self, arm: Arm, controller: Controller, gains: Gains, period: float) -> None:
        self._arm = arm
        self._controller = controller
        self._brake = BrakeAndHold(arm, gains, period)
        self._stopping = False
        self._last_time: float | None = None

    @property
    def is_stopping(self) -> bool:
        """Whether `stop` was called."""
        return self._stopping

    @property
    def tracking_error(self) -> float:
        """That of the other controller, if it tracks [rad or m]; zero once stopped."""
        return 0.0 if self._stopping else tracking_error(self._controller)

    def stop(self) -> None:
        """Brake from the next call of `torque` on, and then hold still."""
        self._stopping = True

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        if not self._stopping:
            return self._controller.torque(t, q, v)
        q, v = checked_state(self._arm, q, v)
        if self._last_time is None:
            self._brake.begin(q, v)
            self._last_time = t
        elapsed, self._last_time = t - self._last_time, t
        return self._brake.torque(q, v, elapsed)
