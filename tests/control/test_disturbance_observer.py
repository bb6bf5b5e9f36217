"""DisturbanceObserver: it finds the torque that no model tells of, and where a delay leads."""

from collections import deque

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm, load_arm
from densarm.control.disturbance_observer import ActuationParameters
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array

DT = 0.001  # [s]
USUAL = ActuationParameters(velocity_noise=0.0)


@pytest.fixture(scope="module", params=["two_link", "panda"])
def arm(request: pytest.FixtureRequest) -> Arm:
    return load_arm(request.param)


class Damped:
    """An arm that brakes itself by what is observed, pushed by an unknown torque."""

    def __init__(
        self, arm: Arm, q: Array, v: Array, parameters: ActuationParameters = USUAL, delay: int = 0
    ) -> None:
        self.arm, self.q, self.v, self.t = arm, q, v, 0.0
        self.dynamics = InverseDynamics(arm, arm.limits.acceleration, None, DT, parameters)
        holding = arm.nonlinear_effects(q, np.zeros(arm.nv))
        self.sent = deque([holding] * delay)

    def run(self, seconds: float, unknown: Array, gain: float = 10.0) -> "Damped":
        for _ in range(round(seconds / DT)):
            self.dynamics.update(self.t, self.q, self.v)
            brake = -gain * self.dynamics.velocity
            self.sent.append(self.dynamics.send(self.dynamics.torque(brake, np.zeros(self.arm.nv))))
            a = pin.aba(
                self.arm.model, self.arm.data, self.q, self.v, self.sent.popleft() + unknown
            )
            self.v = self.v + DT * a
            self.q, self.t = self.arm.integrate(self.q, DT * self.v), self.t + DT
        return self


def at_rest(arm: Arm, parameters: ActuationParameters = USUAL) -> Damped:
    return Damped(arm, arm.configuration(np.full(arm.nv, -0.4)), np.zeros(arm.nv), parameters)


@settings(max_examples=15)
@given(
    angles=arrays(float, 7, elements=st.floats(-1.0, 1.0)),
    speed=arrays(float, 7, elements=st.floats(-0.3, 0.3)),
    unknown=arrays(float, 7, elements=st.floats(-3.0, 3.0)),
    bandwidth=st.sampled_from([40.0, 160.0]),
)
def test_a_constant_torque_is_found_within_time_constants(
    arm: Arm, angles: Array, speed: Array, unknown: Array, bandwidth: float
) -> None:
    d, nv = unknown[: arm.nv], arm.nv
    loop = Damped(
        arm,
        arm.configuration(angles[:nv]),
        speed[:nv],
        ActuationParameters(bandwidth=bandwidth, velocity_noise=0.0),
    )
    loop.run(15.0 / bandwidth, d)
    np.testing.assert_allclose(loop.dynamics.disturbance, d, rtol=0.01, atol=0.02)


def test_it_is_no_more_than_motors_could_bear(arm: Arm) -> None:
    loop = at_rest(arm).run(0.05, 5.0 * arm.limits.effort)
    share = np.abs(loop.dynamics.disturbance) / arm.limits.effort
    np.testing.assert_allclose(share, 0.9)


def test_without_bandwidth_the_state_is_the_measured_one(arm: Arm) -> None:
    loop = at_rest(arm, ActuationParameters(bandwidth=0.0)).run(0.02, np.full(arm.nv, 2.0))
    q, v = loop.q, loop.v
    loop.dynamics.update(loop.t, q, v)
    np.testing.assert_array_equal(loop.dynamics.disturbance, 0.0)
    np.testing.assert_allclose(loop.dynamics.velocity, v, rtol=1e-12)
    off = arm.difference(q, arm.configuration(loop.dynamics.angles))
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    assert np.abs(v).max() > 1e-3


@pytest.mark.parametrize("late", [2, 5])
def test_where_a_declared_delay_leads_is_foreseen(arm: Arm, late: int) -> None:
    """From the torques on their way; nothing of the delay is taken for a disturbance."""
    declared = ActuationParameters(delay=late * DT, velocity_noise=0.0)
    q, v = arm.configuration(np.full(arm.nv, -0.4)), np.full(arm.nv, 0.5)
    loop = Damped(arm, q, v, declared, late)
    loop.run(0.1, np.zeros(arm.nv))
    for _ in range(20):
        loop.run(DT, np.zeros(arm.nv))
        before, foreseen = loop.v, (loop.dynamics.angles, loop.dynamics.velocity)
        q, v = loop.q, loop.v
        for tau in list(loop.sent)[: late - 1]:  # the state was measured a step before
            v = v + DT * pin.aba(arm.model, arm.data, q, v, tau)
            q = arm.integrate(q, DT * v)
        np.testing.assert_allclose(foreseen[1], v, rtol=0, atol=1e-3)
        off = arm.difference(q, arm.configuration(foreseen[0]))
        assert np.abs(off).max() < 0.02 * late * DT * np.abs(before).max() + 1e-6
        assert np.abs(loop.dynamics.disturbance).max() < 0.05


@pytest.mark.parametrize("name", ["two_link", "kinova"])
def test_joints_that_go_round_are_followed_over_the_seam(name: str) -> None:
    arm = load_arm(name)
    rounds = np.flatnonzero(arm.joint_index[1])
    angles, v = np.full(arm.nv, 0.3), np.zeros(arm.nv)
    angles[rounds], v[rounds] = np.pi - 0.02, 0.5
    loop, still = Damped(arm, arm.configuration(angles), v), np.zeros(arm.nv)
    loop.run(0.1, still, gain=0.0)
    assert (arm.angles(loop.q)[rounds] < 0.0).any()
    assert np.abs(loop.dynamics.disturbance).max() < 0.01
    off = arm.difference(loop.q, arm.configuration(loop.dynamics.angles))
    assert np.abs(off).max() < 2.0 * DT


def test_it_begins_anew_where_time_jumps_or_runs_back(arm: Arm) -> None:
    for jump in (0.2, -0.05, np.nan):
        loop = at_rest(arm).run(0.1, np.full(arm.nv, 1.0))
        assert np.abs(loop.dynamics.disturbance).min() > 0.9
        assert loop.dynamics.begins(loop.t + jump)
        loop.dynamics.update(loop.t + jump, loop.q, loop.v)
        np.testing.assert_array_equal(loop.dynamics.disturbance, 0.0)
        np.testing.assert_array_equal(loop.dynamics.velocity, loop.v)


def test_another_one_goes_on_from_what_was_found(arm: Arm) -> None:
    loop = at_rest(arm).run(0.1, np.full(arm.nv, 1.0))
    other = InverseDynamics(arm, arm.limits.acceleration, None, DT, USUAL)
    other.take_over(loop.dynamics, loop.t - DT)
    for dynamics in (loop.dynamics, other):
        dynamics.update(loop.t, loop.q, loop.v)
    np.testing.assert_array_equal(other.disturbance, loop.dynamics.disturbance)
    np.testing.assert_array_equal(other.velocity, loop.dynamics.velocity)
    np.testing.assert_allclose(other.disturbance, 1.0, atol=0.02)


@pytest.mark.parametrize("key", ["delay", "bandwidth", "inertia_floor"])
@pytest.mark.parametrize("value", [-1.0, np.nan])
def test_parameters_are_checked(key: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        ActuationParameters(**{key: value})
