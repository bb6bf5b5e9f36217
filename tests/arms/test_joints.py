"""Parts taken off a robot leave the rest as it was."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.errors import UnknownNameError
from densarm.values.arrays import Array

DATA = Path(__file__).parents[1] / "data"
BRANCHING = DATA / "branching.urdf"
SRDF = DATA / "branching.srdf"


def cut(*joints: str, **options: Any) -> Arm:
    return load_arm(BRANCHING, srdf=SRDF, cut_joints=joints, **options)


def shapes(arm: Arm) -> dict[str, Array]:
    items = arm.collision_model.geometryObjects
    return {item.name: item.placement.homogeneous for item in items}


@pytest.mark.parametrize(
    ("joints", "kept"),
    [
        (["wrist"], ("turn", "slide", "left", "right")),
        (["right"], ("turn", "slide", "left")),
        (["left", "wrist"], ("turn", "slide", "right")),
        (["slide", "left"], ("turn",)),
    ],
)
def test_what_a_joint_carries_goes_with_it(joints: list[str], kept: tuple[str, ...]) -> None:
    whole, arm = cut(), cut(*joints)
    assert arm.joint_names == kept
    assert set(shapes(arm)) < set(shapes(whole))
    for name, placement in shapes(arm).items():
        np.testing.assert_array_equal(placement, shapes(whole)[name])
    home = dict(zip(whole.joint_names, whole.angles(whole.postures["home"]), strict=True))
    np.testing.assert_allclose(arm.angles(arm.postures["home"]), [home[name] for name in kept])


def test_pairs_of_what_is_left_stay() -> None:
    def pairs(arm: Arm) -> set[frozenset[str]]:
        items = arm.collision_model.geometryObjects
        return {
            frozenset((items[pair.first].name, items[pair.second].name))
            for pair in arm.collision_model.collisionPairs
        }

    whole, arm = cut(), cut("wrist")
    assert pairs(arm) == {pair for pair in pairs(whole) if pair <= set(shapes(arm))}


def test_gripper_of_a_named_arm() -> None:
    whole, arm = load_arm("panda"), load_arm("panda", cut_joints=["panda_hand_joint"])
    assert arm.joint_names == whole.joint_names
    assert not any("hand" in name or "finger" in name for name in shapes(arm))
    assert arm.end_effector == "panda_link8"
    np.testing.assert_array_equal(arm.limits.acceleration, whole.limits.acceleration)
    np.testing.assert_array_equal(arm.postures["ready"], whole.postures["ready"])


def test_limits_and_postures_of_a_named_arm_lose_the_joints_that_go() -> None:
    whole = load_arm("panda")
    arm = load_arm("panda", cut_joints="panda_joint6", locked_joints={"panda_joint2": 0.1})
    kept = [0, 2, 3, 4]
    assert arm.joint_names == tuple(whole.joint_names[k] for k in kept)
    np.testing.assert_array_equal(arm.limits.acceleration, whole.limits.acceleration[kept])
    np.testing.assert_array_equal(arm.postures["ready"], whole.postures["ready"][kept])


def test_unknown_joint() -> None:
    with pytest.raises(UnknownNameError, match=r"unknown joint to cut at 'elbow'.*known: .*left"):
        cut("elbow")


def test_a_joint_that_is_gone_cannot_be_locked() -> None:
    with pytest.raises(UnknownNameError, match="joint to lock 'wrist'"):
        cut("right", locked_joints={"wrist": 0.0})


def test_velocity_limits_fall_towards_the_position_limit_ahead_as_libfranka_has_them() -> None:
    limits = load_arm("fr3").limits
    # (upper limit, v, o, a) of joints 1 and 6, of libfranka's own description.
    theirs = {0: (2.7501, 2.62, 0.30, 6.0), 5: (4.5205, 4.18, 0.35, 5.5)}
    middle = 0.5 * (limits.lower + limits.upper)
    for joint, (upper, v, o, a) in theirs.items():
        for position in np.linspace(middle[joint], limits.upper[joint], 7):
            angles = middle.copy()
            angles[joint] = position
            allowed = min(v, max(0.0, np.sqrt(2.0 * a * (upper - position)) - o))
            found = limits.fastest(angles, np.ones(7))[joint]
            assert found == pytest.approx(allowed, abs=2e-3)
            assert limits.fastest(angles, -np.ones(7))[joint] == v  # away from the limit
    panda = load_arm("panda").limits
    assert panda.fastest(panda.upper, np.ones(7)) is panda.velocity
