"""UniversalRobot: joint positions to an arm of Universal Robots, by RTDE's `servoJ`."""

import contextlib
import time

import numpy as np

from densarm.certificates.task import Input
from densarm.errors import RobotError
from densarm.hardware.robot import Reading, driver, in_its_words
from densarm.values.arrays import Array
from densarm.values.checks import positive

_SILENCE = 0.1  # [s] without a state, after which the robot counts as lost


class UniversalRobot:
    """An arm of Universal Robots, whose controller follows the positions of `servoJ`.

    Its script is uploaded when the object is made, for which the robot must be in remote control.
    It has been run against a stand-in of the interface alone: no simulator could be had.

    Args:
        address: the robot's.
        frequency: states a second: 500 of an e-Series, 125 of a CB3 [Hz].
        lookahead: over which `servoJ` smooths, 0.03 to 0.2 [s].
        gain: of `servoJ`, 100 to 2000.

    Raises:
        DensarmError: ur-rtde is not installed.
        RobotError: nothing answers there, or the robot cannot be driven now.
        InvalidValueError: a number that is not positive.

    Source: ur_rtde 1.6; Universal Robots' script manual, `servoj`.
    """

    input = Input.POSITION

    def __init__(
        self,
        address: str,
        *,
        frequency: float = 500.0,
        lookahead: float = 0.05,
        gain: float = 500.0,
    ) -> None:
        self._address, self.period = address, 1.0 / positive("frequency", frequency)
        self._lookahead, self._gain = positive("lookahead", lookahead), positive("gain", gain)
        receive, control = driver("rtde_receive", "ur"), driver("rtde_control", "ur")
        self._time, self._is_driven = -1.0, False
        try:
            self._receive = receive.RTDEReceiveInterface(address, frequency)
            self._require_ready()
            self._control = control.RTDEControlInterface(address, frequency)
        except RuntimeError as error:
            raise in_its_words(self._address, "cannot be reached", error) from None

    def _require_ready(self) -> None:
        receive = self._receive
        for stopped, what in (
            (receive.isEmergencyStopped, "in an emergency stop: release it"),
            (receive.isProtectiveStopped, "in a protective stop: clear its way and unlock it"),
        ):
            if stopped():
                raise RobotError(f"the robot at {self._address} is {what}")

    def read(self) -> Reading:
        """Act as `Robot.read`."""
        receive, began = self._receive, time.monotonic()
        while (now := float(receive.getTimestamp())) == self._time:
            if time.monotonic() - began > _SILENCE or not receive.isConnected():
                raise RobotError(f"the robot at {self._address} sends no states any more")
            time.sleep(0.05 * self.period)
        self._time = now
        self._require_ready()
        return Reading(now, np.array(receive.getActualQ()), np.array(receive.getActualQd()))

    def command(self, u: Array) -> None:
        """Act as `Robot.command`, u the joint positions [rad]."""
        self._is_driven, wanted = True, u.tolist()
        try:
            taken = self._control.servoJ(wanted, 0.0, 0.0, self.period, self._lookahead, self._gain)
        except RuntimeError as error:
            raise in_its_words(self._address, "stopped", error) from None
        if not taken:
            raise RobotError(f"the robot at {self._address} took no position: its script stopped")

    def stop(self) -> None:
        """Act as `Robot.stop`."""
        if self._is_driven:
            with contextlib.suppress(RuntimeError):
                self._control.servoStop()
        self._is_driven = False
