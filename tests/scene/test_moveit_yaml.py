"""Planning scenes in YAML, as MotionBenchMaker writes them and as messages are dumped."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.errors import DensarmError, FileContentError
from densarm.scene.loading import load_scene
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import Box, Cylinder, HalfSpace, Sphere
from densarm.scene.scene import Attachment, Scene

# Lists for vectors and no object pose, as robowflex and MotionBenchMaker write.
SHORT = """\
world:
  collision_objects:
    - header: {frame_id: base_link}
      id: can
      primitives: [{type: cylinder, dimensions: [0.14, 3e-2]}]
      primitive_poses: [{position: [0.8, 0, 0.55], orientation: [0, 0, 0, 1]}]
    - header: {frame_id: base_link}
      id: shelf
      primitives: [{type: box, dimensions: [1, 2, 3]}, {type: sphere, dimensions: [0.5]}]
      primitive_poses:
        - {position: [0, 0, 1], orientation: [0, 0, 0, 1]}
        - {position: [0, 0, 2], orientation: [0, 0, 0, 1]}
"""
# The message itself, with a held body.
FULL = """\
name: scene
robot_state:
  joint_state: {name: [], position: []}
  attached_collision_objects:
    - link_name: hand
      touch_links: [left, right]
      weight: 0.5
      object:
        header: {frame_id: hand}
        id: bar
        pose: {position: {x: 0.1, y: 0.0, z: 0.0}, orientation: {x: 0, y: 0, z: 0, w: 1}}
        primitives: [{type: 1, dimensions: [0.02, 0.5, 0.02]}]
        primitive_poses: [{position: {x: 0, y: 0, z: 0.1}, orientation: {x: 0, y: 0, z: 0, w: 0}}]
        operation: 0
world:
  collision_objects:
    - id: table
      pose: {position: {x: 1.0, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 1, w: 0}}
      primitives: [{type: 1, dimensions: [1, 1, 0.1]}]
      primitive_poses: [{position: {x: 0.5, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}]
      meshes: []
      planes: [{coef: [0, 0, 2, 1]}]
      operation: 0
  octomap: {header: {frame_id: ''}, octomap: {data: []}}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("scenes")


def read(folder: Path, text: str, name: str = "scene.yaml") -> Scene:
    path = folder / name
    path.write_text(text)
    return load_scene(path)


def test_as_motionbenchmaker_writes(tmp_path: Path) -> None:
    assert tuple(read(tmp_path, SHORT)) == (
        Cylinder(name="can", radius=0.03, length=0.14, position=(0.8, 0, 0.55)),
        Box(name="shelf.0", size=(1, 2, 3), position=(0, 0, 1)),
        Sphere(name="shelf.1", radius=0.5, position=(0, 0, 2)),
    )


def test_cone_is_enclosed(tmp_path: Path) -> None:
    for word in ("cone", "4"):
        cone = read(tmp_path, SHORT.replace("type: cylinder", f"type: {word}")).obstacles[0]
        (shape,) = cone.convex_shapes()
        volume = np.pi * 0.03**2 * 0.14 / 3
        assert volume < shape.computeVolume() < 1.003 * volume
        assert shape.computeCOM()[2] == pytest.approx(-0.07 + 0.14 / 4)


def test_names_may_look_like_numbers(tmp_path: Path) -> None:
    scene = read(
        tmp_path, SHORT.replace("id: can", "id: 007").replace("[1, 2, 3]", "[1e-1, 2., +3]")
    )
    assert scene.obstacles[0].name == "007"
    box = scene.obstacles[1]
    assert isinstance(box, Box)
    assert box.size == (0.1, 2.0, 3.0)


def test_message_with_a_held_body(tmp_path: Path) -> None:
    scene = read(tmp_path, FULL, "scene.yml")
    table, plane = scene
    assert table.position == pytest.approx((0.5, 0, 0))  # the object is turned half-way round
    assert isinstance(plane, HalfSpace)
    assert (plane.normal, plane.offset, plane.position) == ((0, 0, 1), -0.5, (1, 0, 0))
    bar = Box(name="bar", size=(0.02, 0.5, 0.02), position=(0.1, 0, 0.1))
    assert scene.attachments == (Attachment(bar, "hand", ("left", "right"), 0.5),)


def test_meshes(tmp_path: Path) -> None:
    (tmp_path / "wedge.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
    )
    listed = [{"x": 0, "y": 0, "z": 0}, {"x": 1}, {"y": 1}, {"z": 1}]
    meshes = [{"resource": "wedge.obj", "dimensions": [1, 2, 1]}, {"vertices": listed}]
    poses = [{"position": [1, 2, 3]}, {"position": [0, 0, 0]}]
    objects = [{"id": "it", "meshes": meshes, "mesh_poses": poses}]
    first, second = read(tmp_path, yaml.safe_dump({"world": {"collision_objects": objects}}))
    assert isinstance(first, Mesh)
    assert isinstance(second, Mesh)
    assert (first.name, first.position) == ("it.0", (1, 2, 3))
    corners = {(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)}
    assert {tuple(corner) for corner in first.pieces[0]} == {(x, 2 * y, z) for x, y, z in corners}
    assert {tuple(corner) for corner in second.pieces[0]} == corners


NUMBER = st.floats(-5, 5)
QUATERNION = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda v: np.linalg.norm(v) > 0.1)
    .map(lambda v: (np.array(v) / np.linalg.norm(v)).tolist())
)


