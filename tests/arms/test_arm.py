"""Arms by name and from URDF files: joints, limits, postures, locked joints, base placement."""

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

import densarm.arms.urdf as urdf_to_models
from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription, data_wheel_folder
from densarm.errors import (
    DensarmError,
    FileContentError,
    InvalidValueError,
    RobotDescriptionError,
    UnknownNameError,
)
from densarm.scene.mesh_file import read_mesh
from densarm.values.arrays import Array

DATA = Path(__file__).parents[1] / "data"
BRANCHING = DATA / "branching.urdf"
BASE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.7, 2.0), np.array([0.4, -0.2, 0.9]))
FINGERS = {"panda_finger_joint1": 0.04, "panda_finger_joint2": 0.04}  # [m]


@pytest.fixture(scope="module")
def branching() -> Arm:
    return load_arm(BRANCHING, srdf=DATA / "branching.srdf")


def angles_of(arm: Arm) -> st.SearchStrategy[Array]:
    low = np.where(arm.continuous, -np.pi, arm.limits.lower)
    high = np.where(arm.continuous, np.pi, arm.limits.upper)
    return st.tuples(*(st.floats(a, b) for a, b in zip(low, high, strict=True))).map(np.array)


def frame(arm: Arm, q: Array, name: str) -> pin.SE3:
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, q)
    return data.oMf[arm.model.getFrameId(name)].copy()


# By name


def test_two_link() -> None:
    arm = load_arm("two_link")
    assert (arm.name, arm.nq, arm.nv, arm.end_effector) == ("two_link", 4, 2, "tip")
    assert arm.joint_names == ("shoulder", "elbow")
    assert arm.continuous.all()
    assert (arm.limits.lower == -np.inf).all()
    assert (arm.limits.upper == np.inf).all()
    np.testing.assert_array_equal(arm.limits.effort, [60.0, 30.0])
    np.testing.assert_array_equal(arm.limits.velocity, [6.0, 6.0])
    np.testing.assert_allclose(arm.postures["upright"], [-1.0, 0.0, 1.0, 0.0], atol=1e-15)
    assert [len(arm.visual_model.geometryObjects), arm.collision_model.ngeoms] == [8, 2]
    assert arm.mesh_hashes() == {}


def test_panda() -> None:
    arm = load_arm("panda")
    assert (arm.nq, arm.nv, arm.end_effector) == (7, 7, "panda_hand_tcp")
    assert not arm.continuous.any()
    np.testing.assert_array_equal(arm.limits.acceleration, [15, 7.5, 10, 12.5, 15, 20, 20])
    np.testing.assert_array_equal(arm.limits.torque_rate, [1000.0] * 7)
    np.testing.assert_array_equal(arm.limits.jerk, [5000.0] * 7)
    assert {"ready", "stretched"} <= set(arm.postures)
    assert {"link0.stl", "hand.stl"} <= set(arm.mesh_hashes())
    assert {item.meshPath[-4:] for item in arm.visual_model.geometryObjects} == {".dae"}


def test_locking_one_more_joint_of_a_named_arm() -> None:
    arm = load_arm("panda", locked_joints={"panda_joint3": 0.1})
    assert arm.nv == 6
    np.testing.assert_array_equal(arm.limits.acceleration, [15, 7.5, 12.5, 15, 20, 20])
    ready = load_arm("panda").postures["ready"]
    np.testing.assert_array_equal(arm.postures["ready"], np.delete(ready, 2))


def test_limits_of_ones_own() -> None:
    locked = {"panda_joint3": 0.1}
    rates = np.arange(1.0, 7.0)
    arm = load_arm(
        "panda", locked_joints=locked, acceleration=[5.0] * 6, torque_rate=rates, jerk=np.inf
    )
    np.testing.assert_array_equal(arm.limits.acceleration, [5.0] * 6)
    np.testing.assert_array_equal(arm.limits.torque_rate, rates)
    assert np.isinf(arm.limits.jerk).all()
    assert json.loads(json.dumps(arm.description.to_json(), allow_nan=False))["jerk"] is None
    with pytest.raises(InvalidValueError, match=r"jerk = .*\(6,\), got \(7,\)"):
        load_arm("panda", locked_joints=locked, jerk=[1.0] * 7)


