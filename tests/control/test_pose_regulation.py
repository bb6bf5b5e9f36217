"""Regulation to poses: reached, followed as they move, and never by touching anything."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm, load_arm
from densarm.arms.pose import Pose
from densarm.certificates.task import SimulationParameters
from densarm.control.regulation import DensityRegulation
from densarm.control.speed_law import SpeedParameters
from densarm.density.navigation_density import DensityParameters
from densarm.density.pose_distance import PoseDistance
from densarm.density.sub_goals import GuidePath
from densarm.errors import DensarmError, InvalidValueError
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World

GOAL, REST = (0.3, -0.2), np.zeros(2)
SHOULDER = [0.0, 0.0, 0.089]


def goes_to(controller: DensityRegulation, arm: Arm, q: Array) -> Array:
    """Return where the planning system leads (nq,)."""
    for k in range(700):
        q = arm.integrate(q, 0.01 * controller.velocity(0.01 * k, q, REST))
    return q


def to_configuration(scenario: Scenario) -> DensityRegulation:
    return DensityRegulation(scenario.world, scenario.arm.configuration(GOAL))


@pytest.fixture(scope="module")
def ur5() -> World:
    return World(load_arm("ur5", shapes="capsule"), Scene())


@pytest.mark.slow
@pytest.mark.parametrize("part", ["whole", "position", "free"])
def test_leads_to_a_pose_and_rests_there_proved_clear(ur5: World, part: str) -> None:
    arm, start = ur5.arm, ur5.arm.postures["ready"]
    pose = arm.pose(start).moved(np.array([0.1, 0.1, -0.1, 0.3, -0.5, 0.4]))
    if part != "whole":
        turned = (pose.orientation_xyzw, "z") if part == "free" else (None, None)
        pose = Pose(pose.frame, pose.position, *turned)
    controller = DensityRegulation(ur5, pose)
    assert controller.goal is pose
    run = simulate(ur5, controller, start, parameters=SimulationParameters(time_limit=5.0))
    assert run.outcome == Outcome.REACHED
    assert run.certified
    position, turn = PoseDistance(arm, pose).off(run.q[-1])
    assert position < 1e-3
    assert turn < 0.01


@pytest.mark.slow
def test_rests_as_near_as_it_can_to_a_pose_out_of_reach(ur5: World) -> None:
    arm, start = ur5.arm, ur5.arm.postures["ready"]
    here = np.array(arm.pose(start).position)
    away = Pose("tool0", here + 2.0 * here / np.linalg.norm(here))
    run = simulate(ur5, DensityRegulation(ur5, away), start)
    assert run.outcome == Outcome.STUCK
    assert run.task.goal is None
    stretched = np.linalg.norm(np.array(arm.pose(run.q[-1]).position) - [0.0, 0.0, 0.089])
    assert stretched > 0.9  # of 0.95 m


class Circling:
    """A regulation whose pose goes round a circle at 0.1 m/s, set a hundred times a second."""

    def __init__(self, world: World, start: Array, **changes: Any) -> None:
        self.first, self.next = world.arm.pose(start), 0.0
        self.out = np.subtract(self.first.position, SHOULDER)
        self.out /= np.linalg.norm(self.out)
        side = np.cross(self.out, [0.0, 0.0, 1.0])
        self.up = np.cross(side / np.linalg.norm(side), self.out)
        self.regulation = DensityRegulation(world, self.first, **changes)

    def at(self, t: float) -> tuple[Pose, Array]:
        c, s = np.cos(t), np.sin(t)  # of a radius of 0.1 m
        step = 0.1 * np.array([(c - 1.0) * self.out + s * self.up, c * self.up - s * self.out])
        shift, twist = np.pad(step, ((0, 0), (0, 3)))
        return self.first.moved(shift), twist

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        if t >= self.next - 1e-9:
            self.regulation.set_goal(*self.at(t))
            self.next += 0.01
        return self.regulation.torque(t, q, v)


@pytest.mark.slow
def test_servoes_through_a_nearly_singular_posture_among_obstacles() -> None:
    arm = load_arm("ur5", shapes="capsule")
    scene = [
        Sphere(name="ball", radius=0.03, position=[0.215, 0.355, 0.62]),
        Box(name="shelf", size=[0.6, 0.6, 0.04], position=[0.3, 0.3, 0.95]),
        Sphere(name="knob", radius=0.05, position=[0.209, -0.061, 0.585]),
    ]
    world, start = World(arm, Scene(scene)), np.array([0.5, -1.2, 0.2, -0.1, -1.2, 0.0])
    controller = Circling(world, start, speed=SpeedParameters(braking_share=0.8))
    parameters = SimulationParameters(time_limit=7.0)
    run = simulate(world, controller, start, parameters=parameters)
    assert run.outcome == Outcome.TIMED_OUT
    assert np.abs(run.q[:, 2]).min() < 0.2  # of the elbow: stretched at 0
    off = [
        PoseDistance(arm, controller.at(t)[0]).off(q)
        for t, q in zip(run.time[1000::20], run.q[1000::20], strict=True)
    ]
    assert np.array(off)[:, 0].max() < 1e-3
    assert np.array(off)[:, 1].max() < 1e-3
    assert 0.0 < run.clearance.min() < 0.02
    checks = {check.name: check.holds for check in run.certificate.checks}
    assert [name for name, holds in checks.items() if not holds] == ["goal"]


def test_goals_may_be_configurations_and_poses_by_turns(swing_up: Scenario) -> None:
    arm, controller = swing_up.arm, to_configuration(swing_up)
    q = arm.configuration([0.35, -0.1])
    expected = controller.velocity(0.0, q, REST)
    frame = str(arm.model.frames[-1].name)
    controller.set_goal(Pose(frame, arm.pose(arm.configuration([-0.4, 0.1]), frame).position))
    end = goes_to(controller, arm, q)
    assert PoseDistance(arm, controller.goal).off(end)[0] < 1e-3
    controller.set_goal(arm.configuration(GOAL))
    np.testing.assert_array_equal(controller.velocity(0.0, q, REST), expected)


def test_a_pose_that_is_not_set_again_comes_to_rest(swing_up: Scenario) -> None:
    arm = swing_up.arm
    frame = str(arm.model.frames[-1].name)
    pose = Pose(frame, arm.pose(arm.configuration([-0.4, 0.1]), frame).position)
    controller = DensityRegulation(swing_up.world, pose)
    controller.set_goal(pose, [0.02, 0.0, 0.01, 0.0, 0.0, 0.0])
    end = goes_to(controller, arm, arm.configuration([-0.3, 0.2]))
    rests = np.add(pose.position, [0.002, 0.0, 0.001])
    np.testing.assert_allclose(controller.goal.position, rests, atol=1e-12)
    np.testing.assert_allclose(arm.pose(end, frame).position[::2], rests[::2], atol=1e-3)


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"plain": True}, "^plain = True"),
        ({"density": DensityParameters(blend_radius=0.1)}, "^density.blend_radius = 0.1"),
        ({"path": GuidePath(np.zeros((2, 4)), is_clear=False)}, "^path = "),
    ],
)
def test_what_is_of_configurations_alone_is_refused_for_a_pose(
    swing_up: Scenario, changes: dict[str, Any], error: str
) -> None:
    pose = swing_up.arm.pose(swing_up.goal, str(swing_up.arm.model.frames[-1].name))
    with pytest.raises(InvalidValueError, match=error):
        DensityRegulation(swing_up.world, pose, **changes)


def test_a_pose_that_cannot_be_is_refused_and_the_old_goal_kept(swing_up: Scenario) -> None:
    controller = to_configuration(swing_up)
    frame = str(swing_up.arm.model.frames[-1].name)
    for pose, velocity in ((Pose("hand", [0, 0, 0]), None), (Pose(frame, [0, 0, 1]), [0.1, 0.0])):
        with pytest.raises(DensarmError):
            controller.set_goal(pose, velocity)
    np.testing.assert_array_equal(controller.goal, swing_up.arm.configuration(GOAL))
