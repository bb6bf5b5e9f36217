"""MoveIt's text format: what a writer of it wrote is read back, and anything else is one error."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.errors import DensarmError, FileContentError
from densarm.scene.loading import load_scene
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import Box, Cylinder, HalfSpace, Sphere
from densarm.scene.scene import Scene

SIZE = st.floats(1e-3, 10.0)
SHAPE = st.one_of(
    st.tuples(st.just("sphere"), st.tuples(SIZE)),
    st.tuples(st.just("box"), st.tuples(SIZE, SIZE, SIZE)),
    st.tuples(st.just("cylinder"), st.tuples(SIZE, SIZE)),
    st.tuples(st.just("plane"), st.tuples(SIZE, SIZE, SIZE, st.floats(-5, 5))),
)
QUATERNION = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda v: np.linalg.norm(v) > 0.1)
    .map(lambda v: np.array(v) / np.linalg.norm(v))
)
POSE = st.builds(
    lambda at, turn: pin.XYZQUATToSE3(np.array([*at, *turn])),
    st.tuples(*[st.floats(-5.0, 5.0)] * 3),
    QUATERNION,
)
OBJECT = st.tuples(POSE, st.lists(st.tuples(SHAPE, POSE), max_size=3))
OBJECTS = st.dictionaries(
    st.text("abcXYZ_-09 ", min_size=1).map(lambda name: f"o{name}o"), OBJECT, max_size=3
)

Shape = tuple[tuple[str, tuple[float, ...]], pin.SE3]  # kind, sizes, pose
Objects = dict[str, tuple[pin.SE3, list[Shape]]]

OLD = """(noname)
* table top
1
box
1 2 0.1
0.5 0 0.2
0 0 0 1
0 0 0 0
* ball
2
sphere
0.1
0 0 1
0 0 0 1
1 0 0 1
cylinder
0.2
0.3
0 1 1
0 0 0 1
0 0 0 0
.
"""
NEW = """(noname)+
* wedge
1 2 3
0 0 0.7071067811865476 0.7071067811865476
1
mesh
5 4
0 0 0
1 0 0
0 1 0
0 0 1
0.1 0.1 0.1
0 1 2
0 1 3
0 2 3
1 2 3
0 0 1
0 0 0 1
0.5 0.5 0.5 1
1
tip
0 0 1
0 0 0 1
.
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes")


def numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def pose_lines(pose: pin.SE3) -> list[str]:
    values = pin.SE3ToXYZQUAT(pose)
    return [numbers(values[:3]), numbers(values[3:])]


def written(objects: Objects, with_poses: bool) -> str:
    """A scene as MoveIt's `saveGeometryToStream` writes it."""
    lines = ["a scene"]
    for name, (pose, shapes) in objects.items():
        lines += [f"* {name}", *(pose_lines(pose) if with_poses else []), str(len(shapes))]
        for (kind, sizes), placement in shapes:
            lines += [kind, numbers(sizes), *pose_lines(placement), "0 0 0 0"]
        lines += ["1", "tip", *pose_lines(pose)] if with_poses else []
    return "\n".join([*lines, "."]) + "\n"


def read(folder: Path, text: str) -> Scene:
    path = folder / "test.scene"
    path.write_text(text)
    return load_scene(path)


@settings(max_examples=50)
@given(objects=OBJECTS, with_poses=st.booleans())
def test_round_trip(folder: Path, objects: Objects, with_poses: bool) -> None:
    scene = read(folder, written(objects, with_poses))
    expected = [
        (shape, (pose if with_poses else pin.SE3.Identity()) * placement)
        for pose, shapes in objects.values()
        for shape, placement in shapes
    ]
    assert len(scene) == len(expected)
    for obstacle, ((kind, sizes), pose) in zip(scene, expected, strict=True):
        np.testing.assert_allclose(obstacle.position, pose.translation, atol=1e-9)
        turn = pin.XYZQUATToSE3(np.array([0, 0, 0, *obstacle.orientation_xyzw])).rotation
        if kind != "sphere":
            np.testing.assert_allclose(turn, pose.rotation, atol=1e-7)
        match obstacle:
            case Sphere():
                assert (kind, sizes) == ("sphere", (obstacle.radius,))
            case Box():
                assert (kind, sizes) == ("box", obstacle.size)
            case Cylinder():
                assert (kind, sizes) == ("cylinder", (obstacle.radius, obstacle.length))
            case HalfSpace():
                normal, point = np.array(sizes[:3]), np.array(obstacle.normal) * obstacle.offset
                assert kind == "plane"
                assert normal @ point + sizes[3] == pytest.approx(0.0, abs=1e-9)
                assert normal @ obstacle.normal == pytest.approx(np.linalg.norm(normal))


