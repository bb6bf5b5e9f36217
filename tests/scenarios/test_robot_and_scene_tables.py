"""The robot and the scene of a scenario file."""

import json
from pathlib import Path

import numpy as np
import pytest

from densarm.certificates.task import Task
from densarm.errors import FileContentError
from densarm.scenarios.scenario import Scenario, load_scenario

FILE = "room\n* table\n1\nbox\n1 1 0.1\n0 0 -3\n0 0 0 1\n0 0 0 0\n.\n"
TASK = """
scene = "room.scene"
[robot]
name = "two_link"
[task]
start = "hanging"
goal = [1.0, 0.5]
[[obstacles]]
type = "sphere"
name = "ball"
radius = 0.1
position = [0.0, 3.0, 0.0]
[[obstacles]]
type = "box"
name = "bar"
size = [0.1, 0.1, 0.3]
attached_to = "lower_link"
touch_links = ["upper_link"]
mass = 0.2
"""


@pytest.fixture
def task(tmp_path: Path) -> Path:
    (tmp_path / "room.scene").write_text(FILE)
    path = tmp_path / "task.toml"
    path.write_text(TASK)
    return path


def test_scenario_takes_file_and_tables(task: Path) -> None:
    scenario = load_scenario(task)
    assert [item.name for item in scenario.scene] == ["table", "ball"]
    (bar,) = scenario.arm.description.attachments
    assert (bar.body.name, bar.link, bar.touch_links, bar.mass) == (
        "bar",
        "lower_link",
        ("upper_link",),
        0.2,
    )
    again = Scenario.of_task(Task.from_json(json.loads(json.dumps(scenario.task.to_json()))))
    assert (again.scene, again.arm.description) == (scenario.scene, scenario.arm.description)


def test_error_names_the_scene_file(task: Path) -> None:
    task.with_name("room.scene").write_text(FILE.replace("box", "bax"))
    with pytest.raises(FileContentError, match=r"room.scene: line 4: unknown shape"):
        load_scenario(task)


def test_robot_may_collide_as_drawn(task: Path) -> None:
    task.write_text(TASK.replace('"two_link"', "'two_link'\ncollision_from_visual = 'always'"))
    arm = load_scenario(task).arm
    links = {
        arm.model.frames[item.parentFrame].name for item in arm.collision_model.geometryObjects
    }
    assert "base" in links


def test_robot_may_have_limits_of_its_own(task: Path) -> None:
    own = "acceleration = [3, 4]\ntorque_rate = 500\njerk = [20, 30]\narmature = [0.1, 0]"
    task.write_text(TASK.replace('"two_link"', f"'two_link'\n{own}"))
    arm = load_scenario(task).arm
    np.testing.assert_array_equal(arm.model.armature, [0.1, 0.0])
    limits = arm.limits
    np.testing.assert_array_equal(limits.acceleration, [3.0, 4.0])
    np.testing.assert_array_equal(limits.torque_rate, [500.0, 500.0])
    np.testing.assert_array_equal(limits.jerk, [20.0, 30.0])
    task.write_text(TASK.replace('"two_link"', "'two_link'\njerk = 0"))
    with pytest.raises(FileContentError, match=r"jerk = 0.0: must be a finite number > 0"):
        load_scenario(task)


def test_jerk_may_be_limited_in_a_scenario(task: Path) -> None:
    text = task.read_text()
    task.write_text(text + "[timing]\njerk = 500\n")
    scenario = load_scenario(task)
    assert scenario.timing.jerk == 500.0
    again = Scenario.of_task(Task.from_json(json.loads(json.dumps(scenario.task.to_json()))))
    assert again.timing == scenario.timing
    task.write_text(text + "[timing]\njerk = -1.0\n")
    with pytest.raises(FileContentError, match=r"jerk = -1.0: must be a finite number > 0"):
        load_scenario(task)


def test_a_date_is_refused_by_its_key(task: Path) -> None:
    task.write_text(TASK.replace('"two_link"', "1979-05-27"))
    with pytest.raises(FileContentError, match=r"robot.name = datetime.date.*: must be a string"):
        load_scenario(task)
