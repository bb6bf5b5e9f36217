"""Obstacles: values that are checked when made, and their JSON form."""

import json

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.errors import DensarmError, InvalidValueError
from densarm.obstacles import geometry_objects
from densarm.scene import (
    OBSTACLE_TYPES,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    Scene,
    Sphere,
    obstacle_pose,
)

SIZE = st.floats(1e-3, 10.0)
POSITION = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
QUATERNION = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda v: np.linalg.norm(v) > 0.1)
    .map(lambda v: tuple((np.array(v) / np.linalg.norm(v)).tolist()))
)
POSE = {"name": st.just("it"), "position": POSITION, "orientation_xyzw": QUATERNION}
DIRECTION = QUATERNION.map(lambda v: v[:3]).filter(lambda v: np.linalg.norm(v) > 1e-3)
TETRAHEDRON = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
PIECE = POSITION.map(lambda at: tuple(tuple(np.add(at, corner).tolist()) for corner in TETRAHEDRON))
OBSTACLE = st.one_of(
    st.builds(Sphere, radius=SIZE, **POSE),
    st.builds(Box, size=st.tuples(SIZE, SIZE, SIZE), **POSE),
    st.builds(Capsule, radius=SIZE, length=SIZE, **POSE),
    st.builds(Cylinder, radius=SIZE, length=SIZE, **POSE),
    st.builds(HalfSpace, normal=DIRECTION, offset=st.floats(-10.0, 10.0), **POSE),
    st.builds(Mesh, pieces=st.lists(PIECE, min_size=1, max_size=3), **POSE),
)


@given(obstacle=OBSTACLE)
def test_json_is_exact(obstacle):
    scene = Scene([obstacle])
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene


def test_json_takes_numpy_numbers():
    scene = Scene(
        [
            Sphere(name="a", radius=np.float32(0.5), position=np.zeros(3)),
            Box(name="b", size=np.arange(1, 4), position=[1, 2, 3]),
        ]
    )
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene
    assert scene.obstacles[1].size == (1.0, 2.0, 3.0)


@given(obstacle=OBSTACLE)
def test_pose(obstacle):
    pose = obstacle_pose(obstacle)
    np.testing.assert_array_equal(pose.translation, obstacle.position)
    x, y, z, w = obstacle.orientation_xyzw
    point = np.array([0.3, -0.2, 0.9])
    axis = np.array([x, y, z])
    turned = point + 2 * np.cross(axis, np.cross(axis, point) + w * point)
    np.testing.assert_allclose(pose.rotation @ point, turned, atol=1e-12)


def test_shapes():
    (ball,) = Sphere(name="a", radius=0.3).convex_shapes()
    assert ball.radius == 0.3
    (box,) = Box(name="a", size=(1, 2, 3)).convex_shapes()
    assert {tuple(np.abs(corner)) for corner in box.points()} == {(0.5, 1.0, 1.5)}
    assert len(box.points()) == 8
    (capsule,) = Capsule(name="a", radius=0.1, length=0.4).convex_shapes()
    assert (capsule.radius, capsule.halfLength) == (0.1, 0.2)
    (cylinder,) = Cylinder(name="a", radius=0.1, length=0.4).convex_shapes()
    assert isinstance(cylinder, coal.ConvexBase)
    (wall,) = HalfSpace(name="a", normal=(0, 2, 0), offset=0.5).convex_shapes()
    assert (wall.n.tolist(), wall.d) == ([0.0, 1.0, 0.0], 0.5)
    assert len(Mesh(name="a", pieces=(TETRAHEDRON, TETRAHEDRON)).convex_shapes()) == 2


def test_shapes_of_one_body_are_numbered():
    body = Mesh(name="mug", pieces=(TETRAHEDRON, TETRAHEDRON), position=(1, 2, 3))
    items = geometry_objects(body)
    assert [item.name for item in items] == ["mug.0", "mug.1"]
    np.testing.assert_array_equal(items[1].placement.translation, (1, 2, 3))
    assert [item.name for item in geometry_objects(Sphere(name="ball", radius=1))] == ["ball"]


