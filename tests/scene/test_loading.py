"""The scene of a scenario file: tables, another file, or both."""

from pathlib import Path

import pytest

from densarm.errors import FileContentError, InvalidValueError
from densarm.scene.loading import parse_scene
from densarm.scene.obstacles import Box
from densarm.scene.scene import Attachment

FILE = "room\n* table\n1\nbox\n1 1 0.1\n0 0 -3\n0 0 0 1\n0 0 0 0\n.\n"
BALL = {"type": "sphere", "name": "ball", "radius": 0.1, "position": [0.0, 3.0, 0.0]}
BAR = {"type": "box", "name": "bar", "size": [0.1, 0.1, 0.3]}
HELD = {"attached_to": "lower_link", "touch_links": ["upper_link"], "mass": 0.2}


def test_file_and_tables(tmp_path: Path) -> None:
    (tmp_path / "room.scene").write_text(FILE)
    scene = parse_scene(tmp_path, "room.scene", [BALL, {**BAR, **HELD}])
    assert [item.name for item in scene] == ["table", "ball"]
    bar = Box(name="bar", size=(0.1, 0.1, 0.3))
    assert scene.attachments == (Attachment(bar, "lower_link", ("upper_link",), 0.2),)


def test_error_names_the_scene_file(tmp_path: Path) -> None:
    (tmp_path / "room.scene").write_text(FILE.replace("box", "bax"))
    with pytest.raises(FileContentError, match=r"room.scene: line 4: unknown shape"):
        parse_scene(tmp_path, "room.scene", [])


def test_wrong_tables(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match="scene = 3: must be the path of a scene file"):
        parse_scene(tmp_path, 3, [])
    with pytest.raises(InvalidValueError, match=r"obstacles = {}: must be a list of tables"):
        parse_scene(tmp_path, "", {})
