"""PathGuide: sub-goals along a collision-free path."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from densarm.arms.arm import Arm
from densarm.arms.joints import POSITION_TOLERANCE
from densarm.errors import InvalidValueError
from densarm.planning.guide import FreeSpace, GuidePath, NoPath
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive, positive_integer
from densarm.values.documented import documented

Bounds = tuple[Array, Array]
"""Lowest and highest position of each joint (nv,) [rad or m]."""

_POSITIONS = 4
"""Of each joint, whose combinations are as many samples as a search near both ends is worth."""

_LEAST_GAIN = 1e-3  # of a path's length; a shortcut that gains less is not worth a check


@documented
@dataclass(frozen=True)
class PathGuideParameters:
    """How long and how finely `PathGuide` searches; no clock decides anything."""

    iterations: int = 25_000
    """Samples that one search draws at most. To find the nearest state of a tree takes the longer
    the more it has: joint space is better searched again than for longer."""

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

    shortcuts: int = 100
    """Shortcuts tried on a path that was found."""

    limit_margin: float = 0.02
    """Distance that paths keep from position limits, or half of what start and goal keep where
    that is less [rad or m]."""

    def __post_init__(self) -> None:
        positive_integer("iterations", self.iterations)
        if not 0.0 <= self.near_share <= 1.0:
            raise InvalidValueError("near_share", self.near_share, "in [0, 1]")
        positive("near_distance", self.near_distance)
        positive_integer("searches", self.searches)
        positive("extension", self.extension)
        positive_integer("shortcuts", self.shortcuts)
        non_negative("limit_margin", self.limit_margin)


class PathGuide:
    """Search a path whose every segment is proved clear, and shorten it.

    The straight segment comes first, being the shortest path; then RRT-Connect (Kuffner and
    LaValle, ICRA 2000; by OMPL), near both ends and then everywhere, then shortcuts between random
    points of the path found.

    Args:
        arm: the arm; every joint that is not continuous needs position limits.
        freedom: the free space, which proves every edge.
        parameters: see `PathGuideParameters`.

    Raises:
        InvalidValueError: a joint whose position limits leave no interval to search in.
    """

    def __init__(
        self, arm: Arm, freedom: FreeSpace, parameters: PathGuideParameters | None = None
    ) -> None:
        self._arm = arm
        self._freedom = freedom
        self._parameters = parameters or PathGuideParameters()
        lower, upper = arm.limits.lower, arm.limits.upper
        width = upper - lower
        for joint in np.flatnonzero(~arm.continuous & ~((width > 0.0) & np.isfinite(width))):
            raise InvalidValueError(
                f"position limits of joint {arm.joint_names[joint]!r}",
                (float(lower[joint]), float(upper[joint])),
                "finite, lower < upper, for a path search (or lock the joint)",
            )

    def plan(self, start: Array, goal: Array, seed: int) -> GuidePath | NoPath:
        """Act as `Guide.plan`: return a chain of clear segments, or why there is none."""
        for name, q in (("start", start), ("goal", goal)):
            if fault := self._fault(q):
                return NoPath(f"the {name} {fault}")
        if self._freedom.segment_is_clear(start, goal):
            return GuidePath(np.stack([start, goal]), is_clear=True)
        return self._search(start, goal, np.random.default_rng(seed))

    def _search(self, start: Array, goal: Array, rng: np.random.Generator) -> GuidePath | NoPath:
        from densarm.planning.rrt_connect import rrt_connect

        for iterations, bounds, extension in self._searches(start, goal):
            path = rrt_connect(
                self._arm,
                self._freedom,
                start,
                goal,
                bounds=bounds,
                iterations=iterations,
                extension=extension,
                seed=int(rng.integers(1, 2**31)),
            )
            if path is not None:
                tries = self._parameters.shortcuts
                path = shortcut(self._arm, self._freedom, path, tries, rng)
                return GuidePath(path, is_clear=True)
        p = self._parameters
        return NoPath(
            f"the straight segment is not clear, and {p.searches} searches by RRT-Connect of "
            f"{p.iterations} iterations each found no path"
        )

    def _searches(self, start: Array, goal: Array) -> Iterator[tuple[int, Bounds, float]]:
        """Yield the iterations of each search, where it draws samples, and its longest edge."""
        p = self._parameters
        first = self._arm.angles(start)
        ends = np.stack([first, first + self._arm.difference(start, goal)])
        everywhere = self._bounds(ends)
        alone = min(math.ceil(p.near_share * p.iterations), _POSITIONS**self._arm.nv)
        if alone > 0:
            yield alone, self._near(ends, everywhere), p.extension
        if alone < p.iterations:
            yield p.iterations - alone, everywhere, p.extension
        for search in range(2, p.searches + 1):
            yield p.iterations, everywhere, search * p.extension

    def _near(self, ends: Array, everywhere: Bounds) -> Bounds:
        """Return where joints are near both ends; a continuous one anywhere if that is a turn."""
        away = self._parameters.near_distance
        lower = np.maximum(everywhere[0], ends.min(axis=0) - away)
        upper = np.minimum(everywhere[1], ends.max(axis=0) + away)
        is_anywhere = self._arm.continuous & (upper - lower >= 2.0 * np.pi)
        return np.where(is_anywhere, -np.inf, lower), np.where(is_anywhere, np.inf, upper)

    def _bounds(self, ends: Array) -> Bounds:
        """Return position limits (nv,) moved inwards by the limit margin; continuous: infinite."""
        limits = self._arm.limits
        below, above = (ends - limits.lower).min(axis=0), (limits.upper - ends).min(axis=0)
        margin = self._parameters.limit_margin
        # An end may exceed a limit by the tolerance, and is in the bounds all the same.
        within = [np.minimum(margin, np.minimum(room, 0.5 * room)) for room in (below, above)]
        return limits.lower + within[0], limits.upper - within[1]

    def _fault(self, q: Array) -> str | None:
        excess = self._arm.limits.excess(self._arm.angles(q))
        outside = np.flatnonzero(excess > POSITION_TOLERANCE)
        if outside.size:
            names = ", ".join(self._arm.joint_names[joint] for joint in outside)
            return f"is outside the position limits of {names}"
        return None if self._freedom.configuration_is_clear(q) else "is not clear of contact"


def shortcut(
    arm: Arm, freedom: FreeSpace, path: Array, steps: int, rng: np.random.Generator
) -> Array:
    """Shorten a path (W, nq) by clear segments between so many pairs of random points of it."""
    step, length, arc = _arc_length(arm, path)
    for share in np.sort(rng.uniform(size=(steps, 2))):
        s = share * arc[-1]
        segment = np.searchsorted(arc[1:-1], s, side="right")
        fraction = (s - arc[segment]) / length[segment]
        a, b = arm.integrate(path[segment], fraction[:, None] * step[segment])
        gain = (s[1] - s[0]) - np.linalg.norm(arm.difference(a, b))
        if gain > _LEAST_GAIN * arc[-1] and freedom.segment_is_clear(a, b):
            path = np.vstack([path[: segment[0] + 1], a, b, path[segment[1] + 1 :]])
            step, length, arc = _arc_length(arm, path)
    kept = [path[0]]
    for waypoint, after in pairwise(path[1:]):
        if not freedom.segment_is_clear(kept[-1], after):
            kept.append(waypoint)
    return np.stack([*kept, path[-1]])


def _arc_length(arm: Arm, path: Array) -> tuple[Array, Array, Array]:
    """Return the steps of a path, their lengths, and the length up to each waypoint."""
    step = arm.difference(path[:-1], path[1:])
    length = np.linalg.norm(step, axis=1)
    return step, length, np.concatenate([[0.0], np.cumsum(length)])
