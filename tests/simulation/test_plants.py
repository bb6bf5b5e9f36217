"""Plants: conservation of energy, orders of the integrators, an independent engine, noise."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.joint_space import EuclideanSpace
from densarm.certificates.task import Input, Integrator
from densarm.errors import InvalidValueError
from densarm.simulation.plants import NoiseScaling, PinocchioPlant, SingleIntegrator
from densarm.values.arrays import Array

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
GRAVITY_TORQUE = 30.0  # [N·m], of the two-link arm at most


@pytest.fixture(scope="module")
def two_link() -> Arm:
    return load_arm("two_link")


@pytest.fixture(scope="module")
def branching() -> Arm:
    """An arm with continuous, revolute and prismatic joints."""
    return load_arm(BRANCHING, locked_joints={})


def states(
    arm: Arm,
    integrator: Integrator,
    dt: float,
    duration: float,
    q: Array,
    v: Array,
    torque: Callable[[float], Array],
) -> Iterator[tuple[Array, Array]]:
    plant = PinocchioPlant(arm, dt, integrator)
    yield q, v
    for k in range(round(duration / dt)):
        q, v = plant.step(q, v, torque(k * dt))
        yield q, v


def energy(arm: Arm, q: Array, v: Array) -> float:
    kinetic = float(0.5 * v @ arm.mass_matrix(q) @ v)
    return kinetic + float(pin.computePotentialEnergy(arm.model, arm.data, q))


@pytest.mark.slow
def test_rk4_keeps_the_energy_of_the_undamped_arm(two_link: Arm) -> None:
    start = two_link.configuration([2.5, -1.0])
    run = states(two_link, Integrator.RK4, 1e-3, 10.0, start, np.zeros(2), lambda _: np.zeros(2))
    energies = np.array([energy(two_link, *state) for state in run])
    swing = 2.0 * GRAVITY_TORQUE
    assert np.abs(energies - energies[0]).max() < 1e-4 * swing
    assert np.abs(energies - energies[0]).max() < 1e-4  # [J]


@pytest.mark.parametrize(
    ("integrator", "order"), [(Integrator.SEMI_IMPLICIT_EULER, 1), (Integrator.RK4, 4)]
)
@pytest.mark.parametrize("name", ["two_link", "branching"])
def test_order_by_step_halving(
    request: pytest.FixtureRequest, name: str, integrator: Integrator, order: int
) -> None:
    arm = request.getfixturevalue(name)
    rng = np.random.default_rng(0)
    q, v, tau = arm.configuration(0.1 * rng.normal(size=arm.nv)), rng.normal(size=arm.nv), 0.1
    coarsest = {1: 1e-3, 4: 1e-2}[order]

    def end(dt: float) -> tuple[Array, Array]:
        *_, last = states(arm, integrator, dt, 0.2, q, v, lambda _: np.full(arm.nv, tau))
        return last

    ends = [end(coarsest / 2**halving) for halving in range(4)]
    steps = [np.concatenate([arm.difference(a[0], b[0]), a[1] - b[1]]) for a, b in pairwise(ends)]
    ratios = [np.linalg.norm(a) / np.linalg.norm(b) for a, b in pairwise(steps)]
    assert np.log2(ratios) == pytest.approx(order, abs=0.25)


def test_state_stays_a_configuration(branching: Arm) -> None:
    rng = np.random.default_rng(1)
    q, v = branching.configuration(rng.normal(size=branching.nv)), np.ones(branching.nv)
    plant = PinocchioPlant(branching, 1e-3, Integrator.SEMI_IMPLICIT_EULER)
    for _ in range(200):
        q, v = plant.step(q, v, np.zeros(branching.nv))
    branching.check_configuration("q", q)
    assert v.shape == (branching.nv,)


def test_a_step_changes_neither_its_arguments_nor_the_last_result(two_link: Arm) -> None:
    plant = PinocchioPlant(two_link, 1e-3, Integrator.RK4)
    q, v, tau = two_link.configuration([0.3, 0.4]), np.ones(2), np.array([1.0, 2.0])
    copies = q.copy(), v.copy(), tau.copy()
    first = plant.step(q, v, tau)
    kept = first[0].copy(), first[1].copy()
    plant.step(*first, tau)
    np.testing.assert_array_equal(np.concatenate(copies), np.concatenate([q, v, tau]))
    np.testing.assert_array_equal(np.concatenate(kept), np.concatenate(first))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", Integrator)
def test_mujoco_moves_the_arm_alike(two_link: Arm, integrator: Integrator) -> None:
    mujoco = pytest.importorskip("mujoco")
    root = ElementTree.fromstring(two_link.description.urdf)
    for link in root.iter("link"):
        for item in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(item)
    model = mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    dt = {Integrator.RK4: 1e-3, Integrator.SEMI_IMPLICIT_EULER: 2e-5}[integrator]
    model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)

    def torque(t: float) -> Array:
        return np.array([8.0 * np.sin(3.0 * t), 4.0 * np.cos(5.0 * t)])

    def held(t: float) -> Array:  # over MuJoCo's steps
        return torque(1e-3 * np.floor(t / 1e-3 + 1e-6))

    data.qpos[:] = [0.4, -0.7]
    for k in range(1000):
        data.qfrc_applied[:] = torque(1e-3 * k)
        mujoco.mj_step(model, data)
    start = two_link.configuration([0.4, -0.7])
    *_, (q, v) = states(two_link, integrator, dt, 1.0, start, np.zeros(2), held)
    tolerance = {Integrator.RK4: 1e-8, Integrator.SEMI_IMPLICIT_EULER: 2e-3}[integrator]
    apart = two_link.difference(two_link.configuration(data.qpos), q)
    np.testing.assert_allclose(apart, 0.0, rtol=0, atol=tolerance)
    np.testing.assert_allclose(v, data.qvel, rtol=0, atol=10 * tolerance)


# The single integrator.

PLANE = EuclideanSpace(2)


def test_moves_by_the_control() -> None:
    x, v = SingleIntegrator(PLANE, 0.1).step(np.ones(2), np.zeros(2), np.array([1.0, -2.0]))
    np.testing.assert_allclose(x, [1.1, 0.8])
    np.testing.assert_array_equal(v, [1.0, -2.0])


@pytest.mark.parametrize(
    ("scaling", "variance"), [(NoiseScaling.HELD, 4e-6), (NoiseScaling.WHITE, 4e-4)]
)
def test_variance_of_a_step_follows_the_scaling(scaling: NoiseScaling, variance: float) -> None:
    plant = SingleIntegrator(PLANE, 0.01, 0.04, scaling)
    zero = np.zeros((100_000, 2))
    x, _ = plant.step(zero, zero, zero)
    assert x.var() == pytest.approx(variance, rel=0.02)
    assert abs(x.mean()) < 0.02 * np.sqrt(variance)


def test_same_seed_same_noise() -> None:
    zero = np.zeros(3)
    plants = [SingleIntegrator(EuclideanSpace(3), 0.1, 1.0, seed=seed) for seed in (5, 5, 6)]
    runs = [plant.step(zero, zero, zero)[0] for plant in plants]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert (runs[0] != runs[2]).all()


def test_moves_an_arm_within_its_joint_space(branching: Arm) -> None:
    arm = branching  # with a continuous joint
    plant = SingleIntegrator(arm, 0.1)
    q, u = arm.configuration(np.full(arm.nv, 0.3)), np.linspace(-1.0, 1.0, arm.nv)
    start, turned = q, np.zeros(arm.nv)
    for _ in range(50):
        q, v = plant.step(q, turned, u)
    arm.check_configuration("q", q)
    np.testing.assert_array_equal(v, u)
    np.testing.assert_allclose(arm.difference(arm.integrate(start, 5.0 * u), q), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"dt": 0.0}, "^dt = "), ({"scaling": "pink"}, "^scaling = "), ({"noise": -1.0}, "^noise = ")],
)
def test_values_out_of_range_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        SingleIntegrator(PLANE, **{"dt": 0.1, **change})


def test_plants_tell_what_they_are_told() -> None:
    assert PinocchioPlant.input == Input.TORQUE
    assert SingleIntegrator.input == Input.VELOCITY
