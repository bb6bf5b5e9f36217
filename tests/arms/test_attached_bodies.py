"""Held bodies: the arm with a body attached is the arm whose URDF has it as a part."""

import json
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.errors import DensarmError, InvalidValueError
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from densarm.scene.scene import Attachment, Scene
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

RADIUS, MASS = 0.08, 1.5
INERTIA = 0.4 * MASS * RADIUS**2
WORLD = Scene([Sphere(name="ball", radius=0.1, position=(0.3, 0.2, 0.9)), HalfSpace(name="floor")])
COORDINATE = st.floats(-0.5, 0.5)


def chain(payload: str = "") -> Arm:
    """Three joints, each of another kind, and a hand fixed to the last link."""
    links = "".join(
        f'<link name="link{k}"><collision><origin xyz="0 0 0.15"/><geometry>'
        f'<box size="0.08 0.08 0.2"/></geometry></collision><inertial>'
        f'<mass value="1"/><origin xyz="0 0 0.1"/>'
        f'<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for k in range(4)
    )
    kinds = [("continuous", "0 1 0"), ("prismatic", "1 0 0"), ("revolute", "1 0 0")]
    joints = "".join(
        f'<joint name="joint{k}" type="{kind}"><parent link="link{k}"/><child link="link{k + 1}"/>'
        f'<origin xyz="0 0 0.3"/><axis xyz="{axis}"/>'
        f'<limit lower="-1" upper="1" effort="9" velocity="1"/></joint>'
        for k, (kind, axis) in enumerate(kinds)
    )
    hand = (
        '<link name="hand"/><joint name="wrist" type="fixed"><parent link="link3"/>'
        '<child link="hand"/><origin xyz="0.02 0 0.3" rpy="0.3 0.2 0.1"/></joint>'
    )
    urdf = f'<robot name="chain">{links}{joints}{hand}{payload}</robot>'
    return Arm(RobotDescription(name="chain", urdf=urdf))


@cache
def bare() -> Arm:
    return chain()


def with_ball_in_urdf(x: float, y: float, z: float) -> Arm:
    payload = f"""<link name="payload">
      <inertial><mass value="{MASS}"/><inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}"
        ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry><sphere radius="{RADIUS}"/></geometry></collision></link>
      <joint name="grasp" type="fixed"><parent link="hand"/><child link="payload"/>
      <origin xyz="{x!r} {y!r} {z!r}"/></joint>"""
    return chain(payload)


@settings(max_examples=15)
@given(
    x=COORDINATE, y=COORDINATE, z=COORDINATE, angles=st.tuples(st.floats(-3, 3), *[COORDINATE] * 2)
)
def test_attached_ball_is_a_ball_of_the_urdf(
    x: float, y: float, z: float, angles: tuple[float, float, float]
) -> None:
    expected = with_ball_in_urdf(x, y, z)
    ball = Sphere(name="payload_0", radius=RADIUS, position=(x, y, z))
    held = bare().holding(Attachment(ball, "hand", mass=MASS))
    q = held.configuration(angles)
    np.testing.assert_allclose(held.mass_matrix(q), expected.mass_matrix(q), atol=1e-9)
    v = np.array([0.3, -0.2, 0.5])
    np.testing.assert_allclose(
        held.nonlinear_effects(q, v), expected.nonlinear_effects(q, v), atol=1e-9
    )
    ours, theirs = World(held, WORLD), World(expected, WORLD)
    a, b = ours.clearance(q), theirs.clearance(q)
    for k, pair in enumerate(b.pairs):
        row = a.pairs.index(pair)
        assert a.distance[row] == pytest.approx(b.distance[k], abs=1e-9)
        np.testing.assert_allclose(a.gradient[row], b.gradient[k], atol=1e-9)
        np.testing.assert_allclose(ours.lipschitz[row], theirs.lipschitz[k], atol=1e-9)


def partners(arm: Arm, name: str) -> set[str]:
    """The shapes that a body is paired with."""
    pairs = World(arm, WORLD).pairs
    return {a if b == name else b for a, b in pairs if name in (a, b)}


def test_it_is_paired_with_all_that_moves_against_it() -> None:
    ball = Sphere(name="payload", radius=RADIUS)
    held = bare().holding(Attachment(ball, "hand"))
    others = {"link0_0", "link1_0", "link2_0"}
    assert partners(held, "payload") == others | {"ball", "floor"}
    free = bare().holding(Attachment(ball, "hand", touch_links=["link2", "link0"]))
    assert partners(free, "payload") == {"link1_0", "ball", "floor"}
    assert len(World(bare(), WORLD).pairs) + 5 == len(World(held, WORLD).pairs)


def test_two_bodies_on_two_links_are_one_pair() -> None:
    a = Attachment(Sphere(name="a", radius=0.1), "hand")
    b = Attachment(Sphere(name="b", radius=0.1), "link1")
    pairs = World(bare().holding(a, b), Scene()).pairs
    assert [set(pair) for pair in pairs].count({"a", "b"}) == 1


