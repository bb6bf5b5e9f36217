"""Descriptions as data: JSON form, files and folders that they name."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.catalogue import robot_description
from densarm.arms.description import (
    RobotDescription,
    data_wheel_folder,
    parse_robot_xml,
    resolve_path,
)
from densarm.errors import DensarmError, RobotDescriptionError

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"


@pytest.mark.parametrize("shapes", ["hull", pytest.param("capsule", marks=pytest.mark.slow)])
def test_json_rebuilds_the_arm(shapes: str) -> None:
    arm = load_arm("panda", locked_joints={"panda_joint1": 0.5}, shapes=shapes)
    data = json.loads(json.dumps(arm.description.to_json()))
    description = RobotDescription.from_json(data)
    assert description == arm.description
    again = Arm(description)
    assert again.mesh_hashes() == arm.mesh_hashes()
    for name in ("acceleration", "torque_rate", "jerk"):
        np.testing.assert_array_equal(getattr(again.limits, name), getattr(arm.limits, name))
    assert again.postures.keys() == arm.postures.keys()


def test_json_of_numpy_numbers() -> None:
    locked: Any = {"panda_joint1": np.float32(0.5)}
    arm = load_arm("panda", locked_joints=locked)
    assert json.loads(json.dumps(arm.description.to_json()))["locked_joints"]["panda_joint1"] == 0.5


@pytest.mark.parametrize("key", ["name", "urdf", "postures", "package_dirs", "acceleration"])
def test_json_with_a_key_missing(key: str) -> None:
    data = robot_description("two_link").to_json()
    del data[key]
    with pytest.raises(DensarmError, match=rf"robot description.*{key}"):
        RobotDescription.from_json(data)


def test_json_from_before_there_were_limits_of_jerk_and_torque_rate() -> None:
    data = robot_description("panda").to_json()
    del data["jerk"], data["torque_rate"]
    limits = Arm(RobotDescription.from_json(data)).limits
    assert np.isinf([limits.jerk, limits.torque_rate]).all()


@pytest.mark.parametrize("data", [{}, [], {"postures": 3}])
def test_other_json(data: Any) -> None:
    with pytest.raises(DensarmError, match="robot description"):
        RobotDescription.from_json(data)
    whole = {**robot_description("two_link").to_json(), "colour": "red"}
    with pytest.raises(DensarmError, match=r"robot description.*colour"):
        RobotDescription.from_json(whole)


def test_paths() -> None:
    assert resolve_path("robot.urdf", Path("folder")) == Path("folder/robot.urdf")
    panda = resolve_path("example-robot-data:panda_description/urdf/panda.urdf", Path("folder"))
    assert panda.is_file()
    assert panda.is_relative_to(data_wheel_folder())


def test_missing_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("densarm.arms.description.DATA_WHEEL", "no-such-robot-data")
    with pytest.raises(RobotDescriptionError, match="pip install no-such-robot-data"):
        data_wheel_folder()


def test_xml() -> None:
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
        ({"jerk": (1.0,)}, r"jerk = .*\(2,\), got \(1,\)"),
        ({"jerk": -1.0}, "jerk = -1.0: must be a finite number > 0"),
        ({"armature": (0.1, -0.1)}, "armature = -0.1: must be a finite number >= 0"),
        ({"torque_rate": "fast"}, "torque_rate = .*: must be 2 numbers"),
        ({"torque_rate": (1.0, float("inf"))}, "torque_rate = .*finite"),
        ({"end_effector": "hook"}, "unknown end-effector frame 'hook'"),
        ({"postures": {"odd": (1.0,)}}, r"angles = .*\(2,\), got \(1,\)"),
        ({"base_placement": (0.0,) * 7}, "base_placement orientation.*unit quaternion"),
        ({"base_placement": (0.0,) * 3}, r"base_placement = .*\(7,\), got \(3,\)"),
    ],
)
def test_wrong_descriptions(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(DensarmError, match=message):
        Arm(replace(robot_description("two_link"), **changes))


def test_end_effector_defaults_to_the_last_link() -> None:
    assert Arm(replace(robot_description("two_link"), end_effector=None)).end_effector == "tip"
    assert load_arm(BRANCHING).end_effector == "tool"