def test_obstacles_are_frozen_and_compared_by_value():
    ball = Sphere(name="ball", radius=0.1, position=[0, 0, 1])
    assert ball == Sphere(name="ball", radius=0.1, position=(0, 0, 1))
    assert len({ball, Sphere(name="ball", radius=0.1, position=(0, 0, 1))}) == 1
    with pytest.raises(AttributeError):
        ball.radius = 0.2


def test_nearly_unit_quaternion_is_scaled():
    turned = Box(name="a", size=(1, 1, 1), orientation_xyzw=(0, 0, 0.7071, 0.7071))
    assert np.linalg.norm(turned.orientation_xyzw) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("value", [0, -0.1, np.nan, np.inf, "big", None, True])
@pytest.mark.parametrize(
    ("kind", "key"),
    [("sphere", "radius"), ("capsule", "radius"), ("capsule", "length"), ("cylinder", "length")],
)
def test_sizes_are_positive(kind, key, value):
    fields = {"sphere": {"radius": 1}}.get(kind, {"radius": 1, "length": 1})
    with pytest.raises(InvalidValueError, match=rf"ball.{key} = .*must be a finite number > 0"):
        OBSTACLE_TYPES[kind](name="ball", **{**fields, key: value})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"size": (1, 0, 1)}, r"table.size = 0.0: must be a finite number > 0"),
        ({"size": (1, 1)}, r"table.size = \(1, 1\): must be of shape \(3,\), got \(2,\)"),
        ({"size": (1, 1, "1")}, r"table.size = .*must be 3 numbers"),
        ({"position": (0, np.nan, 0)}, r"table.position = .*finite"),
        ({"position": 1.0}, r"table.position = 1.0: must be of shape \(3,\), got \(\)"),
        ({"position": [[0, 0], [0]]}, r"table.position = .*3 numbers"),
        ({"orientation_xyzw": (0, 0, 0, 0)}, r"table.orientation_xyzw = .*unit quaternion"),
        ({"orientation_xyzw": (1, 1, 1, 1)}, r"table.orientation_xyzw = .*unit quaternion"),
        ({"orientation_xyzw": (0, 0, 0)}, r"table.orientation_xyzw = .*\(4,\), got \(3,\)"),
        ({"name": ""}, "obstacle name = '': must be a non-empty string"),
        ({"name": 3}, "obstacle name = 3: must be a non-empty string"),
    ],
)
def test_wrong_boxes(fields, message):
    with pytest.raises(InvalidValueError, match=message) as raised:
        Box(**{"name": "table", "size": (1, 1, 1), **fields})
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"normal": (0, 0, 0)}, r"floor.normal = \(0, 0, 0\): must be a direction, not zero"),
        ({"normal": (0, 1)}, r"floor.normal = .*\(3,\), got \(2,\)"),
        ({"offset": np.inf}, "floor.offset = inf: must be a finite number"),
        ({"offset": 10**400}, "floor.offset = 1000.*: must be a finite number"),
        ({"offset": "0"}, "floor.offset = '0': must be a finite number"),
    ],
)
def test_wrong_half_spaces(fields, message):
    with pytest.raises(InvalidValueError, match=message):
        HalfSpace(**{"name": "floor", **fields})


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([{"type": "ball", "name": "a"}], r"unknown type of obstacle a 'ball'.*known: box, caps"),
        ([{"name": "a"}], "unknown type of obstacle a 'None'"),
        ([{"type": ["box"], "name": "a"}], "unknown type of obstacle a"),
        ([{"type": "box", "name": "a"}], r"obstacle a.size = None: must be given for a box"),
        ([{"type": "sphere", "radius": 1}], "name = None: must be given"),
        (
            [{"type": "sphere", "name": "a", "radius": 1, "colour": "red"}],
            r"unknown key of obstacle a \(sphere\) 'colour'.*known: name, orientation",
        ),
        (["box"], "obstacle = 'box': must be a table"),
        ([{"type": "sphere", "name": "a", "radius": 1}] * 2, "obstacle name = 'a': must be used"),
    ],
)
def test_wrong_json(entries, message):
    with pytest.raises(DensarmError, match=message):
        Scene.from_json(entries)


def test_scene_takes_obstacles_alone():
    with pytest.raises(InvalidValueError, match="one of Sphere, Box, Capsule, Cylinder"):
        Scene(["ball"])
    assert len(Scene()) == 0
