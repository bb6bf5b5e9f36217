"""Inverse kinematics: every pose that can be reached is, by Pinocchio's own kinematics."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.arms.inverse_kinematics import InverseKinematics
from densarm.arms.pose import AXES, Pose
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.values.arrays import Array

DATA = Path(__file__).parents[1] / "data"
NAMED = ["panda", "kinova", "ur5", "z1", "so101"]
Load = Callable[[str], Arm]


@pytest.fixture(scope="module")
def load() -> Load:
    return cache(load_arm)


def drawn(arm: Arm, seed: int) -> Array:
    lower, upper = np.clip([arm.limits.lower, arm.limits.upper], -np.pi, np.pi)
    return arm.configurations(np.random.default_rng(seed).uniform(lower, upper))


def part(pose: Pose, asked: str) -> Pose:
    if asked == "position":
        return replace(pose, orientation_xyzw=None)
    return replace(pose, free=asked) if asked in AXES else pose


def errors(arm: Arm, pose: Pose, q: Array) -> tuple[float, float]:
    """How far the frame is off at q [m], and how far turned about what is not free [rad]."""
    at, want = arm.pose(q, pose.frame).placement, pose.placement
    off = float(np.linalg.norm(at.translation - want.translation))
    if pose.orientation_xyzw is None:
        return off, 0.0
    if pose.free:
        k = AXES.index(pose.free)
        return off, float(np.linalg.norm(at.rotation[:, k] - want.rotation[:, k]))
    return off, float(np.linalg.norm(pin.log3(at.rotation.T @ want.rotation)))


@pytest.mark.slow  # five arms are loaded
@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(NAMED),
    asked=st.sampled_from(["pose", "position", *AXES]),
    seed=st.integers(0, 10_000),
)
def test_what_can_be_reached_is_found(load: Load, name: str, asked: str, seed: int) -> None:
    arm = load(name)
    pose = part(arm.pose(drawn(arm, seed)), asked)
    near = drawn(arm, seed + 1)
    search = InverseKinematics(arm, pose)
    first, second = next(search.solutions(near, 0))
    for q in (first, second):
        off, turned = errors(arm, pose, q)
        assert off < 1e-6
        assert turned < 1e-6
        assert arm.limits.excess(arm.angles(q)).max() <= 0.0
    again, _ = next(search.solutions(near, 0))
    np.testing.assert_array_equal(first, again)
    far = np.linalg.norm(arm.difference(near, np.stack([first, second])), axis=1)
    assert far[0] <= far[1] + 1e-9


def test_where_the_arm_is_already_it_stays(load: Load) -> None:
    arm = load("panda")
    q = arm.postures["ready"]
    ways = next(InverseKinematics(arm, arm.pose(q)).solutions(q, 0))
    np.testing.assert_allclose(ways, np.stack([q, q]), atol=1e-6)


def test_whole_turns_are_taken_off(load: Load) -> None:
    arm = load("ur5")  # whose joints turn by two turns
    q = arm.postures["ready"]
    for ways, _ in zip(
        InverseKinematics(arm, arm.pose(q)).solutions(q, 0), range(20), strict=False
    ):
        away = np.abs(ways[0] - q)
        inner = np.abs(q) < np.pi
        assert away[inner].max() <= np.pi + 1e-9


@pytest.mark.parametrize("link", ["left_tip", "right_tip"])
def test_of_a_tree_only_the_branch_of_the_frame_moves(link: str) -> None:
    arm = load_arm(DATA / "branching.urdf")
    names = {frame.name for frame in arm.model.frames}
    frame = link if link in names else arm.end_effector
    q = drawn(arm, 3)
    pose = Pose(frame, arm.pose(q, frame).position)
    found = next(InverseKinematics(arm, pose).solutions(drawn(arm, 4), 0))[0]
    assert errors(arm, pose, found)[0] < 1e-6


def test_sliding_joints_reach_too() -> None:
    arm = load_arm(DATA / "gantry.urdf")
    pose = part(arm.pose(drawn(arm, 1)), "position")
    found = next(InverseKinematics(arm, pose).solutions(drawn(arm, 2), 0))[0]
    assert errors(arm, pose, found)[0] < 1e-6


def test_a_far_base_reaches_as_a_near_one() -> None:
    base = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 1.0), np.array([1000.0, -2000.0, 5.0]))
    arm = load_arm("panda", base_placement=base)
    pose = arm.pose(drawn(arm, 1))
    found = next(InverseKinematics(arm, pose).solutions(drawn(arm, 2), 0))[0]
    assert errors(arm, pose, found)[0] < 1e-6


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ([2.0, 0.0, 0.5], "out of reach: the nearest found is 1.06 m off"),
        ([400.0, 0.0, 300.0], "positions are in metres"),
        ([0.8, 0.0, 0.4], "though its position alone is not"),
    ],
)
def test_out_of_reach_is_told_with_how_far(
    load: Load, position: list[float], expected: str
) -> None:
    arm = load("panda")
    search = InverseKinematics(arm, Pose(arm.end_effector, position, [0.0, 1.0, 0.0, 0.0]))
    assert list(search.solutions(arm.postures["ready"], 0)) == []
    assert expected in search.shortfall()


def test_frames_that_are_not_there_or_do_not_move_are_refused(load: Load) -> None:
    with pytest.raises(UnknownNameError, match="panda_hand_tcp"):
        InverseKinematics(load("panda"), Pose("tool", [0.5, 0, 0.5]))
    with pytest.raises(InvalidValueError, match="one that a joint of 'panda' moves"):
        InverseKinematics(load("panda"), Pose("panda_link0", [0.5, 0, 0.5]))
