"""Planning beside a loop: the motion comes, is followed without a jerk, and nothing else breaks."""

import pickle
import time
from collections.abc import Iterator
from multiprocessing import active_children

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.control.planning_process import PlanningProcess
from densarm.control.tracking import DensityTracking
from densarm.planning.motion import PlanningError
from densarm.planning.plan import plan_motion
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World

PERIOD = 0.001
BALL = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, -1.2))

pytestmark = pytest.mark.slow


class Loop:
    """An arm with a rate limit of its torques, that tracks a motion in simulated time."""

    def __init__(self) -> None:
        self.arm = load_arm("panda", shapes="capsule")
        self.world = World(self.arm, Scene([BALL]), spare=[Sphere(name="spare", radius=0.1)])
        ready, turn = self.arm.postures["ready"], np.array([1.2, 0.2, 0.0, 0.4, 0.0, 0.3, 0.0])
        self.ends = ready, self.arm.integrate(ready, turn)
        motion = plan_motion(self.world, *self.ends)
        self.tracking = DensityTracking(self.world, motion)
        self.plant = PinocchioPlant(self.arm, PERIOD)
        self.t, self.q, self.v, self.tau = 0.0, self.ends[0], np.zeros(self.arm.nv), list[Array]()

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD)):
            self.tau.append(self.tracking.torque(self.t, self.q, self.v))
            self.q, self.v = self.plant.step(self.q, self.v, self.tau[-1])
            self.t += PERIOD


def answered(planner: PlanningProcess, loop: Loop) -> None:
    planner.ask(loop.t, loop.q)
    before = time.monotonic()
    while planner.answer(loop.t, loop.q) is None:
        assert time.monotonic() - before < 60.0
        loop.run(0.01)


@pytest.fixture(scope="module")
def loop() -> Loop:
    return Loop()


@pytest.fixture(scope="module")
def planner(loop: Loop) -> Iterator[PlanningProcess]:
    with PlanningProcess(loop.world, loop.tracking, loop.ends[1]) as planner:
        yield planner


def test_a_plan_for_another_goal_is_joined_in_the_middle_of_a_motion(
    planner: PlanningProcess, loop: Loop
) -> None:
    loop.run(0.5)
    assert np.abs(loop.v).max() > 0.3
    planner.goal = loop.ends[0]
    answered(planner, loop)
    np.testing.assert_allclose(loop.tracking.goal, loop.ends[0])
    loop.run(loop.tracking.motion.duration + 1.5)
    np.testing.assert_allclose(loop.q, loop.ends[0], atol=1e-3)
    rate = np.abs(np.diff(loop.tau, axis=0)) / PERIOD
    assert (rate <= 1.02 * loop.arm.limits.torque_rate).all()


def test_what_came_since_is_sensed_and_where_there_is_no_way_it_says_so(
    planner: PlanningProcess, loop: Loop
) -> None:
    planner.goal = loop.ends[1]
    planner.ask(loop.t, loop.q)
    loop.world.add_obstacle(Sphere(name="guest", radius=0.1, position=(1.5, 0.0, 0.0)))
    while planner.answer(loop.t, loop.q) is None:
        loop.run(0.01)
    loop.run(0.2)
    tip = loop.arm.pose(loop.ends[1]).position
    loop.world.move_obstacle("ball", tip)
    planner.ask(loop.t, loop.q)
    with pytest.raises(PlanningError, match="ball"):
        answered(planner, loop)


def test_a_process_that_ends_is_told_as_a_plan_that_does_not_come(loop: Loop) -> None:
    before = set(active_children())
    with PlanningProcess(loop.world, loop.tracking, loop.ends[0]) as planner:
        for process in set(active_children()) - before:
            process.kill()
        for _ in range(2):
            with pytest.raises(PlanningError, match="process that plans has ended"):
                answered(planner, loop)


def test_errors_of_planning_can_be_sent() -> None:
    sent = pickle.loads(pickle.dumps(PlanningError(Outcome.NO_PATH, "a wall")))
    assert (sent.outcome, sent.detail, str(sent)) == (Outcome.NO_PATH, "a wall", "no_path: a wall")
