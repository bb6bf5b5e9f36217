"""Every controller: torque of the right shape within limits from any state, usable alone."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.clearance import Clearance
from densarm.closed_loop import make_controller
from densarm.control.gains import Gains
from densarm.density import NearPairs
from densarm.errors import InvalidValueError
from densarm.guides import GuidePath
from densarm.motion_plan import MotionPlan, plan_motion
from densarm.proof.swept_bound import SweptBound
from densarm.scenario import ControlForm, GuideKind, load_scenario


@pytest.fixture(scope="module", params=ControlForm)
def setting(request):
    """A scenario and a maker of its controller in each form."""
    scenario = load_scenario("swing_up")
    scenario = replace(scenario, control=replace(scenario.control, form=request.param))
    clearance = Clearance(scenario.arm, scenario.scene)
    return scenario, make_controller(scenario, plan_motion(scenario, clearance, GuideKind.PATH))


vectors = arrays(float, 2, elements=st.floats(-6.0, 6.0))


@settings(max_examples=300)
@given(t=st.floats(0.0, 5.0), angles=vectors, v=vectors)
def test_torque_from_any_state(setting, t, angles, v):
    """In contact too, where the density is zero."""
    scenario, controller = setting
    tau = controller.torque(t, scenario.arm.configuration(angles), v)
    assert tau.shape == (2,)
    assert tau.dtype == np.float64
    assert (np.abs(tau) <= scenario.arm.limits.effort).all()


def test_torque_is_the_callers_own(setting):
    scenario, controller = setting
    q = scenario.start
    first = controller.torque(0.0, q, np.zeros(2))
    kept = first.copy()
    controller.torque(0.1, q, np.ones(2))
    np.testing.assert_array_equal(first, kept)


def test_plain_lists_are_states_too(setting):
    scenario, controller = setting
    assert controller.torque(0.0, scenario.start.tolist(), [0, 0]).shape == (2,)


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
def test_a_state_that_is_not_one(setting, q, v, message):
    _, controller = setting
    with pytest.raises(InvalidValueError, match=message):
        controller.torque(0.0, q, v)


def test_reaches_the_goal_in_a_loop_of_ones_own():
    scenario = load_scenario("swing_up")
    arm, clearance = scenario.arm, Clearance(scenario.arm, scenario.scene)
    controller = make_controller(scenario, plan_motion(scenario, clearance, GuideKind.PATH))
    data, dt = arm.model.createData(), 0.001
    q, v = scenario.start, np.zeros(arm.nv)
    for k in range(2500):
        tau = controller.torque(k * dt, q, v)
        v = v + dt * pin.aba(arm.model, data, q, v, tau)
        q = pin.integrate(arm.model, q, dt * v)
        assert clearance.distances(q).min() > 0.0
    assert np.abs(arm.difference(q, scenario.goal)).max() < 1e-3
    assert np.abs(v).max() < 1e-3


@pytest.mark.parametrize("key", ["position", "velocity"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "high"])
def test_gains_are_checked(key, value):
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        Gains(**{key: value})


@pytest.fixture(scope="module")
def panda_table():
    return load_scenario("panda_table")


@pytest.mark.parametrize(
    ("form", "is_clear"), [(ControlForm.REGULATION, True), (ControlForm.PLAIN, False)]
)
def test_a_run_is_that_of_all_pairs_queried_to_the_last_bit(
    panda_table, form, is_clear, monkeypatch
):
    scenario = replace(panda_table, control=replace(panda_table.control, form=form))
    arm, bound = scenario.arm, SweptBound(Clearance(scenario.arm, scenario.scene))
    goal = arm.integrate(scenario.start, 0.3 * np.random.default_rng(1).uniform(-1, 1, arm.nv))
    assert bound.segment_is_clear(scenario.start, goal)
    path = GuidePath(np.array([scenario.start, goal]), is_clear)
    lazy = run_along(MotionPlan(scenario, path, bound))
    sleep = NearPairs.update

    def wake_and_update(pairs, q, margin):
        pairs.wake_all()
        sleep(pairs, q, margin)

    monkeypatch.setattr(NearPairs, "update", wake_and_update)
    states, awake = run_along(MotionPlan(scenario, path, bound))
    assert awake.min() == bound.clearance.n_pairs
    assert lazy[1].mean() < 0.2 * bound.clearance.n_pairs
    np.testing.assert_array_equal(lazy[0], states)


def run_along(plan: MotionPlan) -> tuple[np.ndarray, np.ndarray]:
    """States with their sub-goals, and numbers of pairs awake, in a loop of one's own."""
    arm, guided = plan.scenario.arm, plan.guided
    controller, data = make_controller(plan.scenario, plan), arm.model.createData()
    states, awake, q, v = [], [], plan.scenario.start, np.zeros(arm.nv)
    for k in range(300):
        tau = controller.torque(0.002 * k, q, v)
        v = v + 0.002 * pin.aba(arm.model, data, q, v, tau)
        q = arm.integrate(q, 0.002 * v)
        states.append([*q, *v, guided.chain.current])
        awake.append(np.count_nonzero(guided.distances.state))
    return np.array(states), np.array(awake)