def test_holding_adds_up() -> None:
    a = Attachment(Sphere(name="a", radius=0.1), "hand", mass=1.0)
    b = Attachment(Sphere(name="b", radius=0.1), "link1", mass=2.0)
    mass = sum(inertia.mass for inertia in bare().holding(a).holding(b).model.inertias)
    assert mass == pytest.approx(sum(i.mass for i in bare().model.inertias) + 3.0)
    assert bare().holding() is bare()


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (Box(name="it", size=(0.1, 0.2, 0.3)), pin.Inertia.FromBox(2.0, 0.1, 0.2, 0.3)),
        (Sphere(name="it", radius=0.2), pin.Inertia.FromSphere(2.0, 0.2)),
        (Capsule(name="it", radius=0.1, length=0.3), pin.Inertia.FromCapsule(2.0, 0.1, 0.3)),
        (Cylinder(name="it", radius=0.1, length=0.3), pin.Inertia.FromCylinder(2.0, 0.1, 0.3)),
    ],
)
def test_inertia_in_closed_form(body: Obstacle, expected: pin.Inertia) -> None:
    placed = replace(body, position=(0.1, 0.2, 0.3), orientation_xyzw=(0.6, 0, 0, 0.8))
    held = bare().holding(Attachment(placed, "link3", mass=2.0))
    pose = pin.XYZQUATToSE3(np.array([0.1, 0.2, 0.3, 0.6, 0, 0, 0.8]))
    total = bare().model.inertias[3] + pose.act(expected)
    found = held.model.inertias[3]
    assert found.mass == pytest.approx(total.mass)
    np.testing.assert_allclose(found.lever, total.lever, rtol=0, atol=1e-9)
    # The prism that stands for the cylinder is 0.12 % wider.
    np.testing.assert_allclose(found.inertia, total.inertia, rtol=0, atol=2e-5)


def test_mass_of_pieces_is_shared_by_volume() -> None:
    cube = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 0.1
    piece = tuple(map(tuple, cube.tolist()))
    longer = tuple(map(tuple, (cube * (3, 1, 1) + (0.1, 0, 0)).tolist()))
    body = Mesh(name="it", pieces=(piece, longer))
    found = bare().holding(Attachment(body, "link3", mass=2.0)).model.inertias[3]
    pose = pin.SE3(np.eye(3), np.array([0.2, 0.05, 0.05]))
    total = bare().model.inertias[3] + pose.act(pin.Inertia.FromBox(2.0, 0.4, 0.1, 0.1))
    np.testing.assert_allclose(found.toDynamicParameters(), total.toDynamicParameters(), atol=1e-9)


@pytest.fixture(scope="module")
def sweeping() -> tuple[Arm, Scene]:
    """A two-link arm whose held bar, and nothing else, meets a post half-way."""
    bar = Box(name="bar", size=(0.02, 0.8, 0.02), position=(0, 0, -0.5))
    arm = load_arm("two_link").holding(Attachment(bar, "lower_link"))
    return arm, Scene([Sphere(name="post", radius=0.05, position=(0.0, 0.35, -1.5))])


def test_swept_check_sees_the_held_bar(sweeping: tuple[Arm, Scene]) -> None:
    arm, scene = sweeping
    angles = np.linspace([-0.4, 0.0], [0.4, 0.0], 2)
    motion = arm.configurations(angles)
    found = SweptCheck(World(arm, scene)).check(motion)
    assert found.verdict == SweptVerdict.CONTACT
    assert found.pairs == (("bar", "post"),)
    empty_handed = World(load_arm("two_link"), scene)
    assert SweptCheck(empty_handed).check(motion).verdict == SweptVerdict.CLEAR


def test_description_holds_attachments() -> None:
    bar = Attachment(Box(name="bar", size=(0.1, 0.1, 0.5)), "hand", ("link2",), 0.5)
    description = bare().holding(bar).description
    assert description.attachments == (bar,)
    again = RobotDescription.from_json(json.loads(json.dumps(description.to_json())))
    assert again == description
    old = description.to_json()
    del old["attachments"]  # as earlier versions wrote it
    assert RobotDescription.from_json(old) == replace(description, attachments=())


def test_scene_takes_attachments() -> None:
    bar = Attachment(Box(name="bar", size=(0.1, 0.1, 0.5)), "hand", ("link2",), 0.5)
    scene = Scene(WORLD, [bar])
    assert Scene.from_json(json.loads(json.dumps(scene.to_json()))) == scene
    with pytest.raises(InvalidValueError, match=r"attached body = 'bar': must be held by the arm"):
        World(bare(), scene)
    assert World(bare().holding(*scene.attachments), scene).n_pairs > 0


def test_bodies_have_names_of_their_own() -> None:
    ball = Sphere(name="ball", radius=0.1)
    with pytest.raises(InvalidValueError, match="obstacle name = 'ball': must be used only once"):
        Scene([ball], [Attachment(ball, "hand")])
    with pytest.raises(InvalidValueError, match="obstacle name = 'ball': must be other than"):
        World(bare().holding(Attachment(ball, "hand")), Scene([ball]))
    for name in ("ball", "link1_0"):
        twin = Attachment(replace(ball, name=name), "hand")
        with pytest.raises(InvalidValueError, match=f"attached body = '{name}': must be other"):
            bare().holding(Attachment(ball, "link1"), twin)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"attached_to": "hnd"}, "unknown link for 'bar' 'hnd'; did you mean 'hand'"),
        ({"touch_links": ["lnk"]}, "unknown link for 'bar' 'lnk'"),
    ],
)
def test_unknown_links(table: dict[str, Any], message: str) -> None:
    whole = {"type": "sphere", "name": "bar", "radius": 0.1, "attached_to": "hand", **table}
    with pytest.raises(DensarmError, match=message) as caught:
        bare().holding(*Scene.from_json([whole]).attachments)
    assert "\n" not in str(caught.value)


def test_pictures_show_held_bodies() -> None:
    held = bare().holding(Attachment(Sphere(name="ball", radius=0.1), "hand"))
    (item,) = [item for item in held.visual_model.geometryObjects if item.name == "ball"]
    assert item.parentJoint == 3