def test_rotors_add_their_inertia() -> None:
    bare, rotors = load_arm("two_link"), np.array([0.1, 0.0])
    arm = load_arm("two_link", armature=rotors)
    q, v = bare.configuration([0.3, -1.0]), np.array([0.5, 2.0])
    added = arm.mass_matrix(q) - bare.mass_matrix(q)
    np.testing.assert_allclose(added, np.diag(rotors), atol=1e-15)
    np.testing.assert_array_equal(arm.nonlinear_effects(q, v), bare.nonlinear_effects(q, v))
    again = Arm(RobotDescription.from_json(arm.description.to_json()))
    np.testing.assert_array_equal(again.mass_matrix(q), arm.mass_matrix(q))


# From a file


def test_urdf_file(branching: Arm) -> None:
    assert branching.name == "branching"
    assert branching.joint_names == ("turn", "slide", "left", "right", "wrist")
    assert branching.end_effector == "tool"
    np.testing.assert_array_equal(branching.continuous, [True, False, False, False, True])
    np.testing.assert_array_equal(branching.limits.lower, [-np.inf, -0.1, -2.0, -1.5, -np.inf])
    np.testing.assert_array_equal(branching.limits.velocity, [2.0, 0.5, 3.0, 3.0, np.inf])
    np.testing.assert_array_equal(branching.limits.effort, [50.0, 100.0, 20.0, 20.0, np.inf])
    np.testing.assert_array_equal(branching.limits.acceleration, [10.0] * 5)
    assert np.isinf([branching.limits.torque_rate, branching.limits.jerk]).all()
    assert set(branching.mesh_hashes()) == {"wedge.stl"}


def test_srdf_states_that_cover_all_joints_become_postures(branching: Arm) -> None:
    assert set(branching.postures) == {"home", "neutral"}
    home = branching.angles(branching.postures["home"])
    np.testing.assert_allclose(home, [0.5, 0.1, -0.2, 0.3, 3.0], atol=1e-15)


def test_limits_that_a_urdf_does_not_set() -> None:
    urdf = BRANCHING.read_text().replace('effort="50"', 'effort="1.7e308"')
    assert load_text(urdf).limits.effort[0] == np.inf


def load_text(urdf: str, **options: Any) -> Arm:
    """Load a changed copy of the branching arm from beside its meshes."""
    file = DATA / "temporary.urdf"
    file.write_text(urdf)
    try:
        return load_arm(file, **options)
    finally:
        file.unlink()


@pytest.mark.parametrize("prefix", ["package://data/", "package://", "file://", ""])
def test_mesh_paths(tmp_path: Path, prefix: str) -> None:
    folder = tmp_path / "data"
    shutil.copytree(DATA, folder)
    path = f"{folder}/meshes" if prefix == "file://" else "meshes"
    urdf = BRANCHING.read_text().replace('"meshes', f'"{prefix}{path}')
    file = folder / "branching.urdf"
    file.write_text(urdf)
    arm = load_arm(file)
    assert arm.collision_model.ngeoms == 6
    assert len(arm.visual_model.geometryObjects) == 3


def test_package_dirs(tmp_path: Path) -> None:
    shutil.copytree(DATA / "meshes", tmp_path / "elsewhere" / "wedges")
    urdf = BRANCHING.read_text().replace('"meshes', '"package://wedges')
    file = tmp_path / "robot.urdf"
    file.write_text(urdf)
    with pytest.raises(RobotDescriptionError, match=r"package://wedges/wedge.stl.*package_dirs"):
        load_arm(file)
    for folders in ([tmp_path / "elsewhere"], str(tmp_path / "elsewhere")):
        assert load_arm(file, package_dirs=folders).collision_model.ngeoms == 6


