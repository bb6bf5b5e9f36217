"""Descriptions as data: JSON form, files and folders that they name."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from densarm.arm import Arm, load_arm
from densarm.catalogue import (
    read_toml,
    robot_description,
    robot_names,
    robots_folder,
    scenario_paths,
)
from densarm.errors import (
    DensarmError,
    FileContentError,
    RobotDescriptionError,
    UnknownNameError,
)
from densarm.robot.robot_description import (
    RobotDescription,
    data_wheel_folder,
    parse_robot_xml,
    read_text,
    resolve_package_dir,
    resolve_path,
)

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"


@pytest.mark.parametrize("shapes", ["hull", "capsule"])
def test_json_rebuilds_the_arm(shapes):
    arm = load_arm("panda", locked_joints={"panda_joint1": 0.5}, shapes=shapes)
    data = json.loads(json.dumps(arm.description.to_json()))
    description = RobotDescription.from_json(data)
    assert description == arm.description
    again = Arm(description)
    assert again.mesh_hashes() == arm.mesh_hashes()
    np.testing.assert_array_equal(again.limits.acceleration, arm.limits.acceleration)
    assert again.postures.keys() == arm.postures.keys()


def test_json_of_numpy_numbers():
    arm = load_arm("panda", locked_joints={"panda_joint1": np.float32(0.5)})
    assert json.loads(json.dumps(arm.description.to_json()))["locked_joints"]["panda_joint1"] == 0.5


@pytest.mark.parametrize("key", ["name", "urdf", "postures", "package_dirs", "acceleration"])
def test_json_with_a_key_missing(key):
    data = robot_description("two_link").to_json()
    del data[key]
    with pytest.raises(DensarmError, match=rf"robot description.*{key}"):
        RobotDescription.from_json(data)


@pytest.mark.parametrize("data", [{}, [], {"postures": 3}])
def test_other_json(data):
    with pytest.raises(DensarmError, match="robot description"):
        RobotDescription.from_json(data)
    whole = {**robot_description("two_link").to_json(), "colour": "red"}
    with pytest.raises(DensarmError, match=r"robot description.*colour"):
        RobotDescription.from_json(whole)


def test_catalogue():
    assert {"two_link", "panda"} <= set(robot_names())
    assert {"swing_up", "panda_table", "panda_shelf"} <= set(scenario_paths())
    for name in robot_names():
        assert (robots_folder() / name / "arm.toml").is_file()
        assert Arm(robot_description(name)).name == name
    with pytest.raises(UnknownNameError, match=r"'tow_link'; did you mean 'two_link'"):
        robot_description("tow_link")


def test_paths():
    share = data_wheel_folder()
    assert resolve_path("robot.urdf", Path("folder")) == Path("folder/robot.urdf")
    panda = resolve_path("example-robot-data:panda_description/urdf/panda.urdf", Path("folder"))
    assert panda.is_file()
    assert panda.is_relative_to(share)
    assert resolve_package_dir("example-robot-data") == str(share)
    assert resolve_package_dir("elsewhere") == "elsewhere"


def test_missing_wheel(monkeypatch):
    monkeypatch.setattr("densarm.robot.robot_description.DATA_WHEEL", "no-such-robot-data")
    with pytest.raises(RobotDescriptionError, match="pip install no-such-robot-data"):
        data_wheel_folder()


def test_text_files(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text('\ufeff<robot name="é"/>', encoding="utf-8")
    assert read_text(file) == '<robot name="é"/>'
    file.write_bytes(b"\xff")
    with pytest.raises(FileContentError, match="not a UTF-8 text file"):
        read_text(file)
    with pytest.raises(FileContentError, match="No such file"):
        read_text(tmp_path / "other")
    with pytest.raises(FileContentError, match="Is a directory"):
        read_text(tmp_path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_may_end_in_any_way(tmp_path, end):
    file = tmp_path / "robot.urdf"
    file.write_bytes(f"a{end}b{end}".encode())
    assert read_text(file) == "a\nb\n"


def test_endless_text_is_refused():
    with pytest.raises(FileContentError, match="larger than 20 MB"):
        read_text(Path("/dev/zero"))


def test_toml(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text("a = 1")
    assert read_toml(file) == {"a": 1}
    file.write_text("a = \n")
    with pytest.raises(FileContentError, match=r"arm.toml: not TOML: .*line 1"):
        read_toml(file)
    file.write_text(f"a = {'[' * 5000}{']' * 5000}")
    with pytest.raises(FileContentError, match="nested too deeply"):
        read_toml(file)


def test_xml():
    assert parse_robot_xml("<robot><link/></robot>", "URDF").find("link") is not None
    with pytest.raises(RobotDescriptionError, match="SRDF: not well-formed"):
        parse_robot_xml("robot", "SRDF")
    with pytest.raises(RobotDescriptionError, match="URDF: the root element is <sdf>"):
        parse_robot_xml("<sdf/>", "URDF")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"acceleration": (1.0,)}, r"acceleration = .*\(2,\), got \(1,\)"),
        ({"acceleration": (1.0, 0.0)}, "acceleration = 0.0: must be a finite number > 0"),
        ({"acceleration": (1.0, float("nan"))}, "acceleration = .*finite"),
        ({"end_effector": "hook"}, "unknown end-effector frame 'hook'"),
        ({"postures": {"odd": (1.0,)}}, r"angles = .*\(2,\), got \(1,\)"),
        ({"base_placement": (0.0,) * 7}, "base_placement orientation.*unit quaternion"),
        ({"base_placement": (0.0,) * 3}, r"base_placement = .*\(7,\), got \(3,\)"),
    ],
)
def test_wrong_descriptions(changes, message):
    with pytest.raises(DensarmError, match=message):
        Arm(replace(robot_description("two_link"), **changes))


def test_end_effector_defaults_to_the_last_link():
    assert Arm(replace(robot_description("two_link"), end_effector=None)).end_effector == "tip"
    assert load_arm(BRANCHING).end_effector == "tool"
