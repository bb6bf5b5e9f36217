"""Poses: what they hold, how tables tell them, and what is refused."""

import json
import math
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.arms.joints import without_subtrees
from densarm.arms.pose import Pose
from densarm.errors import DensarmError, InvalidValueError, UnknownNameError

HAND, DOWN = "panda_hand_tcp", (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def panda() -> Arm:
    return load_arm("panda")


def test_a_pose_is_a_value() -> None:
    pose = Pose(HAND, np.array([0.5, 0, 0.4]), [2.0 / 1.999, 0, 0, 0], free="z")
    assert pose == Pose(HAND, [0.5, 0.0, 0.4], DOWN, "z")
    assert hash(pose) == hash(Pose(HAND, (0.5, 0.0, 0.4), DOWN, "z"))
    assert Pose.of_table("goal", json.loads(json.dumps(pose.to_json()))) == pose
    assert str(pose) == "'panda_hand_tcp' at (0.5, 0, 0.4) m, turned by (1, 0, 0, 0), free about z"


def test_roll_pitch_and_yaw_turn_as_in_a_urdf() -> None:
    table = {"frame": HAND, "position": [0, 0, 1], "orientation_rpy_deg": [10.0, -20.0, 100.0]}
    turn = Pose.of_table("goal", table).placement.rotation
    expected = pin.rpy.rpyToMatrix(*np.radians([10.0, -20.0, 100.0]))
    np.testing.assert_allclose(turn, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"position": [0, 0]}, "position = [0, 0]: must be of shape (3,)"),
        ({"position": [0, 0, math.nan]}, "must be finite numbers"),
        ({"orientation_xyzw": [0, 1, 1, 0]}, "must be a unit quaternion x y z w"),
        ({"orientation_xyzw": [180, 0, 0]}, "or orientation_rpy_deg: three angles"),
        ({"free": "z"}, "free = 'z': must be given with an orientation only"),
        ({"free": "w", "orientation_xyzw": DOWN}, "must be one of x, y, z"),
        ({"frame": 3}, "frame = 3: must be the name of a frame"),
        ({"orientation_rpy_deg": [3.1416, 0, -1.5708]}, "in degrees: are these radians?"),
        (
            {"orientation_rpy_deg": [180, 0, 0], "orientation_xyzw": DOWN},
            "must be the only orientation given",
        ),
        ({"position": None}, "goal.position = None"),
        ({"orientation": DOWN}, "did you mean 'orientation_xyzw'?"),
    ],
)
def test_what_is_no_pose_is_refused_by_its_key(changes: dict[str, Any], expected: str) -> None:
    with pytest.raises(DensarmError) as caught:
        Pose.of_table("goal", {"frame": HAND, "position": [0.5, 0.0, 0.4], **changes})
    assert expected in str(caught.value)
    assert "goal" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_right_angles_in_degrees_are_none_in_radians() -> None:
    for rpy in ([0, 0, 0], [180, 0, 45], [3, 2, 1]):
        Pose.of_table("goal", {"frame": HAND, "position": [0, 0, 1], "orientation_rpy_deg": rpy})


def test_an_arm_tells_where_its_frames_are(panda: Arm) -> None:
    ready = panda.postures["ready"]
    assert panda.pose(ready).frame == HAND
    hand, tip = panda.pose(ready, "panda_hand"), panda.pose(ready)
    off = hand.placement.actInv(tip.placement).translation
    np.testing.assert_allclose(off, [0.0, 0.0, 0.1034], atol=1e-9)
    with pytest.raises(UnknownNameError, match="panda_hand_tcp"):
        panda.pose(ready, "hand")


def test_frames_of_ones_own_are_fixed_to_a_link(panda: Arm) -> None:
    probe = Pose("panda_hand", [0.0, 0.05, 0.2], [0.0, 0.0, 1.0, 0.0])
    arm = load_arm("panda", frames={"probe": probe})
    again = Arm(RobotDescription.from_json(json.loads(json.dumps(arm.description.to_json()))))
    ready = panda.postures["ready"]
    for own in (arm, again):
        off = own.pose(ready, "panda_hand").placement.actInv(own.pose(ready, "probe").placement)
        assert off.isApprox(probe.placement, 1e-12)
        assert own.end_effector == HAND


def test_frames_of_what_is_cut_off_go_with_it() -> None:
    tip = {"tip": Pose("panda_hand", [0.0, 0.0, 0.1])}
    with pytest.raises(UnknownNameError, match="link for frame 'tip'"):
        load_arm("panda", cut_joints=["panda_hand_joint"], frames=tip)
    whole = load_arm("panda", frames=tip).description
    cut = without_subtrees(whole, ["panda_hand_joint"])
    assert cut.frames == {}


@pytest.mark.parametrize(
    ("name", "pose", "expected"),
    [
        ("probe", Pose("flange", [0, 0, 0.1]), "unknown link for frame 'probe' 'flange'"),
        ("panda_hand", Pose("panda_link8", [0, 0, 0.1]), "other than those of the URDF's frames"),
        ("probe", Pose("panda_hand", [0, 0, 0], DOWN, "z"), "a frame has one pose"),
    ],
)
def test_a_frame_that_cannot_be_is_refused(name: str, pose: Pose, expected: str) -> None:
    with pytest.raises(DensarmError) as caught:
        load_arm("panda", frames={name: pose})
    assert expected in str(caught.value)


def test_a_far_base_counts(panda: Arm) -> None:
    base = pin.SE3(np.eye(3), np.array([1000.0, -2000.0, 5.0]))
    ready, far = panda.postures["ready"], load_arm("panda", base_placement=base)
    off = np.subtract(far.pose(ready).position, panda.pose(ready).position)
    np.testing.assert_allclose(off, base.translation, atol=1e-9)
    found = far.pose(ready)
    with pytest.raises(InvalidValueError):
        far.pose(np.zeros(3))
    assert found.frame == HAND


def test_a_pose_is_moved_in_the_axes_of_the_world() -> None:
    pose = Pose("tip", [1.0, 2.0, 3.0], DOWN, "z")
    step = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.5 * np.pi])
    moved = pose.moved(step)
    np.testing.assert_allclose(moved.position, [1.1, 2.2, 3.3])
    expected = pin.exp3(step[3:]) @ pose.placement.rotation
    np.testing.assert_allclose(moved.placement.rotation, expected, atol=1e-12)
    assert (moved.frame, moved.free) == ("tip", "z")
    alone = Pose("tip", [1.0, 2.0, 3.0]).moved(step)
    assert alone.orientation_xyzw is None