def test_a_mesh_is_read_once_until_its_file_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []

    def told(path: Path, scale: Any) -> Any:
        read.append(path.name)
        return read_mesh(path, scale)

    monkeypatch.setattr(urdf_to_models, "read_mesh", told)
    shutil.copytree(DATA, tmp_path / "data")
    file = tmp_path / "data" / "branching.urdf"
    first, again = load_arm(file), load_arm(file)
    assert 0 < len(read) == len(set(read))
    mesh = next((tmp_path / "data").rglob(read[0]))
    mesh.write_bytes(mesh.read_bytes())
    os.utime(mesh, ns=(1, 1))
    count, changed = len(read), load_arm(file)
    assert read[count:] == read[:1]
    for arm in (again, changed):
        for one, other in zip(
            first.collision_model.geometryObjects, arm.collision_model.geometryObjects, strict=True
        ):
            assert one.geometry == other.geometry


def test_meshes_of_one_name_are_told_apart(tmp_path: Path) -> None:
    for side in ("left", "right"):
        shutil.copytree(DATA / "meshes", tmp_path / side)
    (tmp_path / "right" / "wedge.stl").write_bytes(b" " + (DATA / "meshes/wedge.stl").read_bytes())
    sphere = '<sphere radius="0.07"/>'
    urdf = BRANCHING.read_text().replace("meshes/wedge.obj", "left/wedge.obj")
    urdf = urdf.replace("meshes", "right").replace(sphere, '<mesh filename="left/wedge.stl"/>')
    (tmp_path / "robot.urdf").write_text(urdf)
    hashes = load_arm(tmp_path / "robot.urdf").mesh_hashes()
    assert set(hashes) == {"left/wedge.stl", "right/wedge.stl"}
    assert len(set(hashes.values())) == 2


# Locked joints


@pytest.fixture(scope="module")
def with_locked_joints() -> Arm:
    """The slide's position lies outside its limits, and the wrist is continuous."""
    return load_arm(BRANCHING, locked_joints={"slide": 0.5, "wrist": 2.0})


@given(data=st.data())
def test_locked_joints_stand_still(
    branching: Arm, with_locked_joints: Arm, data: st.DataObject
) -> None:
    arm = with_locked_joints
    assert arm.joint_names == ("turn", "left", "right")
    turn, left, right = data.draw(angles_of(arm))
    full = branching.configuration([turn, 0.5, left, right, 2.0])
    reduced = arm.configuration([turn, left, right])
    expected = frame(branching, full, "tool")
    assert frame(arm, reduced, "tool").isApprox(expected, 1e-12)
    moving = np.ix_([0, 2, 3], [0, 2, 3])
    np.testing.assert_allclose(
        arm.mass_matrix(reduced), branching.mass_matrix(full)[moving], atol=1e-12
    )


MIMIC = BRANCHING.read_text().replace(
    '<axis xyz="0 1 1"/>', '<mimic joint="turn" multiplier="-0.2" offset="0.1"/><axis xyz="0 1 1"/>'
)


def test_mimicking_joints_stand_with_what_they_mimic(branching: Arm) -> None:
    with pytest.raises(
        RobotDescriptionError, match=r"'slide' mimics 'turn', which moves.*locked_j"
    ):
        load_text(MIMIC)
    arm = load_text(MIMIC, locked_joints={"turn": -0.5})
    assert arm.joint_names == ("left", "right", "wrist")
    full = branching.configuration([-0.5, 0.2, 0.3, 0.4, 0.5])
    tool = frame(arm, arm.configuration([0.3, 0.4, 0.5]), "tool")
    assert tool.isApprox(frame(branching, full, "tool"), 1e-12)
    assert load_text(MIMIC, locked_joints={"slide": 0.0}).joint_names[0] == "turn"


# An arm out of a larger robot


@pytest.fixture(scope="module")
def of_chosen_joints() -> Arm:
    return load_arm(BRANCHING, joints=["wrist", "left"], locked_joints={"turn": 0.7})


