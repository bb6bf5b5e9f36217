"""M(q) and H(q, v) of the two-link arm against the closed form for two uniform rods."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.values.arrays import Array

MASS = 1.0  # [kg]
LENGTH = 1.0  # [m]
GRAVITY = 9.81  # [m/s²]

ANGLES = st.tuples(*[st.floats(-np.pi, np.pi)] * 2)  # [rad]
VELOCITIES = st.tuples(*[st.floats(-6.0, 6.0)] * 2)  # [rad/s]


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm("two_link")


def mass_matrix(angles: tuple[float, float]) -> Array:
    about_end = MASS * LENGTH**2 / 3
    carried = MASS * LENGTH**2
    coupling = MASS * LENGTH**2 / 2 * np.cos(angles[1])
    return np.array(
        [
            [2 * about_end + carried + 2 * coupling, about_end + coupling],
            [about_end + coupling, about_end],
        ]
    )


def nonlinear_effects(angles: tuple[float, float], v: tuple[float, float]) -> Array:
    coupling = MASS * LENGTH**2 / 2 * np.sin(angles[1])
    upper, lower = (MASS * GRAVITY * LENGTH * np.sin(a) for a in (angles[0], sum(angles)))
    return np.array(
        [
            -coupling * (2 * v[0] * v[1] + v[1] ** 2) + 3 / 2 * upper + lower / 2,
            coupling * v[0] ** 2 + lower / 2,
        ]
    )


@given(angles=ANGLES)
def test_mass_matrix_is_that_of_two_uniform_rods(arm: Arm, angles: tuple[float, float]) -> None:
    actual = arm.mass_matrix(arm.configuration(angles))
    np.testing.assert_allclose(actual, mass_matrix(angles), rtol=0, atol=1e-12)


@given(angles=ANGLES, v=VELOCITIES)
def test_nonlinear_effects_are_those_of_two_uniform_rods(
    arm: Arm, angles: tuple[float, float], v: tuple[float, float]
) -> None:
    actual = arm.nonlinear_effects(arm.configuration(angles), v)
    # Torques reach 100 N·m, where 1e-12 is 70 units in the last place.
    np.testing.assert_allclose(actual, nonlinear_effects(angles, v), rtol=0, atol=1e-12)


@given(angles=ANGLES)
def test_tip_is_at_sin_and_minus_cos(arm: Arm, angles: tuple[float, float]) -> None:
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, arm.configuration(angles))
    absolute = np.cumsum(angles)
    expected = [np.sin(absolute).sum(), 0.0, -np.cos(absolute).sum()]
    tip = data.oMf[arm.model.getFrameId(arm.end_effector)].translation
    np.testing.assert_allclose(tip, expected, rtol=0, atol=1e-14)
