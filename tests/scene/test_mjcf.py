"""Obstacles out of MJCF files."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from densarm.errors import DensarmError, FileContentError
from densarm.scene.loading import load_scene, parse_scene
from densarm.scene.mesh import Mesh
from densarm.scene.mjcf import xml_root
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere, obstacle_pose
from densarm.scene.scene import Scene

mujoco = pytest.importorskip("mujoco")

FILE = Path(__file__).parents[1] / "data/arm_and_table.xml"


def test_what_is_no_part_of_the_arm() -> None:
    """Planes, static and free bodies, where MuJoCo has them; what touches nothing is left out."""
    scene = load_scene(FILE)
    kinds = {item.name: type(item) for item in scene}
    assert kinds == {
        "floor": HalfSpace,
        "table.0": Box,
        "table.1": Cylinder,
        "wedge": Mesh,
        "ball": Sphere,
    }
    model = mujoco.MjModel.from_xml_path(str(FILE))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    named = {"floor": "floor", "wedge": "wedge"}
    for obstacle in scene:
        body = obstacle.name.partition(".")[0]
        geom = data.geom(
            named.get(obstacle.name)
            or int(model.body(body).geomadr[0]) + int(obstacle.name.partition(".")[2] or 0)
        )
        pose = obstacle_pose(obstacle)
        np.testing.assert_allclose(pose.translation, geom.xpos, atol=1e-12)
        np.testing.assert_allclose(pose.rotation.ravel(), geom.xmat, atol=1e-12)
    box, cylinder, ball = scene.obstacles[1], scene.obstacles[2], scene.obstacles[4]
    assert isinstance(box, Box)
    assert box.size == (0.4, 0.6, 0.04)
    assert isinstance(cylinder, Cylinder)
    assert (cylinder.radius, cylinder.length) == (0.03, 0.2)
    assert isinstance(ball, Sphere)
    assert ball.radius == 0.06


def test_a_mesh_is_where_its_file_says() -> None:
    """By scale, refpos and refquat of its asset, and position and angles of its geom."""
    wedge = next(item for item in load_scene(FILE) if item.name == "wedge")
    assert isinstance(wedge, Mesh)
    corners = np.array([(0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), (0, 0, 0.15)])
    reference = pin.Quaternion(0.9, 0.1, 0.3, 0.2).normalized().matrix()
    own = 1.5 * (corners - [0.01, 0.02, 0.0]) @ reference
    turns = [
        pin.exp3(np.radians(angle) * axis)
        for angle, axis in zip((10, 20, 30), np.eye(3), strict=True)
    ]
    geom = pin.SE3(turns[2] @ turns[1] @ turns[0], np.array([0.0, 0.1, 0.1]))
    table = pin.SE3(pin.exp3(np.array([0, 0, np.radians(30)])), np.array([0.6, 0, 0.2]))
    expected = np.array([(table * geom).act(corner) for corner in own])
    found = np.array([obstacle_pose(wedge).act(np.array(x)) for x in wedge.pieces[0]])
    off = np.linalg.norm(found[:, np.newaxis] - expected, axis=2)
    assert off.shape == (4, 4)
    assert off.min(axis=1).max() < 1e-7
    assert off.min(axis=0).max() < 1e-7


def test_names_of_what_has_none(tmp_path: Path) -> None:
    """Those of bodies, with numbers, and never one that another geom has."""
    text = """<mujoco><worldbody><geom size="1"/><geom type="capsule" size="0.1 0.2"/>
    <body name="a"><geom size="1"/></body><body name="b"><geom name="a" size="1"/></body>
    </worldbody></mujoco>"""
    (tmp_path / "room.xml").write_text(text)
    scene = parse_scene(tmp_path, "room.xml", [])
    assert [item.name for item in scene] == ["world.0", "world.1", "a_", "a"]
    capsule = scene.obstacles[1]
    assert isinstance(capsule, Capsule)
    assert (capsule.radius, capsule.length) == (0.1, 0.4)
    assert isinstance(scene, Scene)


@pytest.mark.parametrize(
    ("geom", "message"),
    [
        (
            '<geom name="egg" type="ellipsoid" size="1 2 3"/>',
            r"geom 'egg' is of the type ellipsoid: ",
        ),
        ('<geom type="box" size="1"/>', r"room.xml: .*size"),
        ('<geom size="2000"/>', r"geom 0 of body 'world': world.radius = 2000.*at most 1000 m"),
    ],
)
def test_wrong_files(tmp_path: Path, geom: str, message: str) -> None:
    file = tmp_path / "room.xml"
    file.write_text(f"<mujoco><worldbody>{geom}</worldbody></mujoco>")
    with pytest.raises(FileContentError, match=message) as caught:
        load_scene(file)
    assert "\n" not in str(caught.value)


def test_without_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(DensarmError, match=r"arm_and_table.xml needs MuJoCo, .* pip install"):
        load_scene(FILE)


@pytest.mark.parametrize(
    ("text", "root"),
    [
        ("<?xml version='1.0'?>\n<!-- <robot> --><mujoco model='a'/>", "mujoco"),
        ("<!DOCTYPE sdf>\n<sdf version='1.9'>", "sdf"),
        ("<robot><mujoco/></robot>", "robot"),
        ("words", ""),
    ],
)
def test_root_of_a_file(text: str, root: str) -> None:
    assert xml_root(text) == root