def message_pose(pose: list[float], as_lists: bool) -> dict[str, Any]:
    position, orientation = pose[:3], pose[3:]
    if as_lists:
        return {"position": position, "orientation": orientation}
    return {
        "position": dict(zip("xyz", position, strict=True)),
        "orientation": dict(zip("xyzw", orientation, strict=True)),
    }


POSE = st.builds(lambda at, turn: [*at, *turn], st.tuples(NUMBER, NUMBER, NUMBER), QUATERNION)
SIZES = st.one_of(*[st.lists(st.floats(0.01, 5), min_size=n, max_size=n) for n in (1, 2, 3)])


@settings(max_examples=50)
@given(objects=st.lists(st.tuples(POSE, POSE, SIZES), max_size=4), as_lists=st.booleans())
def test_round_trip(
    folder: Path, objects: list[tuple[list[float], list[float], list[float]]], as_lists: bool
) -> None:
    kinds = {1: "sphere", 2: "cylinder", 3: "box"}
    data = [
        {
            "id": f"it{k}",
            "pose": message_pose(pose, as_lists),
            "primitives": [{"type": kinds[len(sizes)], "dimensions": sizes}],
            "primitive_poses": [message_pose(own, as_lists)],
        }
        for k, (pose, own, sizes) in enumerate(objects)
    ]
    text = yaml.safe_dump({"world": {"collision_objects": data}})
    scene = read(folder, text)
    assert len(scene) == len(objects)
    for obstacle, (pose, own, sizes) in zip(scene, objects, strict=True):
        placed = pin.XYZQUATToSE3(np.array(pose)) * pin.XYZQUATToSE3(np.array(own))
        np.testing.assert_allclose(obstacle.position, placed.translation, atol=1e-9)
        match obstacle:
            case Sphere():
                assert [obstacle.radius] == sizes
            case Cylinder():
                assert [obstacle.length, obstacle.radius] == sizes
            case Box():
                assert list(obstacle.size) == sizes


@settings(max_examples=75)
@given(data=st.data())
def test_damaged_files_raise_nothing_else(folder: Path, data: st.DataObject) -> None:
    text = data.draw(st.sampled_from([SHORT, FULL]))
    start = data.draw(st.integers(0, len(text)))
    end = start + data.draw(st.integers(0, 8))
    junk = ["", "[", "}", "x", ": ", "&a ", "*a", "!!python/object:os.system ", "1e999", "~", "\t"]
    with suppress(DensarmError):
        text = text[:start] + data.draw(st.sampled_from(junk)) + text[end:]
        read(folder, text)


LEAF = st.one_of(st.none(), st.booleans(), NUMBER, st.just("x"), st.integers(-3, 3))
TREE = st.recursive(
    LEAF,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.sampled_from(["id", "pose", "position", "type", "x"]), inner, max_size=3
        ),
    ),
    max_leaves=6,
)


