"""Guide: what supplies the sub-goals between a start and a goal, and what it answers."""

from dataclasses import dataclass
from typing import Protocol

from densarm.density.sub_goals import GuidePath
from densarm.values.arrays import Array
from densarm.values.documented import documented

__all__ = ["FreeSpace", "Guide", "GuidePath", "NoPath"]


@documented
@dataclass(frozen=True)
class NoPath:
    """A guide's answer when it has no chain to offer."""

    reason: str
    """What was tried and what stood in the way, as a phrase."""


class Guide(Protocol):
    """A source of sub-goals.

    The density leads from one sub-goal to the next, the last one being the goal: the adapted
    goal distance of [ZNV, Remark 1].
    """

    def plan(self, start: Array, goal: Array, seed: int) -> GuidePath | NoPath:
        """Return sub-goals from a start to a goal; the same arguments give the same bits.

        Args:
            start: (nq,) configuration.
            goal: (nq,) configuration.
            seed: whole number >= 0 that every random choice derives from.
        """
        ...


class FreeSpace(Protocol):
    """The part of joint space without contact, as questions with proved answers.

    A "no" may be false, where a proof is out of reach; a "yes" may not.
    """

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether a configuration (nq,) is proved free of contact."""
        ...

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether all of a straight segment, ends (nq,), is proved free of contact."""
        ...
