"""ComputedTorque: exact on its reference, linear feedback off it, within the torque limits."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arm import load_arm
from densarm.control.computed_torque import ComputedTorque
from densarm.control.gains import Gains
from densarm.reference.reference import Reference

PERIOD = 0.001


@pytest.fixture(scope="module")
def setting():
    """A slow swing that passes the angle pi, where a circle's angles jump."""
    arm = load_arm("two_link")
    t = PERIOD * np.arange(2001)[:, np.newaxis]
    position = np.array([3.0, 0.2]) + 0.3 * (1.0 - np.cos(np.pi * t / 2.0))
    velocity = 0.3 * np.pi / 2.0 * np.sin(np.pi * t / 2.0) * np.ones(2)
    reference = Reference(PERIOD, position, velocity)
    return arm, reference, ComputedTorque(arm, reference, Gains())


def acceleration(arm, tau, q, v):
    return pin.aba(arm.model, arm.data, q, v, tau)


@given(k=st.integers(0, 1999))
def test_on_the_reference_it_is_inverse_dynamics(setting, k):
    arm, reference, controller = setting
    point = reference.sample(k * PERIOD)
    q = arm.configuration(point.position)
    tau = controller.torque(k * PERIOD, q, point.velocity)
    wanted = reference.sample((k + 0.5) * PERIOD).acceleration
    np.testing.assert_allclose(acceleration(arm, tau, q, point.velocity), wanted, atol=1e-9)


errors = arrays(float, 2, elements=st.floats(-0.005, 0.005))


@given(k=st.integers(0, 1999), error=errors, error_rate=errors)
def test_off_it_the_error_obeys_the_gains(setting, k, error, error_rate):
    arm, reference, controller = setting
    point = reference.sample(k * PERIOD)
    q, v = arm.configuration(point.position + error), point.velocity + error_rate
    tau = controller.torque(k * PERIOD, q, v)
    wanted = reference.sample((k + 0.5) * PERIOD).acceleration - 400.0 * error - 40.0 * error_rate
    np.testing.assert_allclose(acceleration(arm, tau, q, v), wanted, atol=1e-8)


@given(t=st.floats(0.0, 5.0), angles=errors, v=arrays(float, 2, elements=st.floats(-6.0, 6.0)))
def test_torque_is_within_limits_from_any_state(setting, t, angles, v):
    arm, _, controller = setting
    tau = controller.torque(t, arm.configuration(600.0 * angles), v)
    assert (np.abs(tau) <= arm.limits.effort).all()
