"""Status: what a supervisor found wrong."""

from dataclasses import dataclass
from enum import StrEnum

from densarm.values.documented import documented


class Fault(StrEnum):
    """What a supervisor found, or was told."""

    NONE = "none"
    """Nothing is wrong; the controller acts."""
    NOT_A_STATE = "not_a_state"
    """The state had a wrong shape, was not finite, not on the unit circle or beyond reason."""
    JUMPED = "jumped"
    """The state is not where the dynamics could have brought it."""
    FROZEN = "frozen"
    """The configuration stayed the same while the arm must have moved."""
    LATE = "late"
    """Too much time passed between two calls."""
    CLOCK = "clock"
    """The time was not a finite number, or ran backwards."""
    OFF_COURSE = "off_course"
    """The arm is too far from where the controller wants it to be."""
    NO_TORQUE = "no_torque"
    """The controller failed, or gave a torque that is not finite or beyond the limits."""
    SCENE_CHANGED = "scene_changed"
    """The caller told that the scene is not that of the plan."""
    ROBOT = "robot"
    """The robot stopped by itself, or does not answer any more."""
    STOPPED = "stopped"
    """The caller asked for it."""


TOLD = frozenset({Fault.NONE, Fault.ROBOT, Fault.SCENE_CHANGED, Fault.STOPPED})
"""Those that do not pass by themselves."""


@documented
@dataclass(frozen=True)
class Status:
    """The first thing that went wrong since the controller last acted."""

    fault: Fault = Fault.NONE
    """What it was."""
    sentence: str = "The controller acts."
    """The same in words, with the time and the values."""


def one_line(text: object) -> str:
    """Return what a caller or controller gave, as it fits into a sentence."""
    return " ".join(str(text).split())[:300]
