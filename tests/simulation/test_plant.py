"""The plant: conservation of energy, orders of the integrators, an independent engine."""

import xml.etree.ElementTree as ElementTree
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from densarm.arm import Arm, load_arm
from densarm.simulation import Integrator, PinocchioPlant

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
GRAVITY_TORQUE = 30.0  # [N·m], of the two-link arm at most


@pytest.fixture(scope="module")
def two_link() -> Arm:
    return load_arm("two_link")


@pytest.fixture(scope="module")
def branching() -> Arm:
    """An arm with continuous, revolute and prismatic joints."""
    return load_arm(BRANCHING, locked_joints={})


def states(arm: Arm, integrator: Integrator, dt: float, duration: float, q, v, torque):
    plant = PinocchioPlant(arm, dt, integrator)
    yield q, v
    for k in range(round(duration / dt)):
        q, v = plant.step(q, v, torque(k * dt))
        yield q, v


def energy(arm: Arm, q, v) -> float:
    kinetic = 0.5 * v @ arm.mass_matrix(q) @ v
    return kinetic + pin.computePotentialEnergy(arm.model, arm.data, q)


def test_rk4_keeps_the_energy_of_the_undamped_arm(two_link):
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
def test_order_by_step_halving(request, name, integrator, order):
    arm = request.getfixturevalue(name)
    rng = np.random.default_rng(0)
    q, v, tau = arm.configuration(0.1 * rng.normal(size=arm.nv)), rng.normal(size=arm.nv), 0.1
    coarsest = {1: 1e-3, 4: 1e-2}[order]

    def end(dt):
        *_, last = states(arm, integrator, dt, 0.2, q, v, lambda _: np.full(arm.nv, tau))
        return last

    ends = [end(coarsest / 2**halving) for halving in range(4)]
    steps = [np.concatenate([arm.difference(a[0], b[0]), a[1] - b[1]]) for a, b in pairwise(ends)]
    ratios = [np.linalg.norm(a) / np.linalg.norm(b) for a, b in pairwise(steps)]
    assert np.log2(ratios) == pytest.approx(order, abs=0.25)


def test_state_stays_a_configuration(branching):
    rng = np.random.default_rng(1)
    q, v = branching.configuration(rng.normal(size=branching.nv)), np.ones(branching.nv)
    plant = PinocchioPlant(branching, 1e-3, Integrator.SEMI_IMPLICIT_EULER)
    for _ in range(200):
        q, v = plant.step(q, v, np.zeros(branching.nv))
    branching.check_configuration("q", q)
    assert v.shape == (branching.nv,)


def test_a_step_changes_neither_its_arguments_nor_the_last_result(two_link):
    plant = PinocchioPlant(two_link, 1e-3, Integrator.RK4)
    q, v, tau = two_link.configuration([0.3, 0.4]), np.ones(2), np.array([1.0, 2.0])
    copies = q.copy(), v.copy(), tau.copy()
    first = plant.step(q, v, tau)
    kept = first[0].copy(), first[1].copy()
    plant.step(*first, tau)
    np.testing.assert_array_equal(np.concatenate(copies), np.concatenate([q, v, tau]))
    np.testing.assert_array_equal(np.concatenate(kept), np.concatenate(first))


@pytest.mark.parametrize("integrator", Integrator)
def test_mujoco_moves_the_arm_alike(two_link, integrator):
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

    def torque(t):
        return np.array([8.0 * np.sin(3.0 * t), 4.0 * np.cos(5.0 * t)])

    def held(t):  # over MuJoCo's steps
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