@given(data=st.data())
def test_chosen_joints_move_and_all_others_stand(
    branching: Arm, of_chosen_joints: Arm, data: st.DataObject
) -> None:
    arm = of_chosen_joints
    assert arm.joint_names == ("left", "wrist")
    left, wrist = data.draw(angles_of(arm))
    full = branching.configuration([0.7, 0.0, left, 0.0, wrist])
    for name in ("tool", "left_arm"):
        expected = frame(branching, full, name)
        assert frame(arm, arm.configuration([left, wrist]), name).isApprox(expected, 1e-12)


@pytest.mark.parametrize("leader", ["tail", "left", "slide"])
def test_a_joint_that_mimics_nothing_that_moves_stands(leader: str) -> None:
    """Its leader is no joint, or stands as it is not chosen."""
    urdf = BRANCHING.read_text()
    mimic = f'<mimic joint="{leader}" multiplier="0.5" offset="0.1"/>'
    urdf = urdf.replace('<child link="blade"/>', f'<child link="blade"/>{mimic}')
    arm = load_text(urdf, joints=["turn", "right"], locked_joints={"left": 0.4, "slide": 0.2})
    assert arm.joint_names == ("turn", "right")
    full = load_arm(BRANCHING)
    wrist = {"tail": 0.0, "left": 0.3, "slide": 0.2}[leader]
    expected = frame(full, full.configuration([0.0, 0.2, 0.4, 0.0, wrist]), "tool")
    assert frame(arm, arm.configuration([0.0, 0.0]), "tool").isApprox(expected, 1e-12)


def test_all_that_must_be_locked_is_named_at_once() -> None:
    urdf = BRANCHING.read_text()
    for child, leader in (("blade", "left"), ("right_arm", "turn"), ("carriage", "tail")):
        element = f'<child link="{child}"/>'
        urdf = urdf.replace(element, f'{element}<mimic joint="{leader}"/>')
    with pytest.raises(RobotDescriptionError, match=r"joints=\[...\]") as raised:
        load_text(urdf)
    assert "{'left': position, 'slide': position, 'turn': position}" in str(raised.value)


def test_joints_out_of_their_zero_stand_at_the_limit_next_to_it() -> None:
    urdf = BRANCHING.read_text().replace('lower="-0.1"', 'lower="0.05"')
    assert load_text(urdf, joints=["left"]).description.locked_joints["slide"] == 0.05


def test_one_arm_of_a_robot_with_two() -> None:
    urdf = data_wheel_folder() / "example-robot-data/robots/baxter_description/urdf/baxter.urdf"
    names = [f"left_{joint}" for joint in ("w2", "s0", "s1", "e0", "e1", "w0", "w1")]
    arm = load_arm(urdf, joints=names, shapes="capsule")  # hulls would be cut into pieces
    assert arm.joint_names == (*names[1:], names[0])
    assert arm.end_effector.startswith("left_hand")
    assert arm.collision_model.existGeometryName("right_upper_shoulder_0")
    again = Arm(RobotDescription.from_json(json.loads(json.dumps(arm.description.to_json()))))
    assert again.joint_names == arm.joint_names
    with pytest.raises(
        UnknownNameError, match=r"joint 'left_s9'; did you mean 'left_s1'.*head_pan"
    ):
        load_arm(urdf, joints=["left_s9"])


