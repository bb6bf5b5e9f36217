"""Goals of which any will do: the plan goes to the one of least cost that it finds a way to."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.arms.pose import Pose
from densarm.control.tracking import DensityTracking
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.planning.goals import goal_list, way_cost
from densarm.planning.guide import GuidePath, NoPath, PlanningParameters
from densarm.planning.motion import PlanningError
from densarm.planning.plan import plan_motion, plan_path
from densarm.scenarios.scenario import load_scenario
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

HAND, DOWN = "panda_hand_tcp", (1.0, 0.0, 0.0, 0.0)
TABLE = Box(name="table", size=[0.8, 1.4, 0.04], position=[0.6, 0.0, 0.1])


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_arm("panda"), Scene([TABLE]))


@pytest.fixture(scope="module")
def start(world: World) -> Array:
    return np.array(world.arm.postures["ready"])


def refused(world: World, start: Array, goal: Any, **options: Any) -> PlanningError:
    with pytest.raises(PlanningError) as caught:
        plan_motion(world, start, goal, **options)
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.slow
def test_a_pose_is_reached_by_a_certified_run(world: World, start: Array) -> None:
    pose = Pose(HAND, [0.5, -0.3, 0.3], DOWN, free="z")
    motion = plan_motion(world, start, pose)
    run = simulate(world, DensityTracking(world, motion), start)
    assert run.outcome == Outcome.REACHED
    assert run.certified
    at = world.arm.pose(run.q[-1]).placement
    assert np.linalg.norm(at.translation - pose.position) < 1e-3
    assert at.rotation[2, 2] < -1.0 + 1e-4
    assert motion.goal is not None
    assert run.task.goal is not None
    np.testing.assert_allclose(run.task.goal, motion.goal, atol=1e-12)


def test_the_same_goals_give_the_same_motion(world: World, start: Array) -> None:
    goals = [Pose(HAND, [0.5, 0.3, 0.4]), world.arm.configuration([1.0, 0.3, 0, -2, 0, 2.3, 0.8])]
    first, second = (plan_motion(world, start, goals) for _ in range(2))
    np.testing.assert_array_equal(first.position, second.position)


def test_of_several_the_nearest_is_reached(world: World, start: Array) -> None:
    near, far = (world.arm.integrate(start, np.eye(7)[0] * turn) for turn in (0.4, -1.5))
    for goals in ([far, near], np.stack([near, far]), (far, [*near])):
        np.testing.assert_array_equal(plan_motion(world, start, goals).goal, near)


def test_one_that_is_blocked_is_passed_over(world: World, start: Array) -> None:
    arm = world.arm
    under = arm.configuration([0.0, 1.2, 0.0, -1.0, 0.0, 1.5, 0.8])
    free = arm.configuration([0.9, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8])
    assert world.distances(under).min() < 0.0
    np.testing.assert_array_equal(plan_motion(world, start, [under, free]).goal, free)
    error = refused(world, start, [under, Pose(HAND, [2.0, 0.0, 0.4])])
    assert error.outcome == Outcome.INFEASIBLE
    assert "table overlap by" in error.detail
    assert "out of reach" in error.detail


@pytest.mark.parametrize("guide", ["density", "path", "direct"])
def test_every_guide_leads_to_poses(world: World, start: Array, guide: str) -> None:
    pose = Pose(HAND, [0.5, 0.2, 0.4])
    path = plan_path(world, start, pose, guide)
    np.testing.assert_allclose(world.arm.pose(path.goal).position, pose.position, atol=1e-6)
    np.testing.assert_allclose(path.path.waypoints[-1], path.goal, atol=0.003)


class Balks:
    """A guide that finds a way to its second goal only."""

    def __init__(self) -> None:
        self.asked: list[Array] = []

    def plan(self, start: Array, goal: Array, seed: int) -> GuidePath | NoPath:  # noqa: ARG002
        self.asked.append(goal)
        if len(self.asked) == 1:
            return NoPath("no wish to")
        return GuidePath(np.stack([start, goal]), is_clear=False)


def test_ones_own_guide_is_asked_goal_by_goal(world: World, start: Array) -> None:
    goals = [world.arm.integrate(start, np.eye(7)[0] * turn) for turn in (0.4, -0.5)]
    guide = Balks()
    np.testing.assert_array_equal(plan_path(world, start, goals, guide).goal, goals[1])
    assert len(guide.asked) == 2
    alone = refused(world, start, goals, guide=Balks(), search=PlanningParameters(goals=1))
    assert alone.outcome == Outcome.NO_PATH
    assert "no wish to" in alone.detail


def test_effort_makes_a_motion_quicker_and_the_same_each_time() -> None:
    scenario = load_scenario("panda_shelf")
    first, quick, again = (
        plan_motion(scenario.world, scenario.start, goal, search=PlanningParameters(effort=effort))
        for goal, effort in [(scenario.goal, 1), (scenario.goal, 4), (scenario.goal, 4)]
    )
    assert quick.duration < first.duration
    np.testing.assert_array_equal(quick.position, again.position)
    check = SweptCheck(scenario.world)
    assert check.check(scenario.arm.configurations(quick.position)).verdict == SweptVerdict.CLEAR
    with pytest.raises(InvalidValueError, match="effort"):
        PlanningParameters(effort=0)


def test_more_tries_never_cost_more() -> None:
    scenario = load_scenario("panda_shelf")
    pose, costs = scenario.arm.pose(scenario.goal), []
    for goals in (1, 4):
        search = replace(scenario.planning, goals=goals)
        path = plan_path(scenario.world, scenario.start, pose, "density", search=search)
        costs.append(path.cost)
    assert costs[1] <= costs[0]


def test_a_way_costs_what_its_slowest_joint_takes() -> None:
    arm = load_arm("panda")
    start = np.array(arm.postures["ready"])
    turn = arm.integrate(start, np.eye(7)[0] * 0.2)
    limit = arm.limits.acceleration[0]
    expected = 2.0 * np.sqrt(0.2 / limit) + 0.2 * 0.2
    assert way_cost(arm, np.stack([start, turn])) == pytest.approx(expected)
    assert way_cost(arm, np.stack([start, turn, start])) > way_cost(arm, np.stack([start, turn]))
    assert way_cost(arm, np.stack([start, start])) == 0.0


def test_goals_are_read_as_they_are_meant() -> None:
    arm, pose, q = load_arm("panda"), Pose(HAND, [0.5, 0.0, 0.5]), [0.1] * 7
    assert len(goal_list(arm, q)) == len(goal_list(arm, pose)) == 1
    assert len(goal_list(arm, [q, q])) == len(goal_list(arm, np.array([q, q]))) == 2
    assert goal_list(arm, [pose, q])[0] == pose
    refusals: list[tuple[Any, str]] = [
        ([], "goal"),
        ([pose, [0.1]], "goal 2"),
        ([0.1], "of shape"),
        ("ready", "must be"),
    ]
    for wrong, expected in refusals:
        with pytest.raises(InvalidValueError, match=expected):
            goal_list(arm, wrong)


def test_bad_poses_are_told_of(world: World, start: Array) -> None:
    with pytest.raises(UnknownNameError, match="unknown frame 'hand'"):
        plan_motion(world, start, Pose("hand", [0.5, 0.0, 0.4]))
    assert "table overlap" in refused(world, start, Pose(HAND, [0.6, 0.0, 0.1], DOWN)).detail
    assert "nearest found is" in refused(world, start, Pose(HAND, [0.6, 1.0, 0.9])).detail
    blocked = World(world.arm, Scene([Sphere(name="ball", radius=0.2, position=[0.3, 0, 0.6])]))
    assert "start: " in refused(blocked, start, Pose(HAND, [0.4, 0.3, 0.4])).detail
