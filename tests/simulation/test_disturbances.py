"""Disturbances: what each does to either plant, and to the loop."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from densarm.arms.arm import load_arm
from densarm.certificates.task import PLANTS, Integrator, SimulationParameters
from densarm.errors import DensarmError, InvalidValueError, UnknownNameError
from densarm.scene.scene import Scene
from densarm.simulation.disturbances import Disturbances, Push
from densarm.simulation.plants import PinocchioPlant, Plant
from densarm.simulation.simulate import plant_of, simulate
from densarm.values.arrays import Array
from densarm.world.world import World

DT = 1e-3


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_arm("two_link"), Scene())


@pytest.fixture(scope="module")
def panda() -> World:
    return World(load_arm("panda"), Scene())


def plant_named(world: World, name: str, **disturbances: Any) -> Plant:
    return plant_of(world, name, SimulationParameters(dt=DT), Disturbances(**disturbances))


def acceleration(plant: Plant, q: Array, v: Array, tau: Array) -> Array:
    return (plant.step(q, v, tau)[1] - v) / plant.dt


class Recording:
    """No torque, noting what is measured."""

    def __init__(self, tau: Array) -> None:
        self.tau, self.q, self.v = tau, list[Array](), list[Array]()

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        self.q.append(np.array(q))
        self.v.append(np.array(v))
        return self.tau + t


@pytest.mark.parametrize("name", PLANTS)
def test_holding_torque_of_a_disturbed_arm(panda: World, name: str) -> None:
    arm, offset = panda.arm, (0.01, 0.02, 0.03)
    told = {"mass_scale": 1.1, "payload": 2.0, "payload_offset": offset, "base_tilt_deg": 5.0}
    plant = plant_named(panda, name, **told)
    q, v = arm.postures["ready"], np.zeros(arm.nv)
    pin.framesForwardKinematics(arm.model, arm.data, q)
    # Gravity leans against the turn of the base about x.
    lean = np.deg2rad(5.0)
    gravity = 9.81 * np.array([0.0, -np.sin(lean), -np.cos(lean)])
    pin.computeJointJacobians(arm.model, arm.data, q)
    frame = arm.data.oMf[arm.end_effector_frame]
    weights = [
        (2.0, arm.model.frames[arm.end_effector_frame].parentJoint, frame.act(np.array(offset)))
    ]
    for joint in range(1, arm.model.njoints):
        body = arm.model.inertias[joint]
        weights.append((1.1 * body.mass, joint, arm.data.oMi[joint].act(body.lever)))
    hold = np.zeros(arm.nv)
    for mass, joint, point in weights:
        jacobian = pin.getJointJacobian(
            arm.model, arm.data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        lever = pin.skew(point - arm.data.oMi[joint].translation)
        hold -= mass * (jacobian[:3] - lever @ jacobian[3:]).T @ gravity
    np.testing.assert_allclose(acceleration(plant, q, v, hold), 0.0, atol=1e-9)
    assert np.abs(acceleration(plant_named(panda, name), q, v, hold)).max() > 1.0


@pytest.mark.parametrize("name", PLANTS)
def test_armature_and_viscous_friction(world: World, name: str) -> None:
    arm, q = world.arm, world.arm.configuration([0.3, 0.4])
    v, tau, rotor, drag = np.array([0.2, -0.3]), np.array([1.0, 2.0]), (0.5, 0.25), 0.7
    plant = plant_named(world, name, armature=rotor, viscous=drag)
    mass = arm.mass_matrix(q) + np.diag(rotor)
    expected = np.linalg.solve(mass, tau - arm.nonlinear_effects(q, v) - drag * v)
    np.testing.assert_allclose(acceleration(plant, q, v, tau), expected, rtol=0.01)


@pytest.mark.parametrize("name", PLANTS)
def test_dry_friction_slows_and_holds(world: World, name: str) -> None:
    arm, dry = world.arm, 0.5
    plant = plant_named(world, name, coulomb=dry)
    q, v = arm.configuration([0.3, 0.4]), np.array([1.0, 1.0])
    tau = arm.nonlinear_effects(q, v)
    expected = -np.linalg.solve(arm.mass_matrix(q), np.full(2, dry))
    found = acceleration(plant, q, v, tau)
    np.testing.assert_allclose(found, expected, rtol=0.05, atol=0.05)
    still, hold = np.zeros(2), arm.nonlinear_effects(q, np.zeros(2))
    at = q, still
    for _ in range(200):
        at = plant.step(*at, hold + 0.8 * dry)
    crept = {"pinocchio": 1e-9, "mujoco": 5e-2}[name]  # MuJoCo's friction is soft
    assert np.abs(at[1]).max() < crept
    for _ in range(200):
        at = plant.step(*at, hold + 3.0 * dry)
    assert np.abs(at[1]).max() > 0.1


@given(
    angles=st.lists(st.floats(-2.0, 2.0), min_size=7, max_size=7),
    speeds=st.lists(st.floats(-1.0, 1.0) | st.just(0.0), min_size=7, max_size=7),
    extra=st.lists(st.floats(-5.0, 5.0), min_size=7, max_size=7),
    dry=st.lists(st.floats(0.0, 3.0), min_size=7, max_size=7),
)
@settings(max_examples=50, deadline=None)
def test_dry_friction_is_within_bounds_and_against_the_motion(
    panda: World, angles: list[float], speeds: list[float], extra: list[float], dry: list[float]
) -> None:
    arm, most, v = panda.arm, np.array(dry), np.array(speeds)
    q = arm.configuration(angles)
    bias, mass = arm.nonlinear_effects(q, v), arm.mass_matrix(q)
    _, after = plant_named(panda, "pinocchio", coulomb=tuple(dry)).step(q, v, bias + extra)
    friction = np.array(extra) - mass @ (after - v) / DT
    assert (np.abs(friction) <= most + 1e-6).all()
    np.testing.assert_allclose(friction * after, most * np.abs(after), atol=1e-6)


def test_dry_friction_takes_energy_from_a_swing_until_it_rests(world: World) -> None:
    arm, plant = world.arm, plant_named(world, "pinocchio", coulomb=2.0)
    q, v = arm.configuration([1.0, 0.5]), np.zeros(2)
    for _ in range(6000):
        q, v = plant.step(q, v, np.zeros(2))
    np.testing.assert_array_less(np.abs(v), 1e-12)
    assert (np.abs(arm.nonlinear_effects(q, np.zeros(2))) <= 2.0 + 1e-9).all()


@pytest.mark.parametrize("name", PLANTS)
def test_a_push_adds_its_velocity(world: World, name: str) -> None:
    push = Push(time=0.05, joint=world.arm.joint_names[1], velocity=2.0)
    start, still = world.arm.configuration([0.0, 0.0]), Recording(np.zeros(2))
    parameters = SimulationParameters(dt=DT, time_limit=0.1)
    run = simulate(
        world,
        still,
        start,
        plant=name,
        disturbances=Disturbances(pushes=(push,)),
        parameters=parameters,
    )
    assert np.abs(run.v[:50]).max() < 0.2
    before, after = run.v[50, 1], run.v[70, 1]
    assert after - before == pytest.approx(2.0, abs=0.3)
    assert np.abs(np.diff(run.v[:, 1])).max() < 0.2  # evenly


def test_noise_is_measured_and_not_recorded(world: World) -> None:
    start, told = (
        world.arm.configuration([0.0, 0.0]),
        Disturbances(encoder_noise=1e-3, velocity_noise=1e-2),
    )
    parameters = SimulationParameters(dt=DT, time_limit=0.5)
    runs, controllers = [], []
    for _ in range(2):
        controllers.append(Recording(np.zeros(2)))
        runs.append(
            simulate(world, controllers[-1], start, disturbances=told, parameters=parameters)
        )
    noise_q = world.arm.difference(runs[0].q[:-1], np.array(controllers[0].q))
    noise_v = np.array(controllers[0].v) - runs[0].v[:-1]
    assert noise_q.std() == pytest.approx(1e-3, rel=0.1)
    assert noise_v.std() == pytest.approx(1e-2, rel=0.1)
    np.testing.assert_array_equal(controllers[0].q, controllers[1].q)


def test_torque_acts_later_and_in_steps(world: World) -> None:
    acted: list[Array] = []

    class Noting(PinocchioPlant):
        def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
            acted.append(u)
            return super().step(q, v, u)

    told = Disturbances(torque_delay=0.005, torque_quantum=0.02)
    parameters = SimulationParameters(dt=DT, time_limit=0.1)
    start = world.arm.configuration([0.0, 0.0])
    simulate(
        world,
        Recording(np.zeros(2)),
        start,
        plant=Noting(world.arm),
        disturbances=told,
        parameters=parameters,
    )
    sent = np.maximum(np.arange(100) - 5, 0) * DT
    np.testing.assert_allclose(np.array(acted)[:, 0], 0.02 * np.round(sent / 0.02), atol=1e-12)


def test_given_is_what_is_not_by_default() -> None:
    assert Disturbances().given == Disturbances(seed=3).given == {}
    assert Disturbances(payload=1.0, seed=3).given == {"payload": 1.0, "seed": 3}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coulomb": -0.5}, "^coulomb = -0.5: must be"),
        ({"viscous": (0.1, -1.0)}, "^viscous = -1"),
        ({"mass_scale": 0.0}, "^mass_scale = 0"),
        ({"torque_delay": float("nan")}, "^torque_delay = "),
        ({"payload_offset": (0.0, 1.0)}, "^payload_offset = "),
        ({"base_tilt_deg": 200.0}, "^base_tilt_deg = "),
    ],
)
def test_values_out_of_range_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        Disturbances(**change)


def test_disturbances_of_another_arm_are_refused(world: World) -> None:
    with pytest.raises(InvalidValueError, match=r"disturbances.coulomb = .*one per joint"):
        plant_named(world, "pinocchio", coulomb=(1.0, 2.0, 3.0))
    with pytest.raises(UnknownNameError, match=r"payload_frame 'hand'"):
        plant_named(world, "pinocchio", payload=1.0, payload_frame="hand")
    start, told = world.arm.postures["neutral"], Disturbances(pushes=(Push(0.0, "wrist", 1.0),))
    with pytest.raises(UnknownNameError, match=r"pushes.joint 'wrist'"):
        simulate(world, Recording(np.zeros(2)), start, disturbances=told)


def test_a_plant_of_ones_own_has_its_own_disturbances(world: World) -> None:
    start, own = world.arm.postures["neutral"], PinocchioPlant(world.arm)
    with pytest.raises(
        DensarmError, match=r"disturbances = \['payload'\]: must be those of the plant"
    ):
        simulate(
            world, Recording(np.zeros(2)), start, plant=own, disturbances=Disturbances(payload=1.0)
        )


def test_friction_is_not_stepped_by_rk4(world: World) -> None:
    with pytest.raises(InvalidValueError, match=r"^integrator = 'rk4'"):
        PinocchioPlant(world.arm, DT, Integrator.RK4, Disturbances(viscous=1.0))
