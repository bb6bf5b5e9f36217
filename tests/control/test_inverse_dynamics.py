"""Torque for wanted accelerations: limits always hold, and saturation spares braking."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm, load_arm
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.values.arrays import Array

State = tuple[Array, Array]


def vectors(nv: int, size: float) -> st.SearchStrategy[Array]:
    return arrays(float, nv, elements=st.floats(-size, size))


@pytest.fixture(scope="module", params=["two_link", "panda"])
def arm(request: pytest.FixtureRequest) -> Arm:
    return load_arm(request.param)


@pytest.fixture(scope="module")
def dynamics(arm: Arm) -> InverseDynamics:
    return InverseDynamics(arm, arm.limits.acceleration)


@st.composite
def states(draw: st.DrawFn, speed: float = 3.0) -> State:
    return draw(vectors(7, 2.0)), draw(vectors(7, speed))


def at(arm: Arm, dynamics: InverseDynamics, state: State) -> State:
    q, v = arm.configuration(state[0][: arm.nv]), state[1][: arm.nv]
    dynamics.update(math.nan, q, v)
    return q, v


def acceleration(arm: Arm, q: Array, v: Array, tau: Array) -> Array:
    return np.array(pin.aba(arm.model, arm.data, q, v, tau))


@settings(max_examples=40)
@given(state=states(), brake=vectors(7, 1e3), attract=vectors(7, 1e6))
def test_torque_is_finite_and_within_limits(
    arm: Arm, dynamics: InverseDynamics, state: State, brake: Array, attract: Array
) -> None:
    at(arm, dynamics, state)
    tau = dynamics.torque(brake[: arm.nv], attract[: arm.nv])
    assert tau.shape == (arm.nv,)
    assert (np.abs(tau) <= arm.limits.effort).all()


@settings(max_examples=40)
@given(state=states(), scale=st.sampled_from([1e150, 1e-300]))
def test_extreme_attraction(
    arm: Arm, dynamics: InverseDynamics, state: State, scale: float
) -> None:
    at(arm, dynamics, state)
    tau = dynamics.torque(np.zeros(arm.nv), np.full(arm.nv, scale))
    assert (np.abs(tau) <= arm.limits.effort).all()


@settings(max_examples=40)
@given(state=states(speed=0.5), wanted=vectors(7, 0.5), attract=vectors(7, 0.5))
def test_exact_where_no_limit_binds(
    arm: Arm, dynamics: InverseDynamics, state: State, wanted: Array, attract: Array
) -> None:
    q, v = at(arm, dynamics, state)
    total = (wanted + attract)[: arm.nv]
    expected = arm.mass_matrix(q) @ total + arm.nonlinear_effects(q, v)
    assume((np.abs(expected) < 0.9 * arm.limits.effort).all())
    brake_alone = arm.mass_matrix(q) @ wanted[: arm.nv] + arm.nonlinear_effects(q, v)
    assume((np.abs(brake_alone) < 0.9 * arm.limits.effort).all())
    tau = dynamics.torque(wanted[: arm.nv], attract[: arm.nv])
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-9)


@settings(max_examples=40)
@given(state=states(), gain=st.floats(1.0, 1e4))
def test_pure_brake_stays_straight(
    arm: Arm, dynamics: InverseDynamics, state: State, gain: float
) -> None:
    q, v = at(arm, dynamics, state)
    assume((np.abs(arm.nonlinear_effects(q, v)) < arm.limits.effort).all())
    a = acceleration(arm, q, v, dynamics.torque(-gain * v, np.zeros(arm.nv)))
    assert (np.abs(a) <= arm.limits.acceleration * (1 + 1e-6) + 1e-6).all()
    assert a @ v <= 1e-6
    assert -a @ v == pytest.approx(np.linalg.norm(a) * np.linalg.norm(v), abs=1e-5)


@settings(max_examples=40)
@given(state=states(), attract=vectors(7, 1e4))
def test_attraction_is_scaled_before_the_brake(
    arm: Arm, dynamics: InverseDynamics, state: State, attract: Array
) -> None:
    """Where the limits allow the brake in full, it acts in full."""
    q, v = at(arm, dynamics, state)
    brake = -v / max(np.abs(v / arm.limits.acceleration).max(), 1.0)
    needed = arm.mass_matrix(q) @ brake + arm.nonlinear_effects(q, v)
    assume((np.abs(needed) < arm.limits.effort).all())
    attract = attract[: arm.nv]
    a = acceleration(arm, q, v, dynamics.torque(brake, attract))
    rest = a - brake
    along = max(rest @ attract, 0.0) / max(attract @ attract, 1e-12)
    assert along <= 1.0 + 1e-9
    np.testing.assert_allclose(rest, along * attract, atol=1e-5 * (1 + np.abs(rest).max()))
    assert (np.abs(a) <= arm.limits.acceleration * (1 + 1e-6) + 1e-6).all()


@settings(max_examples=40)
@given(state=states())
def test_mass_matrix(arm: Arm, dynamics: InverseDynamics, state: State) -> None:
    q, _ = at(arm, dynamics, state)
    mass = dynamics.mass_matrix()
    np.testing.assert_array_equal(mass, mass.T)
    np.testing.assert_allclose(mass, arm.mass_matrix(q), rtol=0, atol=1e-13)


@settings(max_examples=40)
@given(state=states(), shortest=st.sampled_from([0.001, 0.05]))
def test_a_brake_is_no_harder_than_its_duration_and_no_shorter_than_that_allows(
    arm: Arm, dynamics: InverseDynamics, state: State, shortest: float
) -> None:
    _, v = at(arm, dynamics, state)
    held = np.zeros(arm.nv)
    for duration, used in ((0.5, 0.5), (1e-9, shortest), (np.inf, shortest)):
        tau = dynamics.brake_torque(v, duration, shortest)
        np.testing.assert_array_equal(tau, dynamics.torque(-v / used, held))


# Torque that is sent.


@pytest.fixture(scope="module")
def rated(arm: Arm) -> Arm:
    """The arm, its torque changing by 1 N·m in a millisecond at most."""
    return load_arm(arm.name, torque_rate=1000.0)


@settings(max_examples=30)
@given(state=states(speed=0.5), wanted=vectors(7, 60.0), quick=st.booleans())
def test_torque_beside_gravity_changes_by_its_rate_but_in_an_emergency(
    rated: Arm, state: State, wanted: Array, quick: bool
) -> None:
    arm, period = rated, 0.0005 if quick else 0.002
    dynamics = InverseDynamics(arm, arm.limits.acceleration, period=period)
    q, v = arm.configuration(0.3 * state[0][: arm.nv]), state[1][: arm.nv]
    before, most = np.zeros(arm.nv), 1000.0 * period * (1.0 + 1e-9) + 1e-9
    for k in range(6):
        dynamics.update(k * period, q, v)
        gravity = arm.nonlinear_effects(q, np.zeros(arm.nv))
        tau = dynamics.send((-1.0) ** (k // 3) * wanted[: arm.nv])
        assert (np.abs(tau) <= arm.limits.effort).all()
        # The first command too, by what holds the arm.
        free = tau - gravity
        inside = np.abs(tau) < arm.limits.effort
        assert (np.abs(free - before)[inside] <= most).all()
        np.testing.assert_array_equal(dynamics.sent[-1], tau)
        before, q = free, arm.integrate(q, period * v)
    dynamics.update(6 * period, q, v)
    np.testing.assert_array_equal(
        dynamics.send(wanted[: arm.nv], is_emergency=True),
        np.clip(wanted[: arm.nv], -arm.limits.effort, arm.limits.effort),
    )


def test_without_a_time_no_rate_is_known(rated: Arm) -> None:
    dynamics = InverseDynamics(rated, rated.limits.acceleration)
    dynamics.update(math.nan, rated.configuration(np.zeros(rated.nv)), np.zeros(rated.nv))
    np.testing.assert_array_equal(dynamics.send(np.full(rated.nv, 11.0)), 11.0)


def test_an_arm_that_stops_by_itself_beyond_its_torque_rate_keeps_it_in_an_emergency() -> None:
    arm = load_arm("fr3")
    dynamics, (q, v) = (
        InverseDynamics(arm, arm.limits.acceleration),
        (arm.postures["ready"], np.ones(7)),
    )
    for t in (0.0, 1e-3, 2e-3):
        dynamics.update(t, q, v)
        before = dynamics.sent[-1].copy()
        sent = dynamics.send(-arm.limits.effort, is_emergency=True)
    assert np.abs(sent - before).max() <= 1e-3 * arm.limits.torque_rate.max() * 1.001
    assert np.abs(sent - before).max() > 0.5
