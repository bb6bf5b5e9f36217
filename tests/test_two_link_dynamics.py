"""M(q) and H(q, v) of the two-link arm against the closed form for two uniform rods."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

URDF = Path(__file__).parents[1] / "robots" / "two_link" / "robot.urdf"
MASS = 1.0  # [kg]
LENGTH = 1.0  # [m]
GRAVITY = 9.81  # [m/s²]

ANGLES = st.tuples(*[st.floats(-np.pi, np.pi)] * 2)  # [rad]
VELOCITIES = st.tuples(*[st.floats(-6.0, 6.0)] * 2)  # [rad/s]


@pytest.fixture(scope="module")
def model():
    return pin.buildModelFromUrdf(str(URDF))


def configuration(angles):
    return np.array([f(angle) for angle in angles for f in (np.cos, np.sin)])


def mass_matrix(angles):
    about_end = MASS * LENGTH**2 / 3
    carried = MASS * LENGTH**2
    coupling = MASS * LENGTH**2 / 2 * np.cos(angles[1])
    return np.array(
        [
            [2 * about_end + carried + 2 * coupling, about_end + coupling],
            [about_end + coupling, about_end],
        ]
    )


def nonlinear_effects(angles, v):
    coupling = MASS * LENGTH**2 / 2 * np.sin(angles[1])
    upper, lower = (MASS * GRAVITY * LENGTH * np.sin(a) for a in (angles[0], sum(angles)))
    return np.array(
        [
            -coupling * (2 * v[0] * v[1] + v[1] ** 2) + 3 / 2 * upper + lower / 2,
            coupling * v[0] ** 2 + lower / 2,
        ]
    )


@given(angles=ANGLES)
def test_mass_matrix_is_that_of_two_uniform_rods(model, angles):
    upper = np.triu(pin.crba(model, model.createData(), configuration(angles)))
    actual = upper + np.triu(upper, 1).T
    np.testing.assert_allclose(actual, mass_matrix(angles), rtol=0, atol=1e-12)


@given(angles=ANGLES, v=VELOCITIES)
def test_nonlinear_effects_are_those_of_two_uniform_rods(model, angles, v):
    actual = pin.nonLinearEffects(model, model.createData(), configuration(angles), np.array(v))
    # Torques reach 100 N·m, where 1e-12 is 70 units in the last place.
    np.testing.assert_allclose(actual, nonlinear_effects(angles, v), rtol=0, atol=1e-12)


@given(angles=ANGLES)
def test_tip_is_at_sin_and_minus_cos(model, angles):
    data = model.createData()
    pin.framesForwardKinematics(model, data, configuration(angles))
    absolute = np.cumsum(angles)
    expected = [np.sin(absolute).sum(), 0.0, -np.cos(absolute).sum()]
    tip = data.oMf[model.getFrameId("tip")].translation
    np.testing.assert_allclose(tip, expected, rtol=0, atol=1e-14)


def test_joints_and_limits(model):
    assert list(model.names)[1:] == ["shoulder", "elbow"]
    assert (model.nq, model.nv) == (4, 2)
    np.testing.assert_array_equal(model.upperEffortLimit, [60.0, 30.0])
    np.testing.assert_array_equal(model.upperVelocityLimit, [6.0, 6.0])
