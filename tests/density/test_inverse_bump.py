import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.density.inverse_bump import (
    accumulate_log_bumps,
    accumulate_uniform_log_bumps,
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
    np.testing.assert_allclose(inverse_bump([0.1, 0.3], -1.0), smooth_step([0.1 / 1.1, 0.3 / 1.3]))


@given(values, widths, shift)
def test_log_agrees_with_the_bump(h, width, theta):
    value, slope = log_inverse_bump(h, width, theta)
    bump = inverse_bump(h, h - width, theta)
    assert math.exp(value) == pytest.approx(bump, rel=1e-9, abs=1e-300)
    assert 0.0 <= slope < math.inf


@given(st.floats(1e-9, 3.0), st.floats(-1.0, 0.0))
def test_is_one_beyond_the_sensing_region_whatever_the_sign_of_the_width(h, width):
    assert log_inverse_bump(h, width, 0.0) == (0.0, 0.0)


@given(vectors(values, K), vectors(st.floats(-1.0, 1.0), K, NV), vectors(widths, K), shift)
def test_uniform_kernel_sums_and_adds(h, h_gradient, width, theta):
    gradient = np.ones(NV)
    total = accumulate_uniform_log_bumps(h, h_gradient, width, theta, gradient)
    parts = [log_inverse_bump(h[k], width[k], theta) for k in range(K)]
    assert total == pytest.approx(sum(value for value, _ in parts), rel=1e-12)
    slopes = np.array([slope for _, slope in parts])
    scale = np.abs(slopes).sum()
    np.testing.assert_allclose(gradient, 1.0 + slopes @ h_gradient, atol=1e-12 * (1.0 + scale))


@given(vectors(values, K), vectors(st.floats(-1.0, 1.0), K, NV), vectors(widths, K), shift)
def test_general_kernel_with_constant_width_is_the_uniform_one(h, h_gradient, width, theta):
    uniform, general = np.zeros(NV), np.zeros(NV)
    expected = accumulate_uniform_log_bumps(h, h_gradient, width, theta, uniform)
    constant = np.zeros((K, NV))
    assert accumulate_log_bumps(h, h_gradient, width, constant, theta, general) == expected
    np.testing.assert_array_equal(general, uniform)


@given(
    vectors(values, K),
    vectors(st.floats(-1.0, 1.0), K, NV),
    vectors(widths, K),
    vectors(st.floats(-1.0, 1.0), K, NV),
    shift,
)
def test_kernels_equal_their_python_form(h, h_gradient, width, width_gradient, theta):
    for kernel, arguments in [
        (accumulate_log_bumps, (h, h_gradient, width, width_gradient, theta)),
        (accumulate_uniform_log_bumps, (h, h_gradient, width, theta)),
    ]:
        compiled, plain = np.zeros(NV), np.zeros(NV)
        total = kernel(*arguments, compiled)
        assert total == pytest.approx(kernel.py_func(*arguments, plain), rel=1e-12)
        np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-12 * np.abs(plain).max())


@given(st.floats(0.05, 0.95), st.floats(0.1, 2.0), shift)
def test_gradient_follows_both_h_and_the_width(t, width, theta):
    """Along x: h = t w + x, w = w0 - 0.5 x."""
    step = 1e-6 * width * t * (1.0 - t)

    def value(x):
        return log_inverse_bump(t * width + x, width - 0.5 * x, theta)[0]

    gradient = np.zeros(1)
    accumulate_log_bumps(
        np.array([t * width]),
        np.ones((1, 1)),
        np.array([width]),
        np.full((1, 1), -0.5),
        theta,
        gradient,
    )
    numerical = (value(step) - value(-step)) / (2.0 * step)
    rounding = 1e-14 * (1.0 + abs(value(0.0))) / step
    assert gradient[0] == pytest.approx(numerical, rel=1e-6, abs=rounding)
