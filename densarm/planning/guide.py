"""Guide: what supplies the sub-goals between a start and a goal, and what it answers."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.upright import Upright
from densarm.density.sub_goals import GuidePath
from densarm.errors import InvalidValueError
from densarm.planning.path_margins import LIMIT_INSET
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, non_negative_integer, positive, positive_integer
from densarm.values.documented import documented

__all__ = ["FreeSpace", "Guide", "GuidePath", "NoPath", "PlanningParameters"]

_PATH_SHARE = 0.8  # of the blend at way points


@documented
@dataclass(frozen=True)
class PlanningParameters:
    """How long and how finely ways are searched; no clock decides anything.

    Raises:
        InvalidValueError: a value out of its range.
    """

    iterations: int = 25_000
    """Samples that one search of the planner draws at most. To find the nearest state of a tree
    takes the longer the more it has: joint space is better searched again than for longer."""

    near_share: float = 0.16
    """Share of the first search's samples that are drawn near start and goal, and tried alone
    before the others: most paths need no more of the space, and are found sooner there, and
    shorter; 0 to 1. No more than 4^nv are, for what arms of few joints do not find soon is not
    there."""

    near_distance: float = 1.0
    """How far beyond its positions at start and goal, and those between, a joint is near [rad or
    m]."""

    searches: int = 3
    """Searches from scratch, each with its own seed, before giving up."""

    extension: float = 1.0
    """Longest edge that the first search adds to its trees; the second adds edges up to twice as
    long, and so on, as neither suits all spaces [rad or m]."""

    shortcuts: int = 900
    """Shortcuts tried on a way that was found."""

    limit_margin: float = 0.02
    """Distance that paths keep from position limits, or half of what start and goal keep where
    that is less [rad or m]."""

    vias: int = 20
    """Via points at most, from which the density leads to start and goal where it does not lead
    from one to the other."""

    goals: int = 3
    """Configurations at most that a way is sought to, where any of several will do."""

    solutions: int = 8
    """Configurations at most, by inverse kinematics, that stand for a pose."""

    effort: int | None = None
    """Ways by the planner at most of which a motion takes the quickest, rounded where that makes it
    quicker; 1 for the guide's own way. None for 1 to a single configuration, and 6 where any of
    several will do, as for a pose. The guides "density" and "direct", and one's own, have one."""

    def __post_init__(self) -> None:
        non_negative_integer("vias", self.vias)
        positive_integer("goals", self.goals)
        positive_integer("solutions", self.solutions)
        positive_integer("iterations", self.iterations)
        if not 0.0 <= self.near_share <= 1.0:
            raise InvalidValueError("near_share", self.near_share, "in [0, 1]")
        positive("near_distance", self.near_distance)
        positive_integer("searches", self.searches)
        positive("extension", self.extension)
        positive_integer("shortcuts", self.shortcuts)
        if self.effort is not None:
            positive_integer("effort", self.effort)
        non_negative("limit_margin", self.limit_margin)


@documented
@dataclass(frozen=True)
class NoPath:
    """A guide's answer when it has no chain to offer."""

    reason: str
    """What was tried and what stood in the way, as a phrase."""
    remark: str = ""
    """As `GuidePath.remark`."""


class WayPoints(NamedTuple):
    """What a path passes on its way, one after another."""

    q: Array
    """Configurations (M, nq)."""
    blend: float
    """How far off each joint may be when it passes one, so that it need not stop [rad or m]."""
    rows: NDArray[np.int64]
    """Points of the path that pass them, counted from its end, hence negative (M,)."""

    @property
    def within(self) -> float:
        """How far off a path may be [rad or m]; the rest is for tracking errors."""
        return _PATH_SHARE * self.blend


@documented
@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A guide's answer, and what was kept from obstacles on the way."""

    path: GuidePath
    """The sub-goals."""
    kept: Array
    """Distance of each pair that the path keeps beyond the safety margin (K,) [m]; of sub-goals
    that are not proved clear, what it shall keep."""
    plan_time: float
    """Wall-clock time that the guide took, and the choice of a goal [s]; zero for the direct
    guide to a configuration."""
    goal: Array
    """The goal that it leads to (nq,)."""
    cost: float
    """What the way costs, as `way_cost` has it [s]."""
    is_rounded: bool = False
    """Whether it is of points close to each other, bent evenly where that makes it quicker."""
    way_points: WayPoints | None = None
    """What it passes; None for nothing but its ends."""
    upright: Upright | None = None
    """What it keeps upright; None for nothing."""


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

    def polyline_is_clear(self, angles: Array) -> bool:
        """Return whether all straight segments from one to the next are proved free of contact.

        Joint positions (N, nv) [rad or m], N >= 2; continuous joints count their turns.
        """
        ...


def checked_path(arm: Arm, answer: object, start: Array, goal: Array) -> GuidePath:
    """Return the path that somebody's own guide found, once it is known to be one.

    Raises:
        InvalidValueError: it is none, or does not lead from start to goal (nq,).
    """
    if not isinstance(answer, GuidePath):
        raise InvalidValueError("answer of the guide", answer, "a GuidePath or a NoPath")
    what, allowed = "waypoints of the guide", f"of shape (W, {arm.nq}), W >= 2"
    try:
        points = np.asarray(answer.waypoints, dtype=np.float64)
    except (TypeError, ValueError):  # no numbers, or rows of different lengths
        raise InvalidValueError(what, answer.waypoints, allowed) from None
    if points.ndim != 2 or len(points) < 2 or points.shape[1] != arm.nq:
        raise InvalidValueError(what, answer.waypoints, f"{allowed}, got {points.shape}")
    checked = [arm.check_configuration("waypoint of the guide", point) for point in points]
    for name, at, q in (("first", 0, start), ("last", -1, goal)):
        if np.abs(arm.difference(q, checked[at])).max() > LIMIT_INSET:
            allowed = f"the {'start' if at == 0 else 'goal'} {q.tolist()}"
            raise InvalidValueError(f"{name} waypoint of the guide", checked[at], allowed)
    return GuidePath(np.array(checked), bool(answer.is_clear))
