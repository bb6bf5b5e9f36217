import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.density import ClearanceSet, ImplicitSet, JointLimitSet
from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.unsafe_set import accumulate_limit_log_bumps
from densarm.errors import InvalidValueError

coordinates = st.floats(-2.5, 2.5)


class LineClearance:
    """A point on a line between two walls at -1 and 1."""

    def __init__(self):
        self.distance, self.gradient = np.zeros(2), np.array([[1.0], [-1.0]])

    def update(self, q):
        self.distance[:] = 1.0 + q[0], 1.0 - q[0]


def log_bump(unsafe_set, q, nv, theta=0.0):
    gradient = np.zeros(nv)
    return unsafe_set.add_log_bump(q, theta, gradient), gradient


@given(st.floats(-0.99, 0.99), st.floats(0.0, 0.1))
def test_clearance_set_takes_the_margin_off_the_distance(x, margin):
    unsafe_set = ClearanceSet(LineClearance(), margin, sensing_distance=[0.5, 0.3])
    value, gradient = log_bump(unsafe_set, np.array([x]), 1)
    left = log_inverse_bump(1.0 + x - margin, 0.5, 0.0)
    right = log_inverse_bump(1.0 - x - margin, 0.3, 0.0)
    assert value == left[0] + right[0]
    assert gradient[0] == pytest.approx(left[1] - right[1], rel=1e-12)


def test_clearance_set_obeys_a_sensing_distance_changed_in_place():
    unsafe_set = ClearanceSet(LineClearance(), 0.0, 0.5)
    assert unsafe_set.sensing_distance.shape == (2,)
    assert log_bump(unsafe_set, np.array([0.6]), 1)[0] < 0.0
    unsafe_set.sensing_distance[:] = 0.1
    assert log_bump(unsafe_set, np.array([0.6]), 1) == (0.0, np.zeros(1))


def test_contact_is_minus_infinite_and_its_gradient_points_out():
    unsafe_set = ClearanceSet(LineClearance(), 0.0, 0.5)
    for x in (1.0, 1.5):
        value, gradient = log_bump(unsafe_set, np.array([x]), 1)
        assert value == -math.inf
        assert -math.inf < gradient[0] < 0.0
        assert log_bump(unsafe_set, np.array([x]), 1, theta=0.1)[0] == pytest.approx(
            math.log(0.1) + math.log(1.1), rel=1e-12
        )


@pytest.mark.parametrize(
    ("margin", "sensing"), [(-1.0, 0.5), (math.nan, 0.5), (0.0, 0.0), (0.0, [1.0] * 3), (0.0, -1)]
)
def test_clearance_set_refuses_what_cannot_be(margin, sensing):
    with pytest.raises(InvalidValueError):
        ClearanceSet(LineClearance(), margin, sensing)


@given(coordinates, coordinates, coordinates)
def test_joint_limits_act_on_bounded_joints_alone(joint_space, a, b, c):
    arm = joint_space("bcb", lower=[-1.0, -math.inf, -2.0], upper=[1.5, math.inf, math.inf])
    unsafe_set = JointLimitSet(arm, sensing_distance=[0.2, 1.0, 0.5])
    q = arm.configuration([a, b, c])
    value, gradient = log_bump(unsafe_set, q, 3)
    parts = [
        log_inverse_bump(h, width, 0.0)
        for h, width in [(a + 1.0, 0.2), (1.5 - a, 0.2), (c + 2.0, 0.5)]
    ]
    assert value == sum(part for part, _ in parts)
    expected = np.array([parts[0][1] - parts[1][1], 0.0, parts[2][1]])
    np.testing.assert_allclose(gradient, expected, rtol=1e-12)


@given(st.floats(-3.0, 3.0), st.sampled_from([0.0, 0.1]))
def test_joint_limit_kernel_equals_its_python_form(x, theta):
    arguments = (
        np.array([x]),
        np.zeros((2, 2), dtype=np.int64),
        np.array([[-1.0, 1.0], [1.0, -1.0], [0.5, 0.5]]),
        theta,
    )
    compiled, plain = np.zeros(1), np.zeros(1)
    total = accumulate_limit_log_bumps(*arguments, compiled)
    assert total == pytest.approx(accumulate_limit_log_bumps.py_func(*arguments, plain), rel=1e-12)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12)


@given(st.floats(1.05, 1.95), st.floats(-math.pi, math.pi), st.sampled_from([0.0, 0.1]))
def test_implicit_gradient_is_the_derivative(disc, numerical_gradient, radius, angle, theta):
    """An ellipse around a circle: the width h - s varies."""
    stretch = np.array([1.0, 0.8])

    def ellipse(x):
        return float((stretch * x) @ (stretch * x) - 4.0), 2.0 * stretch**2 * x

    unsafe_set = ImplicitSet(disc[0], ellipse)
    x = radius * np.array([math.cos(angle), math.sin(angle)])
    value, gradient = log_bump(unsafe_set, x, 2, theta)
    numerical = numerical_gradient(lambda y: log_bump(unsafe_set, y, 2, theta)[0], x, 2, step=1e-7)
    np.testing.assert_allclose(gradient, numerical, rtol=1e-5, atol=1e-6 * (1.0 + abs(value)))


def test_implicit_set_is_free_beyond_its_sensing_region_and_contact_inside(disc):
    unsafe_set = ImplicitSet(*disc)
    assert log_bump(unsafe_set, np.array([2.0, 0.1]), 2)[0] == 0.0
    value, gradient = log_bump(unsafe_set, np.array([0.9, 0.0]), 2)
    assert value == -math.inf
    assert gradient[0] > 0.0


def test_implicit_set_refuses_a_sensing_region_inside_the_unsafe_set(disc):
    h, s = disc
    with pytest.raises(InvalidValueError, match="sensing function"):
        ImplicitSet(s, h).add_log_bump(np.zeros(2), 0.0, np.zeros(2))


def test_a_set_adds_to_the_gradient_it_is_given(joint_space):
    arm = joint_space("b", lower=[-1.0], upper=[1.0])
    gradient = np.full(1, 7.0)
    JointLimitSet(arm, 0.1).add_log_bump(np.zeros(1), 0.0, gradient)
    assert gradient[0] == 7.0
