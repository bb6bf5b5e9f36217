"""A path by RRT-Connect, its motions checked at samples, as OMPL does by default."""

import numpy as np
import pinocchio as pin
from ompl import base as ob
from ompl import geometric as og
from ompl import util as ou

from densarm.scenarios.scenario import Scenario
from densarm.values.arrays import Array
from densarm.world.world import World

RESOLUTION = 0.01  # OMPL's default: of the extent of the joint space, between checked states
_TIME = 30.0  # for the search [s]
_STEP = 0.1  # between waypoints at most [rad]


def search(scenario: Scenario) -> Array | None:
    """Return waypoints (W, nq), simplified and then made dense, or None if none were found.

    What touches is asked of coal's collision tests alone.

    Args:
        scenario: of an arm without continuous joints.
    """
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    space = ob.RealVectorStateSpace(0)
    limits = scenario.arm.limits
    for side in zip(limits.lower.tolist(), limits.upper.tolist(), strict=True):
        space.addDimension(*side)
    space.setup()  # without which copying into a state ends the process
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(_Free(scenario.world))
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(RESOLUTION)
    setup.setStartAndGoalStates(_state(space, scenario.start), _state(space, scenario.goal))
    setup.setPlanner(og.RRTConnect(information))
    if not setup.solve(_TIME) or not setup.haveExactSolutionPath():
        return None
    setup.simplifySolution()
    return _dense(np.array([state[0:7] for state in setup.getSolutionPath().getStates()]))


class _Free:
    """Whether no pair touches, by the first one found that does."""

    def __init__(self, world: World) -> None:
        self._model, self._geometry = world.arm.model, world.geometry_model
        self._data, self._results = self._model.createData(), self._geometry.createData()

    def __call__(self, state: ob.State) -> bool:
        q = np.array(state[0:7])
        return not pin.computeCollisions(
            self._model, self._data, self._geometry, self._results, q, True
        )


def _state(space: ob.RealVectorStateSpace, q: Array) -> ob.State:
    state = space.allocState()
    space.copyFromReals(state, q.tolist())
    return state


def _dense(corners: Array) -> Array:
    """Return waypoints of the same polyline, so close that a spline through them stays near it."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    parts = np.ceil(np.diff(length) / _STEP).astype(int)
    at = np.concatenate(
        [
            np.linspace(a, b, n, endpoint=False)
            for a, b, n in zip(length[:-1], length[1:], parts, strict=True)
        ]
    )
    at = np.append(at, length[-1])
    return np.column_stack([np.interp(at, length, column) for column in corners.T])
