"""RRT-Connect on the joint space of an arm, by OMPL."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

import numpy as np
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from densarm.arms.arm import Arm
from densarm.planning.guide import FreeSpace
from densarm.planning.sampling import Bounds
from densarm.values.arrays import Array


def rrt_connect(
    arm: Arm,
    freedom: FreeSpace,
    start: Array,
    goal: Array,
    *,
    bounds: Bounds,
    iterations: int,
    extension: float,
    seed: int,
) -> Array | None:
    """Return a path (W, nq) of clear segments between clear configurations (nq,), or None.

    Args:
        arm: the arm.
        freedom: proves segments.
        start: within the bounds.
        goal: within the bounds.
        bounds: lowest and highest position of each joint (nv,) [rad or m]; infinite for a
            continuous joint that may be anywhere. Where they are finite, start and goal are less
            than a turn above the lowest.
        iterations: samples to draw at most.
        extension: longest edge of the trees [rad or m].
        seed: whole number >= 1; reseeds OMPL's generator, which is one for the process.
    """
    with _quiet_ompl():
        # OMPL calls a second seed non-deterministic, because generators already made keep
        # theirs; everything that draws here is made below, from this seed.
        ou.RNG.setSeed(seed)
        space = _JointSpace(arm, *bounds)
        information = ob.SpaceInformation(space.space)
        # The proof of a segment covers its ends.
        information.setStateValidityChecker(ob.AllValidStateValidityChecker(information))
        information.setMotionValidator(_ProvedSegments(information, space, freedom))
        information.setup()
        problem = ob.ProblemDefinition(information)
        problem.setStartAndGoalStates(space.state(start), space.state(goal))
        planner = og.RRTConnect(information)
        planner.setRange(extension)
        planner.setProblemDefinition(problem)
        planner.setup()
        calls = count(1)
        planner.solve(ob.PlannerTerminationCondition(lambda: next(calls) > iterations))
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
        self._turns = bool(arm.continuous.any())
        self._unrolled = np.flatnonzero(is_bounded & arm.continuous)
        bounded, circles = np.flatnonzero(is_bounded), np.flatnonzero(~is_bounded)
        self._order = np.concatenate([bounded, circles])
        self._position = np.argsort(self._order)
        self._box = slice(0, len(bounded))
        box = ob.RealVectorStateSpace(0)
        for joint in bounded:
            box.addDimension(float(lower[joint]), float(upper[joint]))
        parts = [box] if bounded.size else []
        self._circles = range(len(parts), len(parts) + len(circles))
        parts += [ob.SO2StateSpace() for _ in circles]
        self.space = box
        if circles.size:
            self.space = ob.CompoundStateSpace(parts, [1.0] * len(parts))

    def state(self, q: Array) -> ob.State:
        """Return the state of a configuration (nq,)."""
        # Never freed: nanobind ends the process with a segmentation fault after freeState.
        state = self.space.allocState()
        angles, unrolled = self._arm.angles(q), self._unrolled
        lowest = self._lower[unrolled]
        angles[unrolled] = lowest + np.mod(angles[unrolled] - lowest, 2.0 * np.pi)
        self.space.copyFromReals(state, angles[self._order].tolist())
        self.space.enforceBounds(state)  # OMPL's circle is [-pi, pi), without its upper end
        return state

    def configuration(self, state: ob.State) -> Array:
        """Return the configuration (nq,) of a state."""
        if not self._circles:
            return self._arm.configurations(np.array(state[self._box]))
        values = state[0][self._box] if self._box.stop else []
        values += [state[index].value for index in self._circles]
        return self._arm.configurations(np.array(values).take(self._position))

    def segment(self, state_a: ob.State, state_b: ob.State) -> Array:
        """Return the joint positions at both ends (2, nv), the second the short way round."""
        if not self._turns:  # half of what is left to do beside the proof
            return np.array([state_a[self._box], state_b[self._box]])
        q_a, q_b = self.configuration(state_a), self.configuration(state_b)
        begin = self._arm.angles(q_a)
        return np.array([begin, begin + self._arm.difference(q_a, q_b)])


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
        return self._freedom.polyline_is_clear(self._space.segment(state_a, state_b))


@contextmanager
def _quiet_ompl() -> Iterator[None]:
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    try:
        yield
    finally:
        ou.setLogLevel(level)
