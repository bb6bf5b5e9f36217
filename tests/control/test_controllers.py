"""Every controller: torque of the right shape within limits from any state, usable alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.control.controller import Controller
from densarm.control.regulation import DensityRegulation
from densarm.errors import InvalidValueError
from densarm.planning.guide import GuidePath
from densarm.scenarios.control import ControlForm
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

Maker = Callable[[str], Controller]


@pytest.fixture(scope="module", params=ControlForm)
def controller(request: pytest.FixtureRequest, make_controller: Maker) -> Controller:
    return make_controller(request.param)


vectors = arrays(float, 2, elements=st.floats(-6.0, 6.0))


@pytest.mark.slow
@settings(max_examples=300)
@given(t=st.floats(0.0, 5.0), angles=vectors, v=vectors)
def test_torque_from_any_state(
    swing_up: Scenario, controller: Controller, t: float, angles: Array, v: Array
) -> None:
    """In contact too, where the density is zero."""
    tau = controller.torque(t, swing_up.arm.configuration(angles), v)
    assert tau.shape == (2,)
    assert tau.dtype == np.float64
    assert (np.abs(tau) <= swing_up.arm.limits.effort).all()


def test_torque_is_the_callers_own(swing_up: Scenario, controller: Controller) -> None:
    first = controller.torque(0.0, swing_up.start, np.zeros(2))
    kept = first.copy()
    controller.torque(0.1, swing_up.start, np.ones(2))
    np.testing.assert_array_equal(first, kept)


def test_plain_lists_are_states_too(swing_up: Scenario, controller: Controller) -> None:
    assert controller.torque(0.0, swing_up.start.tolist(), [0, 0]).shape == (2,)


@pytest.mark.parametrize(
    ("q", "v", "message"),
    [
        ([0.0, 0.0], [0.0, 0.0], r"configuration.*\(4,\), got \(2,\).*arm.configuration"),
        ([1, 0, 1, 0], [0.0], r"velocity.*\(2,\), got \(1,\)"),
        ([1, 0, 1, np.nan], [0, 0], "configuration.*finite"),
        ([1, 0, 1, 0], [np.inf, 0], "velocity.*finite"),
        ([2, 0, 1, 0], [0, 0], r"'shoulder'.*\(cos, sin\)"),
        ([[1, 0, 1, 0]], [0, 0], r"configuration.*\(4,\), got \(1, 4\)"),
        (np.array([[1.0, 0.0, 1.0, 0.0]]), np.zeros(2), r"configuration.*\(4,\), got \(1, 4\)"),
        ("upright", [0, 0], "configuration = 'upright'.*4 numbers"),
        (None, [0, 0], "configuration = None.*4 numbers"),
    ],
)
def test_a_state_that_is_not_one(controller: Controller, q: Any, v: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        controller.torque(0.0, q, v)


def test_reaches_the_goal_in_a_loop_of_ones_own(swing_up: Scenario, make_controller: Maker) -> None:
    arm, world, dt = swing_up.arm, swing_up.world, 0.001
    controller, data = make_controller("tracking"), arm.model.createData()
    q, v = swing_up.start, np.zeros(arm.nv)
    for k in range(2500):
        tau = controller.torque(k * dt, q, v)
        v = v + dt * pin.aba(arm.model, data, q, v, tau)
        q = pin.integrate(arm.model, q, dt * v)
        assert world.distances(q).min() > 0.0
    assert np.abs(arm.difference(q, swing_up.goal)).max() < 1e-3
    assert np.abs(v).max() < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(("plain", "is_clear"), [(False, True), (True, False)])
def test_a_run_is_that_of_all_pairs_queried_to_the_last_bit(
    plain: bool, is_clear: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario("panda_table")
    arm, world = scenario.arm, scenario.world
    goal = arm.integrate(scenario.start, 0.3 * np.random.default_rng(1).uniform(-1, 1, arm.nv))
    assert SweptCheck(world).segment_is_clear(scenario.start, goal)
    path = GuidePath(np.array([scenario.start, goal]), is_clear)
    update, awake, wakes = ActivePairs.update, list[int](), False

    def watched(pairs: ActivePairs, q: Array) -> None:
        if wakes:
            pairs.wake_all()
        update(pairs, q)
        awake.append(int(np.count_nonzero(pairs.state)))

    monkeypatch.setattr(ActivePairs, "update", watched)
    lazy = states_along(world, path, plain)
    assert np.mean(awake) < 0.2 * world.n_pairs
    awake, wakes = [], True
    every = states_along(world, path, plain)
    assert min(awake) == world.n_pairs
    np.testing.assert_array_equal(lazy, every)


def states_along(world: World, path: GuidePath, plain: bool) -> Array:
    """States and torques in a loop of one's own."""
    arm = world.arm
    controller = DensityRegulation(world, path.waypoints[-1], path=path, plain=plain, period=0.002)
    data, states, q, v = arm.model.createData(), [], path.waypoints[0], np.zeros(arm.nv)
    for k in range(300):
        tau = controller.torque(0.002 * k, q, v)
        v = v + 0.002 * pin.aba(arm.model, data, q, v, tau)
        q = arm.integrate(q, 0.002 * v)
        states.append([*q, *v, *tau])
    return np.array(states)
