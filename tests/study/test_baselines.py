"""Every baseline: reaches in an easy scene without contact, and says why where it does not."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm, load_arm
from densarm.control.controller import Gains
from densarm.control.tracking import DensityTracking
from densarm.planning.motion import Motion, PlanningError
from densarm.scenarios.run import run_by
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study.baselines import BASELINES, ComputedTorque
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome

FIELDS = [
    "density_direct",
    "density_moving",
    "potential_field",
    "navigation_function",
    "cbf_qp",
]
PERIOD = 0.001


@pytest.fixture(scope="module")
def panda() -> Scenario:
    """Panda lifts its hand past a small ball, which lies off the straight way."""
    scenario = load_scenario("panda_table")
    ready = scenario.arm.postures["ready"]
    ball = Sphere(name="ball", radius=0.04, position=(0.45, 0.25, 0.75))
    return replace(scenario, scene=Scene([ball]), start=ready, goal=ready + 0.3)


@pytest.fixture(scope="module")
def coarse(swing_up: Scenario) -> Scenario:
    """The swing-up in steps of 2 ms, since an arm that rests is waited for."""
    return replace(swing_up, simulation=replace(swing_up.simulation, dt=0.002))


@pytest.fixture(scope="module")
def easy(swing_up: Scenario) -> Scenario:
    angles = swing_up.arm.configuration
    return replace(swing_up, start=angles([0.3, 0.4]), goal=angles([0.6, -1.2]))


@pytest.mark.slow
@pytest.mark.parametrize("name", BASELINES)
@pytest.mark.parametrize("scene", ["easy", "panda"])
def test_reaches_in_an_easy_scene(request: pytest.FixtureRequest, scene: str, name: str) -> None:
    scenario: Scenario = request.getfixturevalue(scene)
    run = run_by(scenario, BASELINES[name])
    assert run.outcome == Outcome.REACHED, run.detail
    assert run.clearance.min() > 0.0
    limits = scenario.arm.limits
    assert (np.abs(run.v) <= limits.velocity).all()
    assert (np.abs(run.tau) <= limits.effort).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", FIELDS)
def test_says_where_it_rests(coarse: Scenario, name: str) -> None:
    """The start of the swing-up is a critical point of every V on continuous joints."""
    run = run_by(coarse, BASELINES[name])
    assert run.outcome == Outcome.STUCK
    assert "at joint positions" in run.detail


@pytest.mark.slow
@pytest.mark.parametrize("name", FIELDS)
def test_a_field_stops_before_what_it_cannot_pass(swing_up: Scenario, name: str) -> None:
    scenario = replace(swing_up, start=swing_up.arm.configuration([0.2, 0.0]))
    run = run_by(scenario, BASELINES[name])
    assert run.outcome == Outcome.STUCK
    assert run.clearance.min() > 0.0
    assert "lower_link_0 and right" in run.detail


@pytest.mark.parametrize("name", BASELINES)
@pytest.mark.parametrize("end", ["start", "goal"])
def test_an_infeasible_end_is_refused_alike(swing_up: Scenario, name: str, end: str) -> None:
    contact = swing_up.arm.configuration([1.2, 0.0])
    is_start = end == "start"
    scenario = replace(swing_up, start=contact) if is_start else replace(swing_up, goal=contact)
    with pytest.raises(PlanningError, match=f"{end}: .* overlap by") as caught:
        BASELINES[name](scenario)
    assert caught.value.outcome == Outcome.INFEASIBLE
    assert run_by(scenario, BASELINES[name]).outcome == Outcome.INFEASIBLE


def test_plan_then_track_has_the_motion_of_density(easy: Scenario) -> None:
    ours, baseline = (BASELINES[name](easy) for name in ("density", "plan_then_track"))
    assert ours.motion is not None
    assert baseline.motion is not None
    np.testing.assert_array_equal(ours.motion.position, baseline.motion.position)
    assert isinstance(ours.controller, DensityTracking)
    assert isinstance(baseline.controller, ComputedTorque)


def test_the_motion_of_a_curve_that_ends_short_is_tracked(swing_up: Scenario) -> None:
    """The controller says what the planning system said."""
    motion = Motion(PERIOD, np.zeros((2, 2)), np.zeros((2, 2)), detail="saddle of the density")
    controller = ComputedTorque(swing_up.arm, motion, Gains())
    assert controller.describe_stall(swing_up.start) == "saddle of the density"


@pytest.fixture(scope="module")
def two_link() -> Arm:
    return load_arm("two_link")


@pytest.fixture(scope="module")
def motion() -> Motion:
    """A slow swing that passes the angle pi, where the angles of a continuous joint jump."""
    t = PERIOD * np.arange(2001)[:, np.newaxis]
    position = np.array([3.0, 0.2]) + 0.3 * (1.0 - np.cos(np.pi * t / 2.0))
    return Motion(PERIOD, position, 0.3 * np.pi / 2.0 * np.sin(np.pi * t / 2.0) * np.ones(2))


@pytest.fixture(scope="module")
def computed_torque(two_link: Arm, motion: Motion) -> ComputedTorque:
    return ComputedTorque(two_link, motion, Gains())


def acceleration(arm: Arm, tau: Array, q: Array, v: Array) -> Array:
    return np.asarray(pin.aba(arm.model, arm.data, q, v, tau))


@given(k=st.integers(0, 1999))
def test_on_the_motion_it_is_inverse_dynamics(
    two_link: Arm, motion: Motion, computed_torque: ComputedTorque, k: int
) -> None:
    point = motion.sample(k * PERIOD)
    q = two_link.configuration(point.position)
    tau = computed_torque.torque(k * PERIOD, q, point.velocity)
    assert computed_torque.tracking_error < 1e-12
    wanted = motion.sample((k + 0.5) * PERIOD).acceleration
    found = acceleration(two_link, tau, q, point.velocity)
    np.testing.assert_allclose(found, wanted, atol=1e-9)


errors = arrays(float, 2, elements=st.floats(-0.005, 0.005))


@given(k=st.integers(0, 1999), error=errors, error_rate=errors)
def test_off_it_the_error_obeys_the_gains(
    two_link: Arm,
    motion: Motion,
    computed_torque: ComputedTorque,
    k: int,
    error: Array,
    error_rate: Array,
) -> None:
    point = motion.sample(k * PERIOD)
    q, v = two_link.configuration(point.position + error), point.velocity + error_rate
    tau = computed_torque.torque(k * PERIOD, q, v)
    assert computed_torque.tracking_error == pytest.approx(np.abs(error).max(), abs=1e-12)
    wanted = motion.sample((k + 0.5) * PERIOD).acceleration - 400.0 * error - 40.0 * error_rate
    np.testing.assert_allclose(acceleration(two_link, tau, q, v), wanted, atol=1e-8)


@given(t=st.floats(0.0, 5.0), angles=errors, v=arrays(float, 2, elements=st.floats(-6.0, 6.0)))
def test_torque_is_within_limits_from_any_state(
    two_link: Arm, computed_torque: ComputedTorque, t: float, angles: Array, v: Array
) -> None:
    tau = computed_torque.torque(t, two_link.configuration(600.0 * angles), v)
    assert (np.abs(tau) <= two_link.limits.effort).all()
