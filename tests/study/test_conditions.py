"""Conditions: a push, a mass and a ball that only plant and world know of."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from densarm.errors import DensarmError, InvalidValueError
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.plants import PinocchioPlant
from densarm.study.conditions import BALL, PASSING_TIME, PUSH_TIME, Condition
from densarm.values.arrays import Array
from densarm.world.configurations import infeasibility
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

STATE = np.array([0.3, 0.9]), np.array([0.5, -0.7]), np.array([3.0, 1.0])


@pytest.fixture(scope="module")
def scenario(swing_up: Scenario) -> Scenario:
    angles = swing_up.arm.configuration
    return replace(swing_up, start=angles([0.3, 0.4]), goal=angles([0.9, -1.2]))


def step(scenario: Scenario, condition: Condition) -> tuple[Array, Array]:
    angles, v, tau = STATE
    _, plant = condition.applied(scenario, (0, 0))
    return plant.step(scenario.arm.configuration(angles), v, tau)


def test_undisturbed_is_the_model(scenario: Scenario) -> None:
    angles, v, tau = STATE
    known = PinocchioPlant(scenario.arm, 0.001).step(scenario.arm.configuration(angles), v, tau)
    found, plant = Condition().applied(scenario, (0, 0))
    assert found is scenario
    np.testing.assert_array_equal(step(scenario, Condition())[1], known[1])
    assert plant.dt == 0.001


@pytest.mark.parametrize("name", ["swing_up", "panda_table"])
def test_a_payload_is_a_mass_at_the_end_effector(name: str) -> None:
    """M + m JᵀJ and H + m Jᵀ (J̇ v - g), from the model without it."""
    loaded, mass = load_scenario(name), 0.8
    arm, dt = loaded.arm, loaded.simulation.dt
    q, v = loaded.start, np.linspace(-0.5, 0.7, arm.nv)
    tau = np.linspace(1.0, -2.0, arm.nv)
    model, data, frame = arm.model, arm.model.createData(), arm.end_effector_frame
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.updateFramePlacements(model, data)
    world = pin.LOCAL_WORLD_ALIGNED
    jacobian = pin.getFrameJacobian(model, data, frame, world)[:3]
    rate = pin.getFrameJacobianTimeVariation(model, data, frame, world)[:3]
    drift = rate @ v  # of the point itself, whose axes do not turn
    inertia = arm.mass_matrix(q) + mass * jacobian.T @ jacobian
    load = mass * jacobian.T @ (drift - model.gravity.linear)
    expected = np.linalg.solve(inertia, tau - arm.nonlinear_effects(q, v) - load)
    _, plant = Condition(payload=mass).applied(loaded, (0, 0))
    np.testing.assert_allclose((plant.step(q, v, tau)[1] - v) / dt, expected, rtol=1e-6, atol=1e-6)


def test_a_push_comes_once_to_every_joint(scenario: Scenario) -> None:
    pushed, still = (Condition(push=x).applied(scenario, (4, 2))[1] for x in (0.7, 0.0))
    q, zero = scenario.start, np.zeros(2)
    gains = [
        pushed.step(q, zero, zero)[1] - still.step(q, zero, zero)[1]
        for _ in range(round(2.0 * PUSH_TIME / 0.001))
    ]
    when = np.flatnonzero(np.abs(gains).max(axis=1) > 0.1)
    assert when.tolist() == [round(PUSH_TIME / 0.001)]
    np.testing.assert_allclose(np.abs(gains[when[0]]), 0.7, atol=0.05)


def test_the_ball_crosses_the_middle_of_the_way(scenario: Scenario) -> None:
    condition = Condition(moving=0.5)
    found, plant = condition.applied(scenario, (1, 0))
    arm, ends = scenario.arm, {"start": scenario.start, "goal": scenario.goal}
    assert not infeasibility(SweptCheck(World(arm, found.scene), 0.0), ends)
    positions = [np.array(found.scene.obstacles[-1].position)]
    for _ in range(round(PASSING_TIME / plant.dt)):
        plant.step(scenario.start, np.zeros(2), np.zeros(2))
        ball = next(item for item in found.world.scene if item.name == BALL)
        positions.append(np.array(ball.position))
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    np.testing.assert_allclose(steps, 0.5 * plant.dt)
    middle = arm.integrate(scenario.start, 0.5 * arm.difference(scenario.start, scenario.goal))
    pin.framesForwardKinematics(arm.model, arm.data, middle)
    tip = arm.data.oMf[arm.end_effector_frame].translation
    np.testing.assert_allclose(positions[-1], tip, atol=1e-9)
    again = condition.applied(scenario, (1, 0))[0].scene.obstacles[-1]
    assert again == found.scene.obstacles[-1]


def test_wrong_input(scenario: Scenario) -> None:
    with pytest.raises(InvalidValueError, match="push = -1"):
        Condition(push=-1.0)
    with pytest.raises(InvalidValueError, match="payload = nan"):
        Condition(payload=float("nan"))
    with pytest.raises(DensarmError, match="too near to start and goal"):
        Condition(moving=1e-3).applied(replace(scenario, goal=scenario.start), (0, 0))


def test_names_tell_the_size() -> None:
    names = [Condition().name, Condition(push=1.0).name, Condition(payload=0.5, moving=0.25).name]
    assert names == ["undisturbed", "push 1 rad/s", "payload 0.5 kg, moving 0.25 m/s"]
