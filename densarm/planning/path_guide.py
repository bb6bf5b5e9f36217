"""PathGuide: sub-goals along a collision-free path."""

import math
from collections.abc import Iterator

import numpy as np

from densarm.arms.arm import Arm
from densarm.arms.joints import POSITION_TOLERANCE
from densarm.errors import InvalidValueError
from densarm.planning.guide import FreeSpace, GuidePath, NoPath, PlanningParameters
from densarm.planning.sampling import Bounds, SamplingBounds
from densarm.planning.shortening import shortened
from densarm.values.arrays import Array

_POSITIONS = 4
"""Of each joint, whose combinations are as many samples as a search near both ends is worth."""


class PathGuide:
    """Search a path whose every segment is proved clear, and shorten it.

    The straight segment comes first, being the shortest path; then RRT-Connect (Kuffner and
    LaValle, ICRA 2000; by OMPL), near both ends and then everywhere, then `shortened`.

    Args:
        arm: the arm; every joint that is not continuous needs position limits.
        freedom: the free space, which proves every edge.
        parameters: see `PlanningParameters`.

    Raises:
        InvalidValueError: a joint whose position limits leave no interval to search in.
    """

    def __init__(
        self, arm: Arm, freedom: FreeSpace, parameters: PlanningParameters | None = None
    ) -> None:
        self._arm = arm
        self._freedom = freedom
        self._parameters = parameters or PlanningParameters()
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
            return GuidePath(
                np.stack([start, goal]), is_clear=True, found_by="the straight segment"
            )
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
                path = shortened(self._arm, self._freedom, path, tries, rng)
                return GuidePath(path, is_clear=True, found_by="RRT-Connect")
        p = self._parameters
        return NoPath(
            f"the straight segment is not clear, and {p.searches} searches by RRT-Connect of "
            f"{p.iterations} iterations each found no path"
        )

    def _searches(self, start: Array, goal: Array) -> Iterator[tuple[int, Bounds, float]]:
        """Yield the iterations of each search, where it draws samples, and its longest edge."""
        p = self._parameters
        bounds = SamplingBounds(self._arm, p, start, goal)
        alone = min(math.ceil(p.near_share * p.iterations), _POSITIONS**self._arm.nv)
        if alone > 0:
            yield alone, bounds.near, p.extension
        if alone < p.iterations:
            yield p.iterations - alone, bounds.everywhere, p.extension
        for search in range(2, p.searches + 1):
            yield p.iterations, bounds.everywhere, search * p.extension

    def _fault(self, q: Array) -> str | None:
        excess = self._arm.limits.excess(self._arm.angles(q))
        outside = np.flatnonzero(excess > POSITION_TOLERANCE)
        if outside.size:
            names = ", ".join(self._arm.joint_names[joint] for joint in outside)
            return f"is outside the position limits of {names}"
        return None if self._freedom.configuration_is_clear(q) else "is not clear of contact"
