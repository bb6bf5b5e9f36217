"""Ways to reach a pose in a world: clear, distinct, nearest first, or why there is none."""

from collections.abc import Callable

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.arms.pose import Pose
from densarm.errors import DensarmError, InvalidValueError, UnknownNameError
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Attachment, Scene
from densarm.world.configurations import infeasibility
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

DOWN = (1.0, 0.0, 0.0, 0.0)
POST = Box(name="post", size=[0.08, 0.08, 0.6], position=[0.35, 0.25, 0.3])
Named = Callable[[str], Arm]


def panda_among(arm_named: Named, *obstacles: Obstacle) -> World:
    return World(arm_named("panda"), Scene(obstacles))


def test_ways_are_clear_distinct_and_nearest_first(arm_named: Named) -> None:
    world = panda_among(arm_named, POST)
    arm, check = world.arm, SweptCheck(world, 0.01)
    near = arm.postures["ready"]
    pose = Pose(arm.end_effector, [0.45, 0.1, 0.4], DOWN, free="z")
    found = world.inverse_kinematics(pose, 12, 3, near=near, margin=0.01)
    assert found.shape == (12, arm.nq)
    for q in found:
        assert infeasibility(check, {"way": q}) == ""
        at = arm.pose(q).placement
        np.testing.assert_allclose(at.translation, pose.position, atol=1e-6)
        np.testing.assert_allclose(at.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-6)
    far = np.linalg.norm(arm.difference(near, found), axis=1)
    assert (np.diff(far) >= 0.0).all()
    apart = np.abs(arm.difference(found[:, np.newaxis], found)).max(axis=2) + np.eye(12)
    assert apart.min() > 0.1
    again = world.inverse_kinematics(pose, 12, 3, near=near, margin=0.01)
    np.testing.assert_array_equal(found, again)


def test_obstacles_count_where_they_are_now(arm_named: Named) -> None:
    ball = Sphere(name="ball", radius=0.06, position=[0.45, 0.1, 0.4])
    world = panda_among(arm_named, ball)
    pose = Pose(world.arm.end_effector, ball.position)
    with pytest.raises(DensarmError, match=r"is in collision in all .* ball overlap by .* mm"):
        world.inverse_kinematics(pose)
    world.move_obstacle("ball", [0.45, 0.1, 1.4])
    assert len(world.inverse_kinematics(pose)) == 8
    world.remove_obstacle("ball")
    assert len(world.inverse_kinematics(pose, 1)) == 1


def test_a_spare_obstacle_is_in_nobodys_way(arm_named: Named) -> None:
    arm = arm_named("panda")
    world = World(arm, Scene(), spare=[Sphere(name="ball", radius=0.5, position=[0.4, 0, 0.4])])
    assert len(world.inverse_kinematics(arm.pose(arm.postures["ready"]), 2)) == 2


def test_no_joint_is_turned_further_than_it_need_be(arm_named: Named) -> None:
    world = panda_among(arm_named)
    ready = world.arm.postures["ready"]
    found = world.inverse_kinematics(world.arm.pose(ready), 4, near=ready)
    np.testing.assert_allclose(found[0], ready, atol=1e-6)


def test_a_weight_that_cannot_be_held_is_told_of(arm_named: Named) -> None:

    heavy = Attachment(
        Box(name="anvil", size=[0.05] * 3, position=[0, 0, 0.2]), "panda_hand", mass=60
    )
    arm = arm_named("panda").holding(heavy)
    with pytest.raises(DensarmError, match="cannot be held"):
        World(arm, Scene()).inverse_kinematics(Pose(arm.end_effector, [0.7, 0.0, 0.3]))


def test_what_is_no_pose_or_out_of_reach_is_refused(arm_named: Named) -> None:
    world = panda_among(arm_named)
    pose = Pose(world.arm.end_effector, [0.4, 0.0, 0.4])
    with pytest.raises(InvalidValueError, match=r"must be a densarm\.Pose"):
        world.inverse_kinematics([0.4, 0.0, 0.4])  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match="count = 0"):
        world.inverse_kinematics(pose, 0)
    with pytest.raises(InvalidValueError, match="margin = -1"):
        world.inverse_kinematics(pose, margin=-1.0)
    with pytest.raises(UnknownNameError, match="known: panda_finger"):
        world.inverse_kinematics(Pose("tool", [0.4, 0.0, 0.4]))
    with pytest.raises(DensarmError, match="out of reach: the nearest found is"):
        world.inverse_kinematics(Pose(world.arm.end_effector, [0.0, 1.5, 0.4]))
