"""Outcome: how a run ended."""

from enum import StrEnum


class Outcome(StrEnum):
    """How a run ended; equal to the word that JSON uses, with a sentence in `description`."""

    REACHED = "reached"
    STUCK = "stuck"
    COLLIDED = "collided"
    TIMED_OUT = "timed_out"
    INFEASIBLE = "infeasible"
    NO_PATH = "no_path"

    @property
    def description(self) -> str:
        """One sentence on what the outcome means."""
        return _DESCRIPTIONS[self]


FAILED = "failed"
"""In place of an outcome: the run raised an error."""

RUN_ENDS = (*map(str, Outcome), FAILED)
"""How a run of many can end."""

_DESCRIPTIONS = {
    Outcome.REACHED: "The arm reached the goal, held it and touched nothing.",
    Outcome.STUCK: "The arm came to rest away from the goal, where what drives it leads nowhere.",
    Outcome.COLLIDED: "The arm touched an obstacle or itself.",
    Outcome.TIMED_OUT: "The time limit ended the run before the goal was reached and held.",
    Outcome.INFEASIBLE: "Start or goal is in contact or outside limits, or torque is too weak.",
    Outcome.NO_PATH: "The guide found no collision-free path to the goal.",
}
