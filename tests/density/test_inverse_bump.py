import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.density.inverse_bump import (
    accumulate_log_bumps,
    inverse_bump,
    log_inverse_bump,
)
from densarm.density.smooth_step import smooth_step

K, NV = 6, 3
values = st.floats(-2.0, 3.0)
widths = st.floats(1e-3, 2.0)
shift = st.sampled_from([0.0, 1e-6, 0.1])


def vectors(elements, *shape):
    return arrays(np.float64, shape, elements=elements)


def test_is_zero_inside_one_outside_and_a_step_between():
    assert inverse_bump(-0.1, -2.0) == 0.0
    assert inverse_bump(0.0, -2.0) == 0.0
    assert inverse_bump(0.5, -0.5) == 0.5
    assert inverse_bump(1.0, 0.0) == 1.0
    assert inverse_bump(1.0, 5.0, theta=0.25) == 1.25
    expected = smooth_step([0.1 / 1.1, 0.3 / 1.3])
    np.testing.assert_allclose(inverse_bump([0.1, 0.3], -1.0), expected, rtol=1e-12)


@given(values, widths, shift)
def test_log_agrees_with_the_bump(h, width, theta):
    value, slope = log_inverse_bump(h, width, theta)
    bump = inverse_bump(h, h - width, theta)
    assert math.exp(value) == pytest.approx(bump, rel=1e-12, abs=1e-300)
    assert 0.0 <= slope < math.inf


@given(st.floats(1e-9, 3.0), st.floats(-1.0, 0.0))
def test_is_one_beyond_the_sensing_region_whatever_the_sign_of_the_width(h, width):
    assert log_inverse_bump(h, width, 0.0) == (0.0, 0.0)


@given(
    vectors(values, K),
    st.floats(0.0, 0.1),
    vectors(st.floats(-1.0, 1.0), K, NV),
    vectors(widths, K),
    shift,
)
def test_kernel_sums_and_adds(distance, margin, gradients, width, theta):
    gradient = np.ones(NV)
    total = accumulate_log_bumps(distance, margin, gradients, width, theta, gradient)
    parts = [log_inverse_bump(distance[k] - margin, width[k], theta) for k in range(K)]
    assert total == pytest.approx(sum(value for value, _ in parts), rel=1e-12)
    slopes = np.array([slope for _, slope in parts])
    scale = np.abs(slopes).sum()
    np.testing.assert_allclose(gradient, 1.0 + slopes @ gradients, atol=1e-12 * (1.0 + scale))


@given(vectors(values, K), vectors(st.floats(-1.0, 1.0), K, NV), vectors(widths, K), shift)
def test_kernel_equals_its_python_form(distance, gradients, width, theta):
    arguments = (distance, 0.01, gradients, width, theta)
    compiled, plain = np.zeros(NV), np.zeros(NV)
    total = accumulate_log_bumps(*arguments, compiled)
    assert total == pytest.approx(accumulate_log_bumps.py_func(*arguments, plain), rel=1e-12)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-12 * np.abs(plain).max())


@given(st.floats(0.05, 0.95), st.floats(0.1, 2.0), shift)
def test_gradient_follows_both_h_and_the_width(t, width, theta):
    """Along x: h = t w + x, w = w0 - 0.5 x."""
    step = 1e-6 * width * t * (1.0 - t)

    def value(x):
        return log_inverse_bump(t * width + x, width - 0.5 * x, theta)[0]

    slope = log_inverse_bump(t * width, width, theta)[1]
    gradient = slope * (1.0 + 0.5 * t)
    numerical = (value(step) - value(-step)) / (2.0 * step)
    rounding = 1e-14 * (1.0 + abs(value(0.0))) / step
    assert gradient == pytest.approx(numerical, rel=1e-6, abs=rounding)
