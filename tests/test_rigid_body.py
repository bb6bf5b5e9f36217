"""Free bodies: clearances in closed form, the density of Rⁿ, narrow gaps, proofs that fail."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import densarm
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.implicit_function import Lowered, UnsafeRegion
from densarm.errors import InvalidValueError
from densarm.proof.swept_check import SweptCheck, SweptVerdict
from densarm.simulation import FixedStepLoop, LoopEnd, SimulationParameters, SingleIntegrator

SQUARE, CUBE = [(-2.0, 2.0)] * 2, [(-2.0, 2.0)] * 3
POINT = densarm.Sphere(name="point", radius=1e-9)
ALONG_X = (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5))  # turns z to x

coordinate = st.floats(-2.0, 2.0)
angle = st.floats(-np.pi, np.pi)


def bar(freedom, bounds):
    shape = densarm.Capsule(name="bar", radius=0.04, length=0.6, orientation_xyzw=ALONG_X)
    return densarm.free_body(shape, freedom, bounds, name="bar")


@pytest.fixture(scope="module")
def point_and_ball():
    arm = densarm.free_body(POINT, "space", CUBE)
    ball = densarm.Sphere(name="ball", radius=0.5, position=(0.3, -0.2, 0.1))
    return densarm.Clearance(arm, densarm.Scene([ball]))


@pytest.fixture(scope="module")
def disc_and_block():
    arm = densarm.free_body(densarm.Sphere(name="disc", radius=0.3), "plane", SQUARE)
    block = densarm.Box(name="block", size=(1.0, 0.6, 1.0))
    return densarm.Clearance(arm, densarm.Scene([block]))


@pytest.fixture(scope="module")
def rigid_body():
    shapes = [
        densarm.Box(name="block", size=(0.2, 0.3, 0.4), position=(0.1, 0.0, -0.1)),
        densarm.Capsule(name="pin", radius=0.05, length=0.6, position=(0.0, 0.2, 0.0)),
    ]
    return densarm.free_body(shapes, densarm.Freedom.RIGID_BODY, CUBE, mass=3.0)


@given(st.tuples(coordinate, coordinate, coordinate))
def test_clearance_of_a_point_is_its_distance(point_and_ball, x):
    apart = np.array(x) - [0.3, -0.2, 0.1]
    length = np.linalg.norm(apart)
    assume(length > 1e-3)
    sample = point_and_ball.evaluate(x)
    assert sample.distance[0] == pytest.approx(length - 0.5, abs=1e-7)
    np.testing.assert_allclose(sample.gradient[0], apart / length, rtol=0, atol=1e-5)


@given(st.tuples(coordinate, coordinate))
def test_clearance_of_a_disc_is_its_distance_in_the_plane(disc_and_block, x):
    outside = np.abs(x) - [0.5, 0.3]
    signed = np.linalg.norm(np.maximum(outside, 0.0)) + min(outside.max(), 0.0)
    distance = disc_and_block.distances(np.array(x))
    if signed - 0.3 > 1e-4:
        assert distance == pytest.approx(signed - 0.3, abs=1e-7)
    else:
        assert distance < 1e-3


class Circle:
    """The signed distance to a circle about the origin."""

    def __init__(self, radius):
        self.radius = radius

    def __call__(self, x):
        return np.linalg.norm(x, axis=-1) - self.radius

    def gradient(self, x):
        return x / np.linalg.norm(x, axis=-1, keepdims=True)


@pytest.fixture(scope="module")
def densities():
    """The density of the plane around a disc: by an implicit function, and by coal."""
    goal, circle = np.array([1.5, 0.4]), Circle(0.5)
    by_function = EuclideanDensity([UnsafeRegion(circle, Lowered(circle, 0.6))], goal)
    arm = densarm.free_body(POINT, "plane", SQUARE)
    clearance = densarm.Clearance(arm, densarm.Scene([densarm.Sphere(name="disc", radius=0.5)]))
    by_coal = densarm.NavigationDensity(
        [densarm.ClearanceSet(clearance, 0.0, 0.6)],
        densarm.TorusDistance(arm, goal, weights=(2.0, 2.0), kappa=np.inf),
    )
    return by_function, by_coal


@given(st.floats(0.52, 2.0), angle)
def test_density_by_an_implicit_function_and_by_coal_agree(densities, radius, direction):
    by_function, by_coal = densities
    x = radius * np.array([np.cos(direction), np.sin(direction)])
    assume(np.linalg.norm(x - by_function.goal) > 1e-3)
    sample = by_coal.evaluate(x)
    assert sample.log_value == pytest.approx(by_function.log_value(x), rel=1e-6, abs=1e-6)
    for gauge in densarm.Gauge:
        expected = by_function.gradient(x, gauge)
        apart = np.linalg.norm(sample.gradient(gauge) - expected)
        assert apart <= 1e-5 * np.linalg.norm(expected)


@given(st.tuples(coordinate, coordinate, coordinate), st.tuples(angle, angle, angle))
def test_coordinates_are_position_then_yaw_pitch_roll(rigid_body, position, turns):
    yaw, pitch, roll = turns
    data = rigid_body.model.createData()
    pin.forwardKinematics(
        rigid_body.model, data, rigid_body.configuration([*position, yaw, pitch, roll])
    )
    turned = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    np.testing.assert_allclose(data.oMi[-1].rotation, turned, rtol=0, atol=1e-12)
    np.testing.assert_allclose(data.oMi[-1].translation, position, rtol=0, atol=1e-12)


def test_shapes_keep_their_order_and_kind(rigid_body):
    names = [item.name for item in rigid_body.collision_model.geometryObjects]
    assert sorted(names) == ["body_0", "body_1"]
    item = rigid_body.collision_model.geometryObjects[names.index("body_1")]
    assert type(item.geometry).__name__ == "Capsule"
    np.testing.assert_allclose(item.placement.translation, [0.0, 0.2, 0.0], rtol=0, atol=1e-12)


@given(st.tuples(angle, angle, angle), st.integers(0, 2**32 - 1))
def test_kinetic_energy_is_that_of_the_body(rigid_body, turns, seed):
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
def test_mass_matrix_is_regular_at_gimbal_lock(rigid_body, turns):
    q = rigid_body.configuration([0.0, 0.0, 0.0, turns[0], np.pi / 2, turns[1]])
    values = np.linalg.eigvalsh(rigid_body.mass_matrix(q))
    assert values[0] > 1e-6 * values[-1]


GAP = densarm.Scene(
    densarm.Box(name=name, size=(0.1, 1.0, 1.0), position=(0.0, y, 0.0))
    for name, y in (("left", 0.65), ("right", -0.65))
)


@pytest.fixture(scope="module")
def through_the_gap():
    """A bar 0.68 m long, across its way, and a gap 0.3 m wide."""
    arm = bar("plane + yaw", [(-1.2, 1.2), (-0.8, 0.8)])
    return densarm.Scenario(
        name="gap",
        title="Turn a bar to pass a gap",
        arm=arm,
        scene=GAP,
        start=arm.configuration([-0.8, 0.0, np.pi / 2]),
        goal=arm.configuration([0.8, 0.0, np.pi / 2]),
        control=densarm.ControlParameters(form="regulation"),
        simulation=SimulationParameters(dt=0.005),
    )


def plan(scenario, guide):
    clearance = densarm.Clearance(scenario.arm, scenario.scene)
    return densarm.plan_motion(scenario, clearance, guide)


def run_by_velocity(scenario, guide):
    way = plan(scenario, guide)
    plant = SingleIntegrator(scenario.arm, scenario.simulation.dt)
    run = FixedStepLoop(scenario.arm, plant, scenario.simulation).run(
        densarm.make_velocity_controller(scenario, way), scenario.start, scenario.goal
    )
    return run, SweptCheck(way.bound).check(run.q)


def test_a_body_passes_a_narrow_gap_only_when_turned(through_the_gap):
    run, proof = run_by_velocity(through_the_gap, "path")
    assert run.end == LoopEnd.REACHED
    assert proof.verdict == SweptVerdict.CLEAR
    x, _, yaw = through_the_gap.arm.angles(run.q).T
    inside = np.abs(x) < 0.02
    assert inside.any()
    assert (np.abs(np.sin(yaw[inside])) < 0.5).all()


def test_without_a_path_it_stops_before_the_gap(through_the_gap):
    run, proof = run_by_velocity(through_the_gap, "direct")
    assert run.end == LoopEnd.STALLED
    assert proof.verdict == SweptVerdict.CLEAR
    assert (through_the_gap.arm.angles(run.q)[:, 0] < 0.0).all()


def test_by_force_the_run_is_certified_and_rebuilt_from_its_file(through_the_gap, tmp_path):
    run = densarm.simulate(through_the_gap)
    assert run.outcome == densarm.Outcome.REACHED
    assert run.certified
    run.save(tmp_path / "run.npz")
    again = densarm.Trajectory.load(tmp_path / "run.npz")
    assert again.scenario.arm.description == run.scenario.arm.description
    assert again.certified


def test_torque_turns_a_body_through_gimbal_lock(rigid_body):
    run = densarm.simulate(
        densarm.Scenario(
            name="lock",
            title="Pitch over",
            arm=rigid_body,
            scene=densarm.Scene(),
            start=rigid_body.configuration(np.zeros(6)),
            goal=rigid_body.configuration([0.0, 0.3, 0.0, 0.3, np.pi, -0.2]),
            simulation=SimulationParameters(dt=0.005),
        )
    )
    assert run.outcome == densarm.Outcome.REACHED
    assert run.certified


class Blind:
    def velocity(self, t, q, v):  # noqa: ARG002
        return np.array([1.0, 0.0])


def test_a_run_through_an_obstacle_is_not_proved_clear():
    arm = densarm.free_body(densarm.Sphere(name="disc", radius=0.01), "plane", SQUARE, name="disc")
    wall = densarm.Box(name="wall", size=(0.02, 1.0, 1.0))
    clearance = densarm.Clearance(arm, densarm.Scene([wall]))
    p = SimulationParameters(dt=0.2, time_limit=2.0)  # each step jumps over the wall
    plant = SingleIntegrator(arm, p.dt)
    run = FixedStepLoop(arm, plant, p).run(Blind(), np.array([-0.9, 0.0]), np.array([1.1, 0.0]))
    assert all(clearance.distances(q) > 0.05 for q in run.q)
    proof = SweptCheck(densarm.SweptBound(clearance)).check(run.q)
    assert proof.verdict == SweptVerdict.CONTACT
    assert proof.pairs == (("disc_0", "wall"),)


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
def test_values_out_of_range_are_refused(change, message):
    arguments = {"shapes": POINT, "freedom": "plane", "bounds": SQUARE} | change
    with pytest.raises(InvalidValueError, match=message):
        densarm.free_body(**arguments)
