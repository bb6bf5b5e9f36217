"""Ways that keep a frame upright: proved between their points, around what is in the way."""

import numpy as np
import pytest

import densarm
from densarm.arms.upright import Upright
from densarm.errors import InvalidValueError
from densarm.planning.motion import PlanningError
from densarm.planning.plan import plan_motion
from densarm.planning.upright import UprightSpace
from densarm.scene.obstacles import Box
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

TCP, DOWN = "panda_hand_tcp", (1.0, 0.0, 0.0, 0.0)


def above(y: float, z: float) -> densarm.Pose:
    return densarm.Pose(TCP, [0.5, y, z], DOWN, "z")


@pytest.fixture(scope="module")
def wall() -> World:
    """Return Panda behind a table with a wall across it."""
    table = Box(name="table", size=(0.8, 1.4, 0.04), position=(0.6, 0.0, 0.1))
    wall = Box(name="wall", size=(0.3, 0.02, 0.25), position=(0.55, 0.0, 0.25))
    return World(densarm.load_arm("panda"), Scene([table, wall]))


@pytest.fixture(scope="module")
def start(wall: World) -> Array:
    """Return where the hand is before the wall."""
    q: Array = wall.inverse_kinematics(above(-0.3, 0.2), 1, 0)[0]
    return q


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.03, 0.2])
def test_a_hand_goes_over_a_wall_upright(wall: World, start: Array, tilt: float) -> None:
    arm, goal = wall.arm, above(0.3, 0.2)
    over = densarm.Pose(TCP, [0.45, 0.0, 0.55], DOWN, "z")
    motion = plan_motion(wall, start, goal, upright=TCP, tilt=tilt, through=[over], seed=1)
    q = arm.configurations(motion.position)
    assert motion.upright is not None
    assert motion.upright.tilts(arm, q).max() <= 0.9 * tilt
    assert SweptCheck(wall).check(q).verdict == SweptVerdict.CLEAR
    assert arm.pose(q[-1], TCP).position == pytest.approx(goal.position, abs=1e-4)
    free = plan_motion(wall, start, goal, through=[over], seed=1)
    if tilt < 0.1:
        position = arm.configurations(free.position)
        assert motion.upright.tilts(arm, position).max() > tilt
    assert motion.duration < 1.5 * free.duration
    assert motion.way_points is not None


def test_a_segment_is_proved_or_not(wall: World, start: Array) -> None:
    arm = wall.arm
    upright = Upright.from_start(arm, start, TCP, 0.2)
    space = UprightSpace(arm, SeparatingPlanes(wall), upright)
    turned, tipped, back = start.copy(), start.copy(), start.copy()
    turned[[0, 6]] += [-0.3, 0.5]
    tipped[5] += 0.17
    back[5] -= 0.15
    assert space.segment_is_clear(start, turned)
    assert space.configuration_is_clear(back)
    assert not space.configuration_is_clear(tipped)
    assert not space.polyline_is_clear(np.stack([start, back, tipped]))
    righted = space.righted(tipped)
    assert upright.tilts(arm, righted[np.newaxis])[0] <= 0.5 * 0.2
    assert np.abs(righted - tipped).max() < 0.2


def test_both_ends_may_be_upright_and_not_what_is_between(wall: World, start: Array) -> None:
    far = wall.inverse_kinematics(above(0.3, 0.2), 1, 0, near=start)[0]
    planes = SeparatingPlanes(wall)
    space = UprightSpace(wall.arm, planes, Upright.from_start(wall.arm, start, TCP, 0.1))
    assert space.configuration_is_clear(far)
    assert planes.segment_is_clear(start, far)
    assert not space.segment_is_clear(start, far)


def test_what_cannot_be_kept_upright_is_told(wall: World, start: Array) -> None:
    aside = densarm.Pose(TCP, [0.5, 0.3, 0.4], (0.0, 0.7071067811865476, 0.0, 0.7071067811865476))
    with pytest.raises(PlanningError, match=r"goal: a tilt of 1.57 rad of 'panda_hand_tcp'"):
        plan_motion(wall, start, aside, upright=TCP)
    with pytest.raises(InvalidValueError, match="guide = 'density': must be 'auto' or 'path'"):
        plan_motion(wall, start, above(0.3, 0.3), "density", upright=TCP)
    with pytest.raises(InvalidValueError, match=r"upright = .*: must be left out where the goal"):
        plan_motion(wall, start, densarm.Line(TCP, by=[0.0, 0.0, 0.1]), upright=TCP)
