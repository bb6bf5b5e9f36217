"""Obstacles: values that are checked when made, and the shapes that they stand for."""

import copy
import json
import pickle
from collections.abc import Callable, Sequence
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.errors import InvalidValueError
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Obstacle,
    Sphere,
    geometry_objects,
    obstacle_pose,
)
from densarm.scene.scene import OBSTACLE_TYPES, Scene

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
def test_json_is_exact(obstacle: Obstacle) -> None:
    scene = Scene([obstacle])
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene


@given(obstacle=OBSTACLE)
def test_pose(obstacle: Obstacle) -> None:
    pose = obstacle_pose(obstacle)
    np.testing.assert_array_equal(pose.translation, obstacle.position)
    x, y, z, w = obstacle.orientation_xyzw
    point = np.array([0.3, -0.2, 0.9])
    axis = np.array([x, y, z])
    turned = point + 2 * np.cross(axis, np.cross(axis, point) + w * point)
    np.testing.assert_allclose(pose.rotation @ point, turned, atol=1e-12)


def test_shapes() -> None:
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


def test_shapes_of_one_body_are_numbered() -> None:
    body = Mesh(name="mug", pieces=(TETRAHEDRON, TETRAHEDRON), position=(1, 2, 3))
    items = geometry_objects(body)
    assert [item.name for item in items] == ["mug.0", "mug.1"]
    np.testing.assert_array_equal(items[1].placement.translation, (1, 2, 3))
    assert [item.name for item in geometry_objects(Sphere(name="ball", radius=1))] == ["ball"]


def test_obstacles_are_frozen_and_compared_by_value() -> None:
    ball = Sphere(name="ball", radius=0.1, position=[0, 0, 1])
    assert ball == Sphere(name="ball", radius=0.1, position=(0, 0, 1))
    assert len({ball, Sphere(name="ball", radius=0.1, position=(0, 0, 1))}) == 1
    with pytest.raises(AttributeError):
        ball.radius = 0.2  # type: ignore[misc]


def test_nearly_unit_quaternion_is_scaled() -> None:
    turned = Box(name="a", size=(1, 1, 1), orientation_xyzw=(0, 0, 0.7071, 0.7071))
    assert np.linalg.norm(turned.orientation_xyzw) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("value", [0, -0.1, np.nan, np.inf, "big", None, True])
@pytest.mark.parametrize(
    ("kind", "key"),
    [("sphere", "radius"), ("capsule", "radius"), ("capsule", "length"), ("cylinder", "length")],
)
def test_sizes_are_positive(kind: str, key: str, value: Any) -> None:
    fields = {"sphere": {"radius": 1}}.get(kind, {"radius": 1, "length": 1})
    with pytest.raises(InvalidValueError, match=rf"ball.{key} = .*must be a finite number > 0"):
        OBSTACLE_TYPES[kind](name="ball", **{**fields, key: value})


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("sphere", {"radius": 1e4}),
        ("capsule", {"radius": 0.1, "length": 1e4}),
        ("cylinder", {"radius": 0.1, "length": 1e4}),
        ("cylinder", {"radius": 1.0, "length": 1e-9}),
    ],
)
def test_what_is_too_large_or_flat_is_refused_by_name(kind: str, fields: dict[str, Any]) -> None:
    with pytest.raises(InvalidValueError, match=r"it\..* = .*: must be at most 1000 m"):
        OBSTACLE_TYPES[kind](name="it", **fields)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"size": (1, 0, 1)}, r"table.size = 0.0: must be a finite number > 0"),
        ({"size": (1, 1)}, r"table.size = \(1, 1\): must be of shape \(3,\), got \(2,\)"),
        ({"size": (1, 1, "1")}, r"table.size = .*must be 3 numbers"),
        ({"position": (0, np.nan, 0)}, r"table.position = .*finite"),
        ({"size": (1, 1e-9, 1)}, r"table.size = .*, each above 1 nm and a millionth of"),
        ({"size": (1e-320, 1e-320, 1e-320)}, r"table.size = .*, each above 1 nm"),
        ({"size": (1, 2e3, 1)}, r"table.size = .*must be at most 1000 m"),
        ({"size": (1e6, 1e6, 1e6)}, r"table.size = .*must be at most 1000 m"),
        ({"position": (0, -1e6, 0)}, r"table.position = .*less than 1000 km away"),
        ({"position": 1.0}, r"table.position = 1.0: must be of shape \(3,\), got \(\)"),
        ({"position": [[0, 0], [0]]}, r"table.position = .*3 numbers"),
        ({"orientation_xyzw": (0, 0, 0, 0)}, r"table.orientation_xyzw = .*unit quaternion"),
        ({"orientation_xyzw": (1, 1, 1, 1)}, r"table.orientation_xyzw = .*unit quaternion"),
        ({"orientation_xyzw": (0, 0, 0)}, r"table.orientation_xyzw = .*\(4,\), got \(3,\)"),
        ({"name": ""}, "obstacle name = '': must be a non-empty string"),
        ({"name": 3}, "obstacle name = 3: must be a non-empty string"),
    ],
)
def test_wrong_boxes(fields: dict[str, Any], message: str) -> None:
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
        ({"offset": 1e6}, "floor.offset = 1000000.0: must be less than 1000 km away"),
        ({"offset": "0"}, "floor.offset = '0': must be a finite number"),
    ],
)
def test_wrong_half_spaces(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        HalfSpace(**{"name": "floor", **fields})


@given(obstacle=OBSTACLE)
def test_copies_are_equal(obstacle: Obstacle) -> None:
    for again in (copy.deepcopy(obstacle), pickle.loads(pickle.dumps(obstacle))):
        assert (again, hash(again)) == (obstacle, hash(obstacle))


@pytest.mark.parametrize("form", [list, tuple, np.array])
def test_vectors_may_be_of_any_form(form: Callable[[Sequence[Any]], Any]) -> None:
    box = Box(name="a", size=form([1, 2, 3]), position=form([0.5, 0, 1]))
    assert (box.size, box.position) == ((1.0, 2.0, 3.0), (0.5, 0.0, 1.0))
    assert HalfSpace(name="a", normal=form([0, 0, 2])).normal == (0.0, 0.0, 1.0)
    corners = form([form(corner) for corner in TETRAHEDRON])
    mesh = Mesh(name="a", pieces=form([corners]), scale=form([1, 1, 1]))
    assert mesh == Mesh(name="a", pieces=(TETRAHEDRON,))
