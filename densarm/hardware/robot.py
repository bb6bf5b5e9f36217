"""Robot: three methods by which a loop drives a real arm."""

from importlib import import_module
from typing import Any, NamedTuple, Protocol

from densarm.certificates.task import Input
from densarm.errors import DensarmError, RobotError
from densarm.values.arrays import Array


class Reading(NamedTuple):
    """A state of the robot, as it measured it."""

    time: float
    """The robot's own clock [s], from any origin."""
    position: Array
    """Joint positions (nv,) [rad or m], in the order of the arm's joints."""
    velocity: Array
    """Joint velocities (nv,) [rad/s or m/s]."""


class Robot(Protocol):
    """A robot that is driven in its own time: `read` waits, so that the loop needs no clock.

    A driver of one's own has these three methods, as `examples/own_robot.py`. They raise
    `RobotError` once the robot has stopped by itself, or does not answer, in its words.
    """

    @property
    def input(self) -> Input:
        """What `command` takes."""
        ...

    @property
    def period(self) -> float:
        """Time between two states [s]."""
        ...

    def read(self) -> Reading:
        """Wait for the next state and return it; before the first command, the one now."""
        ...

    def command(self, u: Array) -> None:
        """Send what acts from now on; the first one takes control of the robot.

        Args:
            u: joint torques with gravity's (nv,) [N·m or N], or positions [rad or m], or velocities
                [rad/s or m/s], as `input` says. A robot that adds gravity's torque itself takes it
                off here.
        """
        ...

    def stop(self) -> None:
        """Bring the robot to rest by its own means and give control back; never raises."""
        ...


def driver(module: str, extra: str) -> Any:
    """Import the package of a robot's makers.

    Raises:
        DensarmError: it is not installed; the message has the extra that brings it.
    """
    try:
        return import_module(module)
    except ImportError as error:
        message = f"{module} cannot be imported ({error}): pip install 'densarm[{extra}]'"
        raise DensarmError(" ".join(message.split())) from None


def in_its_words(address: str, what: str, error: Exception) -> RobotError:
    """Return what a robot's package says of the robot at an address, as an error of one line."""
    return RobotError(f"the robot at {address} {what}: {' '.join(str(error).split())}")
