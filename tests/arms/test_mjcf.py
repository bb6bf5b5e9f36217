"""Arms out of MJCF files, against what MuJoCo itself makes of them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.arms.self_collision import Exclusion
from densarm.errors import DensarmError
from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array

mujoco = pytest.importorskip("mujoco")

DATA = Path(__file__).parents[1] / "data"
FILE = DATA / "arm_and_table.xml"
JOINTS = ["pan", "lift", "roll", "slide", "turn"]


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm(FILE, joints=JOINTS, locked_joints={"left": 0.02})


@pytest.fixture(scope="module")
def placed() -> Callable[[Array, Array], Any]:
    """MuJoCo's data at positions and velocities of the arm's joints, its model as `.model`."""
    model = mujoco.MjModel.from_xml_path(str(FILE))
    data = mujoco.MjData(model)

    def at(angles: Array, v: Array) -> Any:
        data.qpos[:], data.qvel[:] = model.qpos0, 0.0
        for name, position, velocity in zip(JOINTS, angles, v, strict=True):
            data.joint(name).qpos[0], data.joint(name).qvel[0] = position, velocity
        data.joint("left").qpos[0], data.joint("right").qpos[0] = 0.02, 0.01
        mujoco.mj_forward(model, data)
        return data

    return at


def states() -> list[tuple[Array, Array]]:
    random = np.random.default_rng(0)
    scale = np.array([2.0, 2.0, 2.0, 0.1, 4.0])
    return [(scale * random.uniform(-1.0, 1.0, 5), random.normal(size=5)) for _ in range(20)]


def test_dynamics_and_places(arm: Arm, placed: Callable[[Array, Array], Any]) -> None:
    """Several joints of a body, about axes off its origin, references and coupled joints count."""
    for angles, v in states():
        data, q = placed(angles, v), arm.configuration(angles)
        columns = [int(data.model.joint(name).dofadr[0]) for name in JOINTS]
        full = np.zeros((data.model.nv, data.model.nv))
        for row, unit in zip(full, np.eye(data.model.nv), strict=True):
            mujoco.mj_mulM(data.model, data, row, unit)
        mass = full[np.ix_(columns, columns)]
        np.testing.assert_allclose(arm.mass_matrix(q), mass, rtol=0, atol=1e-12)
        bias = data.qfrc_bias[columns]
        np.testing.assert_allclose(arm.nonlinear_effects(q, v), bias, rtol=0, atol=1e-11)
        for name in ("base", "shoulder", "upper", "slider", "wrist", "body_7"):
            body = data.body(name) if name != "body_7" else data.body(7)
            pose = arm.pose(q, name).placement
            np.testing.assert_allclose(pose.translation, body.xpos, atol=1e-12)
            np.testing.assert_allclose(pose.rotation.ravel(), body.xmat, atol=1e-12)
        tool = arm.pose(q, "tool").placement
        np.testing.assert_allclose(tool.translation, data.site("tool").xpos, atol=1e-12)
        np.testing.assert_allclose(tool.rotation.ravel(), data.site("tool").xmat, atol=1e-12)


def test_shapes(arm: Arm, placed: Callable[[Array, Array], Any]) -> None:
    """Each shape has the extent of its geom along every direction, prisms a little more."""
    angles, v = states()[0]
    data, model, geometry = placed(angles, v), arm.model, arm.collision_model
    geometry_data, mj = geometry.createData(), data.model
    q = arm.configuration(angles)
    pin.updateGeometryPlacements(model, model.createData(), geometry, geometry_data, q)
    of_link: dict[str, list[int]] = {}
    for k, item in enumerate(geometry.geometryObjects):
        of_link.setdefault(model.frames[item.parentFrame].name, []).append(k)
    directions = np.random.default_rng(1).normal(size=(50, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, np.newaxis]
    seen = 0
    for body in range(mj.nbody):
        name = mj.body(body).name or f"body_{body}"
        first, count = mj.body_geomadr[body], mj.body_geomnum[body]
        geoms = [g for g in range(first, first + count) if mj.geom_contype[g]]
        if name not in of_link:
            continue
        for k, geom in zip(of_link[name], geoms, strict=True):
            points, radius = extreme_points(geometry.geometryObjects[k].geometry)
            pose = geometry_data.oMg[k]
            own = (points @ pose.rotation.T + pose.translation) @ directions.T
            is_prism = mj.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER
            reach = own.max(axis=0) + radius
            expected = support(data, geom, directions)
            assert (reach >= expected - 1e-7).all()
            assert (reach <= expected + (2e-4 if is_prism else 1e-7)).all()
            seen += 1
    assert seen == 8


def support(data: Any, geom: int, directions: Array) -> Array:
    """How far a geom of MuJoCo reaches along directions (D, 3) [m]."""
    model, kinds = data.model, mujoco.mjtGeom
    turn, place, size = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom], model.geom_size
    local, (a, b, c) = directions @ turn, size[geom]
    kind = kinds(int(model.geom_type[geom]))
    if kind == kinds.mjGEOM_SPHERE:
        reach = np.full(len(local), a)
    elif kind == kinds.mjGEOM_CAPSULE:
        reach = a + b * np.abs(local[:, 2])
    elif kind == kinds.mjGEOM_CYLINDER:
        reach = a * np.linalg.norm(local[:, :2], axis=1) + b * np.abs(local[:, 2])
    elif kind == kinds.mjGEOM_BOX:
        reach = np.abs(local) @ (a, b, c)
    else:
        mesh = model.geom_dataid[geom]
        begin = model.mesh_vertadr[mesh]
        reach = (model.mesh_vert[begin : begin + model.mesh_vertnum[mesh]] @ local.T).max(axis=0)
    return np.asarray(directions @ place + reach)


def test_what_joints_have(arm: Arm) -> None:
    """Limits, rotors and friction, by defaults and their own."""
    limit = np.radians(160.0)
    np.testing.assert_allclose(arm.limits.lower, [-limit, -limit, -limit, -0.1, -np.inf])
    np.testing.assert_allclose(arm.limits.upper, [limit, limit, limit, 0.2, np.inf])
    assert arm.limits.effort.tolist() == [80.0, 50.0, np.inf, 200.0, np.inf]
    assert np.isinf(arm.limits.velocity).all()
    assert arm.model.armature.tolist() == [0.1, 0.1, 0.1, 3.0, 0.02]
    assert arm.model.damping.tolist() == [1.0, 1.0, 1.0, 20.0, 0.5]
    assert arm.model.upperDryFrictionLimit.tolist() == 5 * [0.2]
    np.testing.assert_allclose(arm.angles(arm.postures["home"]), [0.1, 0.5, -0.3, 0.05, 0.7])
    told = {item.shapes: item.reason for item in arm.excluded_pairs}
    assert told["shoulder_0", "slider_0"] == Exclusion.SRDF
    assert arm.remarks == (
        "joints turn, left, right have no actuator of their own: taken as driven, without a limit",
    )
    drawn = {item.name for item in arm.visual_model.geometryObjects}
    assert "shoulder_0" in drawn
    assert len(drawn) == 8


def test_a_record_does_not_need_the_file(arm: Arm) -> None:
    again = Arm(RobotDescription.from_json(arm.description.to_json()))
    assert again.remarks == arm.remarks
    q = again.configuration(states()[0][0])
    assert np.array_equal(again.mass_matrix(q), arm.mass_matrix(q))


def test_coupled_joints_are_locked_together() -> None:
    with pytest.raises(DensarmError, match=r"'right' mimics 'left', which moves: lock by"):
        load_arm(FILE)


SMALL = """<mujoco><option gravity="0 0 -1"/><worldbody>
<body name="one" gravcomp="1"><joint name="a" stiffness="3"/><geom name="g" size="0.1"/>
<body name="two" pos="0 0 1"><joint name="b"/><geom size="0.1"/></body></body></worldbody>
<equality><connect body1="two" anchor="0 0 0"/></equality></mujoco>"""


def load(folder: Path, text: str) -> Arm:
    (folder / "small.xml").write_text(text)
    return load_arm(folder / "small.xml")


def test_remarks(tmp_path: Path) -> None:
    assert load(tmp_path, SMALL).remarks == (
        "equality '0' (connect) is left out: lock the joints that it holds by locked_joints",
        "gravity is 0.0 0.0 -1.0 in the file, and 0 0 -9.81 here",
        "springs of joints a are left out",
        "gravcomp of bodies one is left out: gravity acts on them",
        "joints a, b have no actuator of their own: taken as driven, without a limit",
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'name="g" size="0.1"',
            'name="g" type="ellipsoid" size="1 2 3"',
            "geom 'g' is of the type",
        ),
        ('name="g" size', 'name="g" seize', r"small.xml: XML Error: .*'seize'.*line 2"),
        ('joint name="b"', 'joint name="b" type="ball"', "joint 'b' is a ball: make three hinges"),
        (
            SMALL[SMALL.index('<body name="one"') : SMALL.index("</mujoco>")],
            "</worldbody>",
            "no joint moves a body: is it a scene",
        ),
        ('name="g" size="0.1"', 'name="g" type="mesh" mesh="m"', "Error: mesh 'm' not found"),
    ],
)
def test_wrong_files(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SMALL
    with pytest.raises(DensarmError, match=message) as caught:
        load(tmp_path, SMALL.replace(old, new))
    assert "small.xml: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_mesh_without_a_file(tmp_path: Path) -> None:
    points = "0 0 0  1 0 0  0 1 0  0 0 1"
    asset = f'<mujoco><asset><mesh name="m" vertex="{points}"/></asset>'
    text = SMALL.replace("<mujoco>", asset).replace('size="0.1"/>\n', 'type="mesh" mesh="m"/>\n')
    with pytest.raises(DensarmError, match=r"mesh 'm' has no file: save it as OBJ or STL"):
        load(tmp_path, text)


def test_what_is_drawn_alone_may_have_any_shape(tmp_path: Path) -> None:
    drawn = '<geom type="ellipsoid" size="1 2 3" contype="0" conaffinity="0"/><geom name="g"'
    arm = load(tmp_path, SMALL.replace('<geom name="g"', drawn))
    assert "geom 0 of body 'one' is drawn by MuJoCo alone: left out" in arm.remarks
    shapes = [item.geometry for item in arm.collision_model.geometryObjects]
    assert len(shapes) == 2
    assert all(isinstance(shape, coal.Sphere) for shape in shapes)
