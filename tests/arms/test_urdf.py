"""What a URDF may write: mesh formats and paths, capsules; and what is refused, in one line."""

import re
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm
from densarm.arms.description import RobotDescription
from densarm.errors import RobotDescriptionError
from densarm.values.arrays import Array

DATA = Path(__file__).parents[1] / "data"
TEXT = (DATA / "branching.urdf").read_text()

CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
SCALE = np.array([1.0, 2.0, -0.5])


def arm_of(text: str, *folders: object) -> Arm:
    dirs = (*map(str, folders), str(DATA))
    return Arm(RobotDescription(name="changed", urdf=text, package_dirs=dirs))


def ascii_stl() -> bytes:
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*CORNERS[k]) for k in face)
        + "endloop\nendfacet\n"
        for face in FACES
    ]
    return f"solid it\n{''.join(facets)}endsolid it\n".encode()


def binary_stl() -> bytes:
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.zeros(len(FACES), record)
    facets["corners"] = CORNERS[np.array(FACES)]
    return b"solid in name alone".ljust(80) + np.uint32(len(FACES)).tobytes() + facets.tobytes()


def obj() -> bytes:
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]
    return "\n".join(lines).encode()


def dae(meter: float = 1.0) -> bytes:
    numbers = " ".join(map(str, CORNERS.ravel()))
    faces = " ".join(str(k) for face in FACES for k in face)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset><unit name="it" meter="{meter}"/><up_axis>Z_UP</up_axis></asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="12">{numbers}</float_array><technique_common>
   <accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
   <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
  </source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
 </mesh></geometry></library_geometries>
 <library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node>
 </visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>""".encode()


@pytest.mark.parametrize(
    ("file", "content"),
    [("a.stl", ascii_stl()), ("b.STL", binary_stl()), ("c.obj", obj()), ("d.dae", dae())],
)
def test_mesh_formats(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], file: str, content: bytes
) -> None:
    (tmp_path / file).write_bytes(content)
    scale = "1 2 -0.5"
    arm = arm_of(
        re.sub(r'meshes/wedge.stl" scale="1 1 2', f'{file}" scale="{scale}', TEXT), tmp_path
    )
    shape = arm.collision_model.geometryObjects[-1].geometry
    assert isinstance(shape, coal.ConvexBase)
    found = np.array(sorted(shape.points().tolist()))
    np.testing.assert_allclose(found, sorted((CORNERS * SCALE).tolist()), atol=1e-7)
    assert capfd.readouterr() == ("", "")


def sorted_points(points: Array) -> Array:
    return np.array(sorted(np.array(points).tolist()))


def test_links_collide_and_are_drawn_in_the_unit_of_their_mesh(tmp_path: Path) -> None:
    (tmp_path / "metres.dae").write_bytes(dae())
    (tmp_path / "inches.dae").write_bytes(dae(0.0254))
    (tmp_path / "capitals.stl").write_bytes(ascii_stl().upper())
    points = {}
    for name in ("metres.dae", "inches.dae", "capitals.stl"):
        text = re.sub(r"meshes/wedge\.(stl|obj)", name, TEXT)
        arm = arm_of(text, tmp_path)
        points[name] = sorted_points(arm.collision_model.geometryObjects[-1].geometry.points())
        shape = arm.visual_model.geometryObjects[-1].geometry
        assert isinstance(shape, coal.BVHModelBase)
        np.testing.assert_allclose(
            sorted_points(shape.vertices()) * (1, 1, 2), points[name], atol=1e-8
        )
    np.testing.assert_allclose(points["inches.dae"], 0.0254 * points["metres.dae"], atol=1e-8)
    np.testing.assert_allclose(points["capitals.stl"], points["metres.dae"], atol=1e-7)


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        ('it.ply"', "mesh 'it.ply' of link 'blade': .*it.ply: not a mesh in STL, OBJ or DAE"),
        ('it.stl" scale="1 1"', "mesh 'it.stl' of link 'blade': scale = '1 1': must be three"),
        ('it.stl" scale="1 1 a"', "of link 'blade': scale = '1 1 a': must be three finite numbers"),
        ('it.stl" scale="1 1 1e400"', "of link 'blade': scale = .*finite"),
    ],
)
def test_meshes_that_are_refused(tmp_path: Path, mesh: str, message: str) -> None:
    for name in ("it.stl", "it.ply"):
        (tmp_path / name).write_bytes(ascii_stl())
    text = re.sub(r'meshes/wedge.stl"( scale="[^"]*")?', mesh, TEXT)
    with pytest.raises(RobotDescriptionError, match=message):
        arm_of(text, tmp_path)


@pytest.mark.parametrize("path", ["package://blades_pkg/it.stl", "model://blades/it.stl", "it.stl"])
def test_packages_in_folders_of_other_names(tmp_path: Path, path: str) -> None:
    (tmp_path / "it.stl").write_bytes(ascii_stl())
    arm = arm_of(TEXT.replace("meshes/wedge.stl", path), tmp_path)
    assert set(arm.mesh_hashes()) == {"it.stl"}


def test_missing_mesh_names_link_file_and_folders(tmp_path: Path) -> None:
    text = TEXT.replace("meshes/wedge.stl", "package://other/it.stl")
    message = f"mesh 'package://other/it.stl' of link 'blade'.*{tmp_path}, .*package_dirs"
    with pytest.raises(RobotDescriptionError, match=message):
        arm_of(text, tmp_path)


def test_a_missing_visual_mesh_is_missed_by_the_picture_alone() -> None:
    arm = arm_of(TEXT.replace("meshes/wedge.obj", "nothing.obj"))
    with pytest.raises(RobotDescriptionError, match=r"'nothing.obj' of link 'base'"):
        assert arm.visual_model


def test_capsules() -> None:
    shape = '<{} radius="0.04" length="0.25"/>'
    text = TEXT.replace(shape.format("cylinder"), shape.format("capsule"))
    text = text.replace('<mesh filename="meshes/wedge.obj"/>', shape.format("capsule"), 1)
    assert text.count("<capsule") == 2
    arm = arm_of(text)
    item = next(g for g in arm.collision_model.geometryObjects if g.name == "left_arm_0")
    assert isinstance(item.geometry, coal.Capsule)
    assert (item.geometry.radius, item.geometry.halfLength) == (0.04, 0.125)
    assert isinstance(arm.visual_model.geometryObjects[0].geometry, coal.Capsule)


def inertial_of(link: str) -> str:
    return rf'(?s)(<link name="{link}">\s*)<inertial>.*?</inertial>'


def test_a_massless_link_welded_to_a_massive_one() -> None:
    assert arm_of(TEXT).nv == 5  # the tool has no mass


def test_massless_links_between_massive_ones() -> None:
    assert arm_of(re.sub(inertial_of("carriage"), r"\1", TEXT)).nv == 5


def test_a_point_mass_on_the_axis() -> None:
    point = '<inertial><mass value="1"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/>'
    text = re.sub(inertial_of("blade"), rf"\1{point}</inertial>", TEXT)
    with pytest.raises(RobotDescriptionError, match=r"joint 'wrist' moves an inertia.*singular"):
        arm_of(text)


def test_links_and_joints_of_one_name() -> None:
    text = TEXT.replace('name="tool_joint"', 'name="tool"').replace('name="wrist"', 'name="blade"')
    arm = arm_of(text)
    assert (arm.end_effector, arm.joint_names[-1]) == ("tool", "blade")
    assert arm.model.frames[arm.end_effector_frame].type == pin.FrameType.BODY
    description = replace(arm.description, locked_joints={"blade": 1.0})
    assert Arm(description).joint_names == ("turn", "slide", "left", "right")


@pytest.mark.parametrize(
    "shape",
    [
        '<box size="0 0 0"/>',
        '<sphere radius="0"/>',
        '<cylinder radius="0" length="0.0"/>',
        '<mesh filename="meshes/wedge.obj" scale="0 0 0"/>',
    ],
)
def test_shapes_without_size_are_left_out_and_listed(shape: str) -> None:
    arm = arm_of(TEXT.replace('<sphere radius="0.07"/>', shape))
    assert len(arm.remarks) == 1
    assert re.fullmatch(r"collision \w+ of link 'right_arm' has no size: left out", arm.remarks[0])
    names = {item.name for item in arm.collision_model.geometryObjects}
    assert names == {item.name for item in arm_of(TEXT).collision_model.geometryObjects} - {
        "right_arm_0"
    }


FLAT = {
    '<box size="0.1 0 0.08"/>': (0.1, 1e-3, 0.08),
    '<box size="0.1 1e-9 0.08"/>': (0.1, 1e-3, 0.08),
    '<box size="0.1 0 0"/>': (0.1, 1e-3, 1e-3),
    '<cylinder radius="0.05" length="0"/>': (0.1, 0.1, 1e-3),
    '<cylinder radius="0" length="0.1"/>': (1e-3, 1e-3, 0.1),
}


def points_for(shape: str) -> tuple[Array, tuple[str, ...]]:
    """Return the corners of the shape in the place of a ball, and what is told of the arm."""
    arm = arm_of(TEXT.replace('<sphere radius="0.07"/>', shape))
    item = next(g for g in arm.collision_model.geometryObjects if g.name == "right_arm_0")
    return np.array(item.geometry.points()), arm.remarks


FLAT_REMARK = "collision geometry 'right_arm_0' of link 'right_arm' is flat: 1 mm thick"


@pytest.mark.parametrize("shape", FLAT)
def test_flat_shapes_are_a_millimetre_thick_and_listed(shape: str) -> None:
    points, remarks = points_for(shape)
    np.testing.assert_allclose(np.ptp(points, axis=0), FLAT[shape], rtol=2e-3)
    assert remarks == (FLAT_REMARK,)


def test_flat_meshes_are_enclosed() -> None:
    mesh = '<mesh filename="meshes/wedge.stl" scale="1 1 {}"/>'
    (whole, _), (flat, remarks) = points_for(mesh.format(1)), points_for(mesh.format(0))
    size = np.ptp(whole, axis=0)
    np.testing.assert_allclose(np.ptp(flat, axis=0), size * [1, 1, 0] + 1e-3, atol=1e-9)
    assert remarks == (FLAT_REMARK,)


def test_a_capsule_without_length_is_a_sphere() -> None:
    shape = '<capsule radius="0.04" length="0"/>'
    arm = arm_of(TEXT.replace('<sphere radius="0.07"/>', shape))
    item = next(g for g in arm.collision_model.geometryObjects if g.name == "right_arm_0")
    assert isinstance(item.geometry, coal.Sphere)
    assert (item.geometry.radius, arm.remarks) == (0.04, ())


def test_a_link_whose_only_collision_shape_is_empty_collides_as_drawn() -> None:
    drawn = '<visual><geometry><box size="0.2 0.1 0.3"/></geometry></visual>'
    empty = '<collision><geometry><box size="0 0 0"/></geometry></collision>'
    text = re.sub(r"(?s)<collision>(?:(?!</collision>).)*0\.07.*?</collision>", drawn + empty, TEXT)
    arm = arm_of(text)
    assert arm.links_without_collision == ("right_arm",)
    assert arm.collision_model.existGeometryName("right_arm_0")


def test_prefixes_that_nobody_declared() -> None:
    more = '<gazebo><sensor:camera name="c" x:y="1"/></gazebo></robot>'
    arm = arm_of(TEXT.replace("</robot>", more))
    assert (arm.nv, arm.remarks) == (5, ())


CHANGES = {
    "equal limits": ('lower="-2" upper="1.5"', 'lower="1" upper="1"', "'left' cannot move.*are 1:"),
    "no limits": ('lower="-2" upper="1.5"', "", r"are 0: widen.*joints=\{'left': position\}"),
    "planar": ("prismatic", "planar", "'slide' has 3 degrees of freedom.*locked_joints"),
    "floating": ("prismatic", "floating", "'slide' has 6 degrees of freedom.*locked_joints"),
    "circle": ('<parent link="carriage"/>', '<parent link="blade"/>', "'left_arm'.*circle"),
    "own parent": ('<child link="column"/>', '<child link="base"/>', "'base'.*circle"),
    "far origin": ('xyz="0.15 0 0.3"', 'xyz="1e300 0 0"', "'wrist' has an origin.*beyond"),
    "far shape": ('xyz="0 0 0.25"', 'xyz="1e300 0 0"', "'left_arm_0' of link.*beyond"),
    "capsule": ('cylinder radius="0.04"', 'capsule radius="-1"', "left_arm_0.*not positive"),
    "capsule without length": ("<cylinder", '<capsule radius="1"/><ball', "length"),
    "unknown leader": ("<axis", '<mimic joint="tail"/><axis', "mimics 'tail', which is no joint"),
    "odd mimic": ("<axis", '<mimic joint="left" offset="nan"/><axis', "offset value .nan. is not"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_is_refused(change: str, capfd: pytest.CaptureFixture[str]) -> None:
    old, new, message = CHANGES[change]
    with pytest.raises(RobotDescriptionError, match=message) as raised:
        arm_of(TEXT.replace(old, new))
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def test_neutral_is_no_posture_where_it_touches() -> None:
    assert "neutral" in arm_of(TEXT).postures
    assert "neutral" not in arm_of(TEXT.replace('radius="0.07"', 'radius="0.3"')).postures
