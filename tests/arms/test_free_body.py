"""Free bodies: clearances in closed form, coordinates, shapes and dynamics."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.arms.free_body import free_body
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Box, Capsule, Sphere
from densarm.scene.scene import Scene
from densarm.world.world import World

SQUARE, CUBE = [(-2.0, 2.0)] * 2, [(-2.0, 2.0)] * 3
POINT = Sphere(name="point", radius=1e-9)

coordinate = st.floats(-2.0, 2.0)
angle = st.floats(-np.pi, np.pi)


@pytest.fixture(scope="module")
def point_and_ball() -> World:
    arm = free_body(POINT, "space", CUBE)
    ball = Sphere(name="ball", radius=0.5, position=(0.3, -0.2, 0.1))
    return World(arm, Scene([ball]))


@pytest.fixture(scope="module")
def disc_and_block() -> World:
    arm = free_body(Sphere(name="disc", radius=0.3), "plane", SQUARE)
    block = Box(name="block", size=(1.0, 0.6, 1.0))
    return World(arm, Scene([block]))


@pytest.fixture(scope="module")
def rigid_body() -> Arm:
    shapes = [
        Box(name="block", size=(0.2, 0.3, 0.4), position=(0.1, 0.0, -0.1)),
        Capsule(name="pin", radius=0.05, length=0.6, position=(0.0, 0.2, 0.0)),
    ]
    return free_body(shapes, "rigid body", CUBE, mass=3.0)


@given(st.tuples(coordinate, coordinate, coordinate))
def test_clearance_of_a_point_is_its_distance(
    point_and_ball: World, x: tuple[float, float, float]
) -> None:
    apart = np.array(x) - [0.3, -0.2, 0.1]
    length = np.linalg.norm(apart)
    assume(length > 1e-3)
    sample = point_and_ball.clearance(x)
    assert sample.distance[0] == pytest.approx(length - 0.5, abs=1e-7)
    np.testing.assert_allclose(sample.gradient[0], apart / length, rtol=0, atol=1e-5)


@given(st.tuples(coordinate, coordinate))
def test_clearance_of_a_disc_is_its_distance_in_the_plane(
    disc_and_block: World, x: tuple[float, float]
) -> None:
    outside = np.abs(x) - [0.5, 0.3]
    signed = np.linalg.norm(np.maximum(outside, 0.0)) + min(outside.max(), 0.0)
    distance = disc_and_block.distances(np.array(x))
    if signed - 0.3 > 1e-4:
        assert distance == pytest.approx(signed - 0.3, abs=1e-7)
    else:
        assert distance < 1e-3


@given(st.tuples(coordinate, coordinate, coordinate), st.tuples(angle, angle, angle))
def test_coordinates_are_position_then_yaw_pitch_roll(
    rigid_body: Arm, position: tuple[float, float, float], turns: tuple[float, float, float]
) -> None:
    yaw, pitch, roll = turns
    data = rigid_body.model.createData()
    pin.forwardKinematics(
        rigid_body.model, data, rigid_body.configuration([*position, yaw, pitch, roll])
    )
    turned = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    np.testing.assert_allclose(data.oMi[-1].rotation, turned, rtol=0, atol=1e-12)
    np.testing.assert_allclose(data.oMi[-1].translation, position, rtol=0, atol=1e-12)


def test_shapes_keep_their_order_and_kind(rigid_body: Arm) -> None:
    names = [item.name for item in rigid_body.collision_model.geometryObjects]
    assert sorted(names) == ["body_0", "body_1"]
    item = rigid_body.collision_model.geometryObjects[names.index("body_1")]
    assert type(item.geometry).__name__ == "Capsule"
    np.testing.assert_allclose(item.placement.translation, [0.0, 0.2, 0.0], rtol=0, atol=1e-12)


@given(st.tuples(angle, angle, angle), st.integers(0, 2**32 - 1))
def test_kinetic_energy_is_that_of_the_body(
    rigid_body: Arm, turns: tuple[float, float, float], seed: int
) -> None:
    q = rigid_body.configuration([0.0, 0.0, 0.0, *turns])
    v = np.random.default_rng(seed).normal(size=6)
    data = rigid_body.model.createData()
    pin.forwardKinematics(rigid_body.model, data, q, v)
    body = pin.Inertia.Zero()
    for size, shape in (((0.2, 0.3, 0.4), "Box"), ((0.05, 0.6), "Capsule")):
        volume = {"Box": 0.024, "Capsule": np.pi * 0.05**2 * (0.6 + 4.0 / 3.0 * 0.05)}[shape]
        centre = {"Box": (0.1, 0.0, -0.1), "Capsule": (0.0, 0.2, 0.0)}[shape]
        solid = getattr(pin.Inertia, f"From{shape}")(volume, *size)
        body += pin.SE3(np.eye(3), np.array(centre)).act(solid)
    twist = data.v[-1].vector
    energy = 0.5 * 3.0 / body.mass * twist @ body.matrix() @ twist
    assert 0.5 * v @ rigid_body.mass_matrix(q) @ v == pytest.approx(energy, rel=0.005, abs=1e-3)


@given(st.tuples(angle, angle))
def test_mass_matrix_is_regular_at_gimbal_lock(rigid_body: Arm, turns: tuple[float, float]) -> None:
    q = rigid_body.configuration([0.0, 0.0, 0.0, turns[0], np.pi / 2, turns[1]])
    values = np.linalg.eigvalsh(rigid_body.mass_matrix(q))
    assert values[0] > 1e-6 * values[-1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shapes": []}, "shapes of a free body"),
        ({"shapes": ["ball"]}, "obstacle"),
        ({"freedom": "line"}, "freedom"),
        ({"bounds": CUBE}, "for each of x, y"),
        ({"bounds": [(0.0, 1.0), (1.0, 1.0)]}, "bounds of y"),
        ({"bounds": [(0.0, np.inf), (0.0, 1.0)]}, "bounds of x"),
        ({"mass": 0.0}, "mass"),
        ({"name": "x"}, "name"),
        ({"speed": -1.0}, "speed"),
        ({"acceleration": np.nan}, "acceleration"),
    ],
)
def test_values_out_of_range_are_refused(change: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"shapes": POINT, "freedom": "plane", "bounds": SQUARE} | change
    with pytest.raises(InvalidValueError, match=message):
        free_body(**arguments)