@pytest.mark.parametrize(
    ("robot", "options", "message"),
    [
        (BRANCHING, {"joints": []}, "no joint to move"),
        (BRANCHING, {"joints": ["tool_joint"]}, "unknown joint 'tool_joint'.*known: left, right"),
        (BRANCHING, {"joints": "left", "locked_joints": {"left": 0}}, r"locked_joints.left = 0"),
        ("panda", {"joints": ["panda_finger_joint1"]}, "unknown joint.*panda_joint7"),
    ],
)
def test_wrong_choice_of_joints(robot: str | Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(DensarmError, match=message):
        load_arm(robot, **options)


def test_chosen_joints_of_a_named_arm() -> None:
    arm = load_arm("panda", joints=["panda_joint2", "panda_joint4"])
    np.testing.assert_array_equal(arm.limits.acceleration, [7.5, 12.5])
    np.testing.assert_array_equal(arm.limits.jerk, [5000.0] * 2)
    ready = load_arm("panda").postures["ready"]
    np.testing.assert_array_equal(arm.postures["ready"], ready[[1, 3]])


def test_joints_of_several_axes_can_stand_at_their_neutral_pose() -> None:
    urdf = BRANCHING.read_text().replace("prismatic", "floating")
    assert load_text(urdf, joints=["left", "wrist"]).nv == 2
    with pytest.raises(RobotDescriptionError, match=r"'slide' has 6 degrees.*locked at 0 alone"):
        load_text(urdf, locked_joints={"slide": 0.1})


def test_a_joint_and_a_link_of_one_name() -> None:
    urdf = BRANCHING.read_text().replace('"right_arm"', '"wrist"')
    arm = load_text(urdf, locked_joints={"wrist": 0.0})
    assert arm.joint_names == ("turn", "slide", "left", "right")
    description = replace(arm.description, end_effector="wrist")
    frame = Arm(description).model.frames[Arm(description).end_effector_frame]
    assert (frame.name, frame.type) == ("wrist", pin.FrameType.BODY)


# Locked joints that cannot be


@pytest.mark.parametrize(
    ("locked", "message"),
    [
        ({"elbow": 0.0}, "unknown joint to lock 'elbow'.*known: left, right, slide, turn, wrist"),
        ({"turn": np.nan}, r"locked_joints.turn = .*nan.*must be finite"),
        ({"turn": "far"}, r"locked_joints.turn = .*far"),
        (dict.fromkeys(("turn", "slide", "left", "right", "wrist"), 0.0), "no joint to move"),
    ],
)
def test_wrong_locked_joints(locked: Any, message: str) -> None:
    with pytest.raises(DensarmError, match=message):
        load_arm(BRANCHING, locked_joints=locked)


# Base placement


def test_base_placement_moves_everything_but_gravity(branching: Arm) -> None:
    placed = load_arm(BRANCHING, base_placement=BASE)
    q = branching.postures["home"]
    for name in [item.name for item in branching.model.frames][1:]:
        assert frame(placed, q, name).isApprox(BASE * frame(branching, q, name), 1e-12)
    for kind in ("collision_model", "visual_model"):
        for before, after in zip(shapes(branching, kind, q), shapes(placed, kind, q), strict=True):
            assert after.isApprox(BASE * before, 1e-12)
    np.testing.assert_array_equal(placed.model.gravity.vector, branching.model.gravity.vector)
    # Turned bases change what gravity does, and nothing else.
    np.testing.assert_allclose(placed.mass_matrix(q), branching.mass_matrix(q), atol=1e-12)
    rest = np.zeros(branching.nv)
    assert (
        np.abs(placed.nonlinear_effects(q, rest) - branching.nonlinear_effects(q, rest)).max() > 1
    )


def shapes(arm: Arm, kind: str, q: Array) -> list[pin.SE3]:
    geometry = getattr(arm, kind)
    data = geometry.createData()
    pin.updateGeometryPlacements(arm.model, arm.model.createData(), geometry, data, q)
    return [placement.copy() for placement in data.oMg]


@pytest.mark.parametrize(
    "placement",
    [np.eye(4), pin.SE3(np.eye(3), np.array([0, np.nan, 0])), pin.SE3(np.eye(3) * 2, np.zeros(3))],
)
def test_wrong_base_placement(placement: Any) -> None:
    with pytest.raises(InvalidValueError, match="base_placement"):
        load_arm("two_link", base_placement=placement)


# Configurations


@given(data=st.data())
def test_configurations_follow_pinocchio(branching: Arm, data: st.DataObject) -> None:
    theta = data.draw(angles_of(branching))
    step = data.draw(st.tuples(*[st.floats(-3.0, 3.0)] * 5).map(np.array))
    q = branching.configuration(theta)
    np.testing.assert_allclose(branching.angles(q), theta, atol=1e-12)
    moved = pin.integrate(branching.model, q, step)
    np.testing.assert_allclose(branching.integrate(q, step), moved, atol=1e-12)
    # One vector leads there: the short way round, of length 3 rad at most.
    difference = pin.difference(branching.model, q, moved)
    np.testing.assert_allclose(branching.difference(q, moved), difference, atol=1e-9)
    np.testing.assert_allclose(branching.difference(q, moved), step, atol=1e-9)


def test_many_configurations_at_once(branching: Arm) -> None:
    theta = np.random.default_rng(0).uniform(-0.1, 0.3, (4, 3, 5))
    q = branching.configurations(theta)
    assert q.shape == (4, 3, 7)
    np.testing.assert_allclose(branching.angles(q), theta, atol=1e-12)
    difference = branching.difference(q[0], q[1])
    np.testing.assert_allclose(difference, theta[1] - theta[0], atol=1e-12)
    np.testing.assert_allclose(branching.integrate(q[0], difference), q[1], atol=1e-12)
    assert branching.configurations(theta[:0, 0]).shape == (0, 7)


@pytest.mark.slow
def test_postures_are_configurations() -> None:
    for arm in (load_arm("two_link"), load_arm("panda"), load_arm("panda", shapes="capsule")):
        for q in arm.postures.values():
            arm.check_configuration("configuration", q)
            assert (arm.angles(q) >= arm.limits.lower).all()
            assert (arm.angles(q) <= arm.limits.upper).all()


def test_neutral_is_zero_or_a_tenth_of_the_range_from_the_limits(branching: Arm) -> None:
    np.testing.assert_array_equal(branching.angles(branching.postures["neutral"]), np.zeros(5))
    panda = load_arm("panda").postures["neutral"]
    limits = load_arm("panda").limits
    expected = (0.9 * limits.upper + 0.1 * limits.lower)[3]
    np.testing.assert_allclose(panda[[0, 1, 2, 3]], [0, 0, 0, expected], rtol=1e-12)
    assert panda[5] > limits.lower[5] + 0.1


def test_wrong_configurations() -> None:
    arm = load_arm("two_link")
    with pytest.raises(InvalidValueError, match=r"configuration = .*\(4,\), got \(2,\).*arm.conf"):
        arm.mass_matrix([0.0, 0.0])
    with pytest.raises(InvalidValueError, match=r"velocity = .*\(2,\), got \(4,\)"):
        arm.nonlinear_effects([1, 0, 1, 0], [0, 0, 0, 0])
    with pytest.raises(InvalidValueError, match=r"configuration.*finite"):
        arm.mass_matrix([1.0, 0.0, np.nan, 0.0])
    with pytest.raises(InvalidValueError, match=r"joint 'elbow' = .*must be \(cos, sin\)"):
        arm.mass_matrix([1.0, 0.0, 1.0, 1.0])
    with pytest.raises(InvalidValueError, match=r"angles = .*\(2,\), got \(4,\)"):
        arm.configuration([1, 0, 1, 0])
    with pytest.raises(InvalidValueError, match=r"angles.*finite"):
        arm.configuration([1, np.inf])


# What is refused


def test_unknown_robot_lists_the_known() -> None:
    with pytest.raises(UnknownNameError, match=r"'pando'; did you mean 'panda'.*panda, .*two_link"):
        load_arm("pando")


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match=r"nothing.urdf: No such file"):
        load_arm(tmp_path / "nothing.urdf")
    (tmp_path / "noise.urdf").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileContentError, match=r"noise.urdf: not a UTF-8 text file"):
        load_arm(tmp_path / "noise.urdf")
    with pytest.raises(FileContentError, match=r"nothing.srdf: No such file"):
        load_arm("two_link", srdf=tmp_path / "nothing.srdf")


