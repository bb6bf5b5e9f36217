"""RRT-Connect on the joint space of an arm, by OMPL."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.guides.guide import FreeSpace


def rrt_connect(
    arm: Arm,
    freedom: FreeSpace,
    start: Array,
    goal: Array,
    *,
    bounds: tuple[Array, Array],
    iterations: int,
    extension: float,
    seed: int,
) -> Array | None:
    """Search a path of clear segments between two clear configurations.

    Args:
        arm: the arm.
        freedom: proves configurations and segments.
        start: (nq,) configuration within the bounds.
        goal: (nq,) configuration within the bounds.
        bounds: lowest and highest position of each joint (nv,) [rad or m]; infinite for a
            continuous joint that may be anywhere. Where they are finite, start and goal are less
            than a turn above the lowest.
        iterations: samples to draw at most.
        extension: longest edge of the trees [rad or m].
        seed: whole number >= 1; reseeds OMPL's generator, which is one for the process.

    Returns:
        (W, nq) waypoints from start to goal, or None when the iterations are spent.
    """
    with _quiet_ompl():
        # OMPL calls a second seed non-deterministic, because generators already made keep
        # theirs; everything that draws here is made below, from this seed.
        ou.RNG.setSeed(seed)
        space = _JointSpace(arm, *bounds)
        information = space.information(freedom)
        problem = ob.ProblemDefinition(information)
        problem.setStartAndGoalStates(space.state(start), space.state(goal))
        planner = og.RRTConnect(information)
        planner.setRange(extension)
        planner.setProblemDefinition(problem)
        planner.setup()
        planner.solve(ob.PlannerTerminationCondition(_Countdown(iterations)))
        if not problem.hasExactSolution():
            return None
        states = problem.getSolutionPath().getStates()
    # The ends as given: an angle of OMPL's may differ from them by a rounding, far below the
    # tolerance of a proof.
    inner = [space.configuration(state) for state in states[1:-1]]
    return np.stack([start, *inner, goal])


class _JointSpace:
    """OMPL's space of the joints: the bounded ones in one box, then a circle for each other.

    A continuous joint that is bounded is in the box, unrolled. A box alone is not compounded, for
    OMPL compares states of a compound space more slowly.
    """

    def __init__(self, arm: Arm, lower: Array, upper: Array) -> None:
        self._arm = arm
        self._lower = lower
        is_bounded = np.isfinite(lower)
        self._unrolled = np.flatnonzero(is_bounded & arm.is_circle)
        bounded, circles = np.flatnonzero(is_bounded), np.flatnonzero(~is_bounded)
        self._order = np.concatenate([bounded, circles])
        self._position = np.argsort(self._order)
        self._box = slice(0, len(bounded))
        parts = [_box(lower[bounded], upper[bounded])] if bounded.size else []
        self._circles = range(len(parts), len(parts) + len(circles))
        parts += [ob.SO2StateSpace() for _ in circles]
        self._space = _compound(parts) if len(circles) else parts[0]

    def information(self, freedom: FreeSpace) -> ob.SpaceInformation:
        """Return OMPL's space information, whose checks ask `freedom`."""
        information = ob.SpaceInformation(self._space)
        # The proof of a segment covers its ends.
        information.setStateValidityChecker(ob.AllValidStateValidityChecker(information))
        information.setMotionValidator(_ProvedSegments(information, self, freedom))
        information.setup()
        return information

    def state(self, q: Array) -> ob.State:
        """Return the state of a configuration (nq,)."""
        # Never freed: nanobind ends the process with a segmentation fault after freeState.
        state = self._space.allocState()
        angles, unrolled = self._arm.angles(q), self._unrolled
        lowest = self._lower[unrolled]
        angles[unrolled] = lowest + np.mod(angles[unrolled] - lowest, 2.0 * np.pi)
        self._space.copyFromReals(state, angles[self._order].tolist())
        self._space.enforceBounds(state)  # OMPL's circle is [-pi, pi), without its upper end
        return state

    def configuration(self, state: ob.State) -> Array:
        """Return the configuration (nq,) of a state."""
        if not self._circles:
            return self._arm.configurations(np.array(state[self._box]))
        values = state[0][self._box] if self._box.stop else []
        values += [state[index].value for index in self._circles]
        return self._arm.configurations(np.array(values).take(self._position))


def _compound(parts: list[ob.StateSpace]) -> ob.CompoundStateSpace:
    space = ob.CompoundStateSpace()
    for part in parts:
        space.addSubspace(part, 1.0)
    return space


def _box(lower: Array, upper: Array) -> ob.RealVectorStateSpace:
    box = ob.RealVectorStateSpace(0)
    for side in zip(lower.tolist(), upper.tolist(), strict=True):
        box.addDimension(*side)
    return box


class _ProvedSegments(ob.MotionValidator):
    """Motions that the free space proves, in place of OMPL's samples along them."""

    # Nothing here may hold the space information: it holds this object, and nanobind reports
    # such a cycle as a leak on stderr when the process ends.
    def __init__(
        self, information: ob.SpaceInformation, space: _JointSpace, freedom: FreeSpace
    ) -> None:
        super().__init__(information)
        self._space, self._freedom = space, freedom

    def checkMotion(self, state_a: ob.State, state_b: ob.State) -> bool:  # noqa: N802
        """Return whether the segment between two states is proved clear."""
        return self._freedom.segment_is_clear(
            self._space.configuration(state_a), self._space.configuration(state_b)
        )


class _Countdown:
    """True from the call after the given number of calls on."""

    def __init__(self, calls: int) -> None:
        self._left = calls

    def __call__(self) -> bool:
        self._left -= 1
        return self._left < 0


@contextmanager
def _quiet_ompl() -> Iterator[None]:
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    try:
        yield
    finally:
        ou.setLogLevel(level)
