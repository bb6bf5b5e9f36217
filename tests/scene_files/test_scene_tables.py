"""The scene of a scenario file: tables, another file, or both."""

import pytest

from densarm.errors import FileContentError, InvalidValueError
from densarm.scenario import Scenario, load_scenario
from densarm.scene_files.scene_tables import parse_scene

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
def task(tmp_path):
    (tmp_path / "room.scene").write_text(FILE)
    path = tmp_path / "task.toml"
    path.write_text(TASK)
    return path


def test_scenario_takes_file_and_tables(task):
    scenario = load_scenario(task)
    assert [item.name for item in scenario.scene] == ["table", "ball"]
    (bar,) = scenario.arm.description.attachments
    assert (bar.body.name, bar.link, bar.touch_links, bar.mass) == (
        "bar",
        "lower_link",
        ("upper_link",),
        0.2,
    )
    again = Scenario.from_json(scenario.to_json())
    assert (again.scene, again.arm.description) == (scenario.scene, scenario.arm.description)


def test_error_names_the_scene_file(task):
    task.with_name("room.scene").write_text(FILE.replace("box", "bax"))
    with pytest.raises(FileContentError, match=r"room.scene: line 4: unknown shape"):
        load_scenario(task)


def test_wrong_tables(tmp_path):
    with pytest.raises(InvalidValueError, match="scene = 3: must be the path of a scene file"):
        parse_scene(tmp_path, 3, [])
    with pytest.raises(InvalidValueError, match=r"obstacles = {}: must be a list of tables"):
        parse_scene(tmp_path, "", {})