def test_unknown_shapes() -> None:
    with pytest.raises(InvalidValueError, match="shapes = 'cloud': must be one of capsule, hull"):
        load_arm("two_link", shapes="cloud")


CHANGES = {
    "nothing": ("", "", None),
    "not XML": ("</robot>", "", "not well-formed XML"),
    "another root": ("robot", "sdf", "root element is <sdf>"),
    "no limit": ('<limit lower="-2" upper="1.5" effort="20" velocity="3"/>', "", "left.*limits"),
    "crossed limits": ('lower="-2"', 'lower="2"', "'left' has a lower limit 2 above.*1.5"),
    "limit not finite": ('lower="-2"', 'lower="nan"', "left.*nan"),
    "unknown type of joint": ("prismatic", "hydraulic", "hydraulic"),
    "joint with six axes": ("prismatic", "floating", "slide.*6 degrees of freedom"),
    "no axis": ('axis xyz="0 1 1"', 'axis xyz="0 0 0"', "slide.*axis 0 0 0"),
    "unknown link": ('child link="blade"', 'child link="sword"', "sword"),
    "two roots": ('child link="blade"', 'child link="tool"', "URDF: "),
    "zero radius": ('radius="0.07"', 'radius="0"', None),
    "negative radius": ('radius="0.04"', 'radius="-0.04"', "left_arm_0.*size that is not positive"),
    "negative side": ("0.1 0.12 0.08", "0.1 -1 0", "carriage_0.*size that is not positive"),
    "radius not finite": ('radius="0.07"', 'radius="nan"', "radius.*nan"),
    "unknown shape": ("sphere radius", "cone radius", "cone"),
    "missing mesh": (
        "wedge.stl",
        "blade.stl",
        "meshes/blade.stl' of link 'blade'.*found in /.*package_dirs",
    ),
    "mesh that is none": ("wedge.stl", "../branching.srdf", "branching.srdf"),
    "negative mass": ('mass value="1.0"', 'mass value="-1"', "link 'base' .*negative mass -1"),
    "one negative mass": (
        r'(?s)(<link name="right_arm">.*?mass value=")1.0',
        r"\1-2",
        "link 'right_arm' has the negative mass -2",
    ),
    "negative effort": ('effort="20"', 'effort="-20"', "'left' has the effort limit -20"),
    "negative velocity": ('velocity="3"', 'velocity="-3"', "'left' has the velocity limit -3"),
    "two parents": (
        "<robot [^>]*>",
        r'\g<0><joint name="weld" type="fixed"><parent link="base"/><child link="blade"/></joint>',
        "link 'blade' has two parents, 'base' by joint 'weld' and '[a-z_]*' by joint 'wrist'",
    ),
    "mass not finite": ('mass value="1.0"', 'mass value="inf"', "mass"),
    "no inertia": (r"(?s)<inertial>.*?</inertial>", "", None),
    "no collision": (
        r"(?s)<(collision|visual)>.*?</\1>",
        "",
        "'temporary'.*no <collision> geometry",
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_urdf_that_cannot_be_used(change: str, capfd: pytest.CaptureFixture[str]) -> None:
    old, new, message = CHANGES[change]
    count = 0 if change in {"another root", "no inertia", "no collision", "negative mass"} else 1
    urdf = re.sub(old, new, BRANCHING.read_text(), count=count)
    if message is None:
        assert load_text(urdf).nv == 5
    else:
        with pytest.raises(RobotDescriptionError, match=message) as raised:
            load_text(urdf)
        assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def test_srdf_that_cannot_be_used(tmp_path: Path) -> None:
    good = (DATA / "branching.srdf").read_text()
    file = tmp_path / "robot.srdf"
    for old, new, message in (
        ('value="0.5"', 'value="half"', "SRDF: group_state.*'half'"),
        ('value="0.5"', "", "SRDF: group_state.*''"),
        ('value="0.5"', 'value="30 deg"', "'30 deg' is not a finite number, of rad or m without"),
        ("</robot>", "", "SRDF: not well-formed XML"),
        ("robot", "sdf", "SRDF: the root element is <sdf>"),
    ):
        file.write_text(good.replace(old, new))
        with pytest.raises(DensarmError, match=message):
            load_arm(BRANCHING, srdf=file)