@pytest.mark.slow
@settings(max_examples=75)
@given(data=st.data(), junk=TREE)
def test_wrong_values_raise_nothing_else(folder: Path, data: st.DataObject, junk: Any) -> None:
    tree = yaml.safe_load(data.draw(st.sampled_from([SHORT, FULL])))
    node = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        key = data.draw(st.sampled_from(keys))
        if not isinstance(node[key], dict | list) or not node[key] or data.draw(st.booleans()):
            break
        node = node[key]
    node[key] = junk
    with suppress(DensarmError):
        read(folder, yaml.safe_dump(tree))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("world:", "wurld:", "world = None: must be given: this is no planning scene"),
        ("type: cylinder", "type: prism", "unknown shape of object 'can' 'prism'"),
        ("type: cylinder", "type: 5", "unknown shape of object 'can' '5'"),
        ("[0.14, 3e-2]", "[0.14]", r"sizes of cylinder 'can' = \[0.14\]: must be 2 numbers"),
        ("[0.14, 3e-2]", "[0.14, -1]", "can.radius = -1.0: must be a finite number > 0"),
        ("[0.14, 3e-2]", "[0.14, wide]", "dimensions of 'can' = .*must be a list of numbers"),
        ("[0.14, 3e-2]", "0.14", "dimensions of 'can' = '0.14': must be a list"),
        ("id: can", "id: [7]", r"id of a collision object = \['7'\]: must be a non-empty string"),
        ("id: can", "name: can", "id of a collision object = None: must be a non-empty string"),
        ("id: can", "id: shelf.0", "obstacle name = 'shelf.0': must be used only once"),
        ("id: can", "operation: 1\n      id: can", "operation of 'can' = '1': must be 0"),
        ("base_link", "tool", r"frame_id = \['base_link', 'tool'\]: must be one frame"),
        ("[0, 0, 0, 1]", "[1, 1, 1, 1]", "orientation of primitive of 'can' = .*unit quaternion"),
        (
            "- {position: [0, 0, 1], orientation: [0, 0, 0, 1]}\n",
            "",
            "'shelf' = 1: must be 2 poses",
        ),
        ("[0.8, 0, 0.55]", "&here [0.8, 0, 0.55], junk: *here", "line 6: an alias"),
        ("id: can", "id: [" * 40 + "]" * 40, "line 4: an alias, or nested too deeply"),
        ("id: can", "id: can: can", "line 4: not YAML: mapping values are not allowed"),
        ("id: can", "id: !!python/name:os.system", "id of a collision object = '': must be"),
        ("id: can", "id: \x01", "not YAML"),
    ],
)
def test_wrong_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SHORT
    with pytest.raises(FileContentError, match=message) as caught:
        read(tmp_path, SHORT.replace(old, new, 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("link_name: hand", "link_name: {}", "link_name of an attached object = {"),
        ("link_name: hand", "link_name: arm", "frame_id of an attached object = 'hand': must be"),
        ("weight: 0.5", "weight: -1", "bar.mass = -1.0: must be a finite number >= 0"),
        (
            "world:",
            "link_padding: [{link_name: a, padding: 0}, {link_name: hand, padding: 0.01}]\nworld:",
            "link_padding of 'hand' = 0.01: must be 0: set control.margin",
        ),
        (
            "world:",
            "link_scale: [{link_name: a, scale: 1.0}, {link_name: hand, scale: 1.1}]\nworld:",
            "link_scale of 'hand' = 1.1: must be 1: set control.margin",
        ),
        ("{data: []}", "{data: [1]}", "world.octomap = 'cells': must be empty"),
        ("[0, 0, 2, 1]", "[0, 0, 0, 1]", "table.1.normal = .*a direction, not zero"),
    ],
)
def test_wrong_messages(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in FULL
    with pytest.raises(FileContentError, match=message):
        read(tmp_path, FULL.replace(old, new, 1))


def test_package_paths_are_refused(tmp_path: Path) -> None:
    objects = [{"id": "it", "meshes": [{"resource": "package://a/b.dae"}]}]
    with pytest.raises(FileContentError, match=r"'package://a/b.dae': must be the path of a mesh"):
        read(tmp_path, yaml.safe_dump({"world": {"collision_objects": objects}}))


@pytest.mark.parametrize("form", ["{}---\n", "---\n{}---\n", "---\n{}...\n", "{}---\n---\n"])
def test_one_message_as_ros_prints_it(tmp_path: Path, form: str) -> None:
    text = "world: {collision_objects: []}\n"
    assert read(tmp_path, form.format(text)) == Scene()
    with pytest.raises(FileContentError, match="holds 2 planning scenes, not one"):
        read(tmp_path, f"{text}---\n{text}---\n")


def test_a_flat_mesh_is_refused_by_name(tmp_path: Path) -> None:
    flat = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": []}
    text = yaml.safe_dump({"world": {"collision_objects": [{"id": "film", "meshes": [flat]}]}})
    with pytest.raises(FileContentError, match="mesh 'film' has no convex hull"):
        read(tmp_path, text)
