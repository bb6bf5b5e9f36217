"""Configurations that an arm can be at: why not, and random ones."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.arms.joints import POSITION_TOLERANCE
from densarm.errors import DensarmError
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.world.configurations import clear_configurations, infeasibility
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

AROUND: dict[str, Obstacle] = {
    "two_link": Sphere(name="ball", radius=0.5, position=(0.0, 0.0, -1.5)),
    "panda": Box(name="table", size=(0.8, 1.4, 0.04), position=(0.6, 0.0, 0.1)),
}


@pytest.fixture(scope="module", params=AROUND)
def world(request: pytest.FixtureRequest, arm_named: Callable[[str], Arm]) -> World:
    return World(arm_named(request.param), Scene([AROUND[request.param]]))


@pytest.mark.parametrize("margin", [0.0, 0.02])
def test_clear_and_within_limits(world: World, margin: float) -> None:
    limits = world.arm.limits
    for q in clear_configurations(world, 5, 0, margin):
        angles = world.arm.angles(q)
        assert world.distances(q).min() > margin
        assert ((angles >= limits.lower) & (angles <= limits.upper)).all()


def test_more_of_them_begin_with_the_same(world: World) -> None:
    few, many, others = (
        np.array(clear_configurations(world, count, seed))
        for count, seed in ((2, 1), (4, 1), (2, 2))
    )
    np.testing.assert_array_equal(few, many[:2])
    assert (few != others).any()


def test_none_asked_for(world: World) -> None:
    assert clear_configurations(world, 0, 0) == []


def test_nowhere_to_be(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("densarm.world.configurations._DRAWS", 20)
    everywhere = World(world.arm, Scene([Sphere(name="all", radius=5.0, position=[0, 0, 0])]))
    with pytest.raises(DensarmError, match="none of 20 random configurations keeps 5 mm"):
        clear_configurations(everywhere, 2, 0, 0.005)


# Why an arm cannot be somewhere


def test_nothing_is_infeasible_where_the_arm_can_be(world: World) -> None:
    check = SweptCheck(world, 0.02)
    ends = clear_configurations(world, 2, 0, 0.02)
    assert infeasibility(check, {"start": ends[0], "goal": ends[1]}) == ""
    assert infeasibility(check, {}) == ""


def test_a_position_outside_the_limits_is_infeasible(arm_named: Callable[[str], Arm]) -> None:
    arm = arm_named("panda")
    q = arm.postures["ready"].copy()
    q[[1, 5]] = arm.limits.upper[1] + 0.1, arm.limits.lower[5] - 0.1
    phrase = infeasibility(SweptCheck(World(arm, Scene())), {"start": q})
    first, second, *_ = phrase.split("; ")
    assert first == "start: joint 'panda_joint2' at 1.8628 is outside [-1.7628, 1.7628]"
    assert second == "start: joint 'panda_joint6' at -0.1175 is outside [-0.0175, 3.7525]"


def test_positions_at_the_limits_may_be_rounded(arm_named: Callable[[str], Arm]) -> None:
    arm = arm_named("panda")
    check = SweptCheck(World(arm, Scene()))
    q = arm.postures["ready"].copy()
    for over in (1e-15, 0.9 * POSITION_TOLERANCE):
        q[0] = arm.limits.upper[0] + over
        assert infeasibility(check, {"start": q}) == ""
    q[0] = arm.limits.lower[0] - 1.1 * POSITION_TOLERANCE
    phrase = "goal: joint 'panda_joint1' at -2.8973000011 is outside [-2.8973, 2.8973]"
    assert infeasibility(check, {"goal": q}) == phrase


def test_overlaps_and_gaps_below_the_margin_are_infeasible(two_link: Arm) -> None:
    """The deepest first, each end by its name."""
    balls = [
        Sphere(name="low", radius=0.1, position=(0.0, 0.0, -2.16)),
        Sphere(name="beside", radius=0.1, position=(0.12, 0.0, -0.5)),
    ]
    check = SweptCheck(World(two_link, Scene(balls)), 0.02)
    hanging, sideways = two_link.configuration([0.0, 0.0]), two_link.configuration([-1.5, 0.0])
    assert infeasibility(check, {"start": sideways, "goal": hanging}) == (
        "goal: upper_link_0 and beside overlap by 30 mm; goal: lower_link_0 and low are 10 mm apart"
    )


def test_a_weight_that_cannot_be_held_is_infeasible(two_link: Arm) -> None:
    urdf = two_link.description.urdf.replace('effort="60"', 'effort="5"')
    weak = Arm(replace(two_link.description, urdf=urdf))
    phrase = infeasibility(
        SweptCheck(World(weak, Scene())), {"goal": weak.configuration([np.pi / 2, 0.0])}
    )
    assert phrase == (
        "goal: joint 'shoulder' needs 19.62 N·m to hold the arm at joint positions (1.571, 0), "
        "and has 5"
    )
