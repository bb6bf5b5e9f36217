"""Obstacles out of SDFormat worlds."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from densarm.errors import FileContentError
from densarm.scene.loading import load_scene
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere, obstacle_pose
from densarm.scene.scene import Scene

WEDGE = Path(__file__).parents[1] / "data/meshes/wedge.obj"

WORLD = """<?xml version="1.0"?>
<sdf version="1.9">
  <world name="room">
    <model name="floor"><static>true</static><link name="l"><collision name="c">
      <geometry><plane><normal>0 0 2</normal><size>9 9</size></plane></geometry></collision></link>
    </model>
    <frame name="corner"><pose>1 2 0 0 0 1.5707963267948966</pose></frame>
    <model name="table">
      <pose relative_to="corner">0.5 0 0 0 0 0</pose>
      <link name="top">
        <pose degrees="true">0 0 0.7 0 0 90</pose>
        <collision name="plate"><geometry><box><size>1 0.5 0.02</size></box></geometry></collision>
        <collision name="rim"><pose>0.1 0 0 0 0 0</pose>
          <geometry><sphere><radius>0.05</radius></sphere></geometry></collision>
        <visual name="v"><geometry><box><size>9 9 9</size></box></geometry></visual>
      </link>
      <link name="leg">
        <pose relative_to="top">0 0 -0.35 0 0 0</pose>
        <collision name="c">
          <geometry><cylinder><radius>0.03</radius><length>0.7</length></cylinder></geometry>
        </collision>
      </link>
      <model name="lamp">
        <pose rotation_format="quat_xyzw">0 0 1 0 0 0.7071067811865476 0.7071067811865476</pose>
        <link name="l"><collision name="c"><geometry>
          <capsule><radius>0.02</radius><length>0.3</length></capsule></geometry></collision></link>
      </model>
    </model>
    <include><uri>model://wedge</uri><name>part</name><pose>0 0 5 0 0 0</pose></include>
  </world>
</sdf>
"""
PART = """<sdf version="1.9"><model name="wedge"><pose>7 7 7 0 0 0</pose><link name="l">
<collision name="c"><geometry><mesh><uri>meshes/wedge.obj</uri><scale>2 2 2</scale></mesh>
</geometry></collision></link></model></sdf>"""


def read(folder: Path, text: str, part: str = PART) -> Scene:
    (folder / "wedge/meshes").mkdir(parents=True, exist_ok=True)
    shutil.copy(WEDGE, folder / "wedge/meshes")
    (folder / "wedge/model.sdf").write_text(part)
    (folder / "worlds").mkdir(exist_ok=True)
    (folder / "worlds/room.sdf").write_text(text)
    return load_scene(folder / "worlds/room.sdf")


def test_what_collides(tmp_path: Path) -> None:
    """Poses compose through frames, links and models in models; what is drawn alone is left out."""
    scene = {item.name: item for item in read(tmp_path, WORLD)}
    expected = {
        "floor": (HalfSpace, (0, 0, 0), 0),
        "table.0": (Box, (1, 2.5, 0.7), 180),
        "table.1": (Sphere, (0.9, 2.5, 0.7), 0),
        "table.2": (Cylinder, (1, 2.5, 0.35), 180),
        "table::lamp": (Capsule, (1, 2.5, 1), 180),
        "part": (Mesh, (0, 0, 5), 0),
    }
    assert {name: type(item) for name, item in scene.items()} == {
        name: kind for name, (kind, _, _) in expected.items()
    }
    for name, (_, position, turn) in expected.items():
        pose, half = obstacle_pose(scene[name]), np.radians(turn)
        np.testing.assert_allclose(pose.translation, position, atol=1e-12)
        along = [np.cos(half), np.sin(half), 0.0]
        np.testing.assert_allclose(pose.rotation[:, 0], along, atol=1e-12)
    box, leg, lamp, part = (scene[x] for x in ("table.0", "table.2", "table::lamp", "part"))
    assert isinstance(box, Box)
    assert box.size == (1.0, 0.5, 0.02)
    assert isinstance(leg, Cylinder)
    assert (leg.radius, leg.length) == (0.03, 0.7)
    assert isinstance(lamp, Capsule)
    assert (lamp.radius, lamp.length) == (0.02, 0.3)
    assert isinstance(part, Mesh)
    np.testing.assert_allclose(np.array(part.pieces[0]).max(axis=0), [0.6, 0.4, 0.3])


def test_models_alone(tmp_path: Path) -> None:
    """A file of a model, where it is without what includes it; Gazebo's folders are looked in."""
    file = tmp_path / "wedge.sdf"
    file.write_text(PART.replace("meshes/wedge.obj", WEDGE.as_uri()))
    (part,) = load_scene(file)
    assert part.name == "wedge"
    assert part.position == (7.0, 7.0, 7.0)


def test_folders_of_gazebo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "models/meshes").mkdir(parents=True)
    shutil.copy(WEDGE, tmp_path / "models/meshes")
    file = tmp_path / "a/b/wedge.sdf"
    file.write_text(PART)
    with pytest.raises(FileContentError, match=r"uri = 'meshes/wedge.obj': must be a file beside"):
        load_scene(file)
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", f"/none:{tmp_path}/models")
    assert len(load_scene(file)) == 1


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<box>", "<heightmap>", "not well-formed XML .*line"),
        (
            "<sphere><radius>0.05</radius></sphere>",
            "<heightmap/>",
            "model 'table', link 'top', collision 'rim': <heightmap> has no place here: use one of",
        ),
        ("<radius>0.05</radius>", "", "collision 'rim': sizes of sphere 'table.1' = .*1 numbers"),
        ("<size>1 0.5 0.02</size>", "<size>1 a 2</size>", "collision 'plate': size = '1 a 2'"),
        ('relative_to="top"', 'relative_to="tip"', "model 'table': relative_to = 'tip': must be"),
        ('relative_to="top"', 'relative_to="leg"', "model 'table': relative_to = 'leg': .*circle"),
        ("0 0 5 0 0 0", "0 0 5 0 0", r"pose = \[0.0, 0.0, 5.0, 0.0, 0.0\]: must be"),
        ("model://wedge", "https://fuel.gazebosim.org/x", "uri = 'https.*must be a file beside"),
        ("<sdf version", "<sdfs><sdf version", "not well-formed"),
        ('name="lamp"', 'name="lamp" placement_frame="l"', "placement_frame = 'l': must be left"),
    ],
)
def test_wrong_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in WORLD
    with pytest.raises(FileContentError, match=message) as caught:
        read(tmp_path, WORLD.replace(old, new))
    assert "room.sdf: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_wrong_files_that_are_included(tmp_path: Path) -> None:
    with pytest.raises(
        FileContentError, match=r"model.sdf: the root element is <mujoco>, not <sdf"
    ):
        read(tmp_path, WORLD, "<mujoco/>")
    with pytest.raises(FileContentError, match=r"model.sdf: no <model> in it"):
        read(tmp_path, WORLD, "<sdf/>")
    with pytest.raises(FileContentError, match=r"model 'part', link 'l', .*uri = 'meshes/no.obj'"):
        read(tmp_path, WORLD, PART.replace("wedge.obj", "no.obj"))
    loop = PART.replace("<link", "<include><uri>model://wedge</uri></include><link")
    with pytest.raises(FileContentError, match="nested more than 16 deep"):
        read(tmp_path, WORLD, loop)
