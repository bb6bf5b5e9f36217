"""Where searches draw the configurations that they try."""

from typing import NamedTuple

import numpy as np

from densarm.arms.arm import Arm
from densarm.planning.guide import PlanningParameters
from densarm.values.arrays import Array


class Bounds(NamedTuple):
    """A box of joint positions; infinite for a continuous joint that may be anywhere."""

    lower: Array
    """Lowest position of each joint (nv,) [rad or m]."""
    upper: Array
    """Highest position of each joint (nv,) [rad or m]."""

    def draw(self, rng: np.random.Generator) -> Array:
        """Return joint positions (nv,) from a uniform distribution; of what is infinite, a turn."""
        is_bounded = np.isfinite(self.lower)
        lower = np.where(is_bounded, self.lower, -np.pi)
        return rng.uniform(lower, np.where(is_bounded, self.upper, np.pi))


class SamplingBounds:
    """The boxes that a search from a start to a goal draws from.

    Args:
        arm: the arm, whose position limits bound them.
        parameters: how far from the limits, and how far from both ends is near.
        start: configuration (nq,).
        goal: configuration (nq,).
    """

    def __init__(self, arm: Arm, parameters: PlanningParameters, start: Array, goal: Array) -> None:
        limits, first = arm.limits, arm.angles(start)
        ends = np.stack([first, first + arm.difference(start, goal)])
        below, above = (ends - limits.lower).min(axis=0), (limits.upper - ends).min(axis=0)
        margin, away = parameters.limit_margin, parameters.near_distance
        # An end may exceed a limit by the tolerance, and is in the bounds all the same.
        within = [np.minimum(margin, np.minimum(room, 0.5 * room)) for room in (below, above)]
        self.everywhere = Bounds(limits.lower + within[0], limits.upper - within[1])
        """Position limits moved inwards by the limit margin; continuous joints: infinite."""
        lower = np.maximum(self.everywhere.lower, ends.min(axis=0) - away)
        upper = np.minimum(self.everywhere.upper, ends.max(axis=0) + away)
        is_anywhere = arm.continuous & (upper - lower >= 2.0 * np.pi)
        self.near = Bounds(
            np.where(is_anywhere, -np.inf, lower), np.where(is_anywhere, np.inf, upper)
        )
        """Where joints are near both ends; a continuous one anywhere if that is a turn."""