@settings(max_examples=100)
@given(data=st.data())
def test_damaged_files_raise_nothing_else(folder: Path, data: st.DataObject) -> None:
    words = data.draw(st.sampled_from([OLD, NEW])).split(" ")
    place = data.draw(st.integers(0, len(words) - 1))
    junk = data.draw(st.sampled_from(["", "x", "-1", "1e999", "nan", "99999999", "*", ".", "\n"]))
    words[place : place + data.draw(st.integers(0, 3))] = [junk]
    with suppress(DensarmError):
        read(folder, " ".join(words))


def test_old_version(tmp_path: Path) -> None:
    table, ball, can = read(tmp_path, OLD)
    assert table == Box(name="table top", size=(1, 2, 0.1), position=(0.5, 0, 0.2))
    assert ball == Sphere(name="ball.0", radius=0.1, position=(0, 0, 1))
    assert can == Cylinder(name="ball.1", radius=0.2, length=0.3, position=(0, 1, 1))


def test_mesh_is_its_hull(tmp_path: Path) -> None:
    (wedge,) = read(tmp_path, NEW)
    assert isinstance(wedge, Mesh)
    assert wedge.position == pytest.approx((1, 2, 4))
    assert {tuple(corner) for corner in wedge.pieces[0]} == {
        (0, 0, 0),
        (1, 0, 0),
        (0, 1, 0),
        (0, 0, 1),
    }


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("box", "cow", r"line 4: unknown shape of object 'table top' 'cow'.*\(known: box, cone"),
        (
            "box\n1 2 0.1",
            "cone\n0 1",
            "line 8: table top.radius = 0.0: must be a finite number > 0",
        ),
        (
            "0 0 0 1\n0 0 0 0\n* ball",
            "0 0 0 1\n0 0 0\n* ball",
            "line 9: entry = '[*]': must be a n",
        ),
        ("1 2 0.1", "1 2 0", "line 8: table top.size = 0.0: must be a finite number > 0"),
        ("0.5 0 0.2", "0.5 nan 0.2", "line 7: position of shape of 'table top' = .*finite"),
        ("0 0 0 1\n0 0 0 0\n* ball", "1 1 1 1\n0 0 0 0\n* ball", "line 7: .*unit quaternion"),
        (".\n", "", "line 21: the file ends before the line '.'"),
        ("* ball", "ball", "line 9: entry = 'ball': must be '[*]' before an object"),
        ("* ball\n2", "* ball\n-2", "line 10: number of shapes of 'ball' = '-2': must be a whole"),
        ("* ball\n2\nsphere", "* table top\n1\nsphere", "line 16: entry = 'cylinder': must be"),
    ],
)
def test_wrong_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in OLD
    with pytest.raises(FileContentError, match=message) as caught:
        read(tmp_path, OLD.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_two_objects_of_one_name(tmp_path: Path) -> None:
    text = OLD.replace("* ball\n2", "* table top\n1").replace(OLD[OLD.index("cylinder") : -2], "")
    with pytest.raises(FileContentError, match="'table top': must be used only once"):
        read(tmp_path, text)


def test_other_files(tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match=r"none.scene: No such file"):
        load_scene(tmp_path / "none.scene")
    with pytest.raises(FileContentError, match=r"not a scene: the suffix must be one of .scene"):
        load_scene(tmp_path / "scene.wrl")
    large = tmp_path / "large.scene"
    large.write_bytes(b"\n" * 20_000_001)
    with pytest.raises(FileContentError, match="larger than 20 MB"):
        load_scene(large)


def test_an_orientation_whose_square_overflows(tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match="must be a unit quaternion"):
        read(tmp_path, OLD.replace("0 0 0 1", "0 0 0 1e308", 1))
