"""Inverse bumps and the smooth step: exact outside, finite in every float, with their slopes."""

import math
import sys
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from densarm.density.inverse_bump import (
    T_MIN,
    inverse_bump,
    log_inverse_bump,
    smooth_step,
)
from densarm.values.arrays import Array

any_float = st.floats(allow_nan=False)
inside = st.floats(1e-3, 1.0 - 1e-3)
any_shift = st.one_of(st.just(0.0), st.floats(sys.float_info.min, 1.0))
values = st.floats(-2.0, 3.0)
widths = st.floats(1e-3, 2.0)
shift = st.sampled_from([0.0, 1e-6, 0.1])


def naive(t: float) -> float:
    f = math.exp(-1.0 / t)
    return f / (f + math.exp(-1.0 / (1.0 - t)))


def log_step(t: float, theta: float) -> tuple[float, float]:
    """The logarithm of the shifted step and its slope, as kernels have them: of width one."""
    value, slope = log_inverse_bump(t, 1.0, theta)
    return value, slope


@given(any_float)
def test_step_is_exact_outside_and_bounded_inside(t: float) -> None:
    step = smooth_step(t)
    if t <= 0.0:
        assert step == 0.0
    elif t >= 1.0:
        assert step == 1.0
    else:
        assert 0.0 <= step <= 1.0


@given(st.floats(1.0 / 300.0, 1.0 - 1.0 / 300.0))
def test_step_equals_the_naive_form_where_that_is_finite(t: float) -> None:
    assert smooth_step(t) == pytest.approx(naive(t), rel=1e-12)


@given(st.floats(0.0, 1.0))
def test_step_is_symmetric_about_one_half(t: float) -> None:
    assert smooth_step(t) + smooth_step(1.0 - t) == pytest.approx(1.0, abs=1e-12)


@given(st.lists(any_float, min_size=2, max_size=8))
def test_step_is_monotone_over_arrays(values: Sequence[float]) -> None:
    steps = smooth_step(np.sort(values))
    assert steps.shape == (len(values),)
    assert (np.diff(steps) >= 0.0).all()


@given(any_float, any_shift)
@example(0.0, 0.0)
@example(1.0, 0.0)
@example(T_MIN, 0.0)
@example(5e-324, 0.0)
@example(1.0 - 2.0**-53, 1e-300)
@example(-math.inf, 0.5)
@example(math.inf, 0.5)
def test_log_is_finite_or_contact_for_every_float(t: float, theta: float) -> None:
    value, slope = log_step(t, theta)
    assert not math.isnan(value)
    assert value <= math.log1p(theta) * (1.0 + 1e-12)
    assert 0.0 <= slope < math.inf
    assert math.isinf(value) == (theta == 0.0 and t < T_MIN)


@given(any_float, any_shift)
def test_kernel_equals_its_python_form(t: float, theta: float) -> None:
    plain = log_inverse_bump.py_func(t, 1.0, theta)
    assert log_step(t, theta) == pytest.approx(plain, rel=1e-12, abs=1e-300)


@given(inside, any_shift)
def test_log_agrees_with_the_step(t: float, theta: float) -> None:
    value, _ = log_step(t, theta)
    if smooth_step(t) + theta > 1e-300:
        assert value == pytest.approx(math.log(smooth_step(t) + theta), rel=1e-12, abs=1e-12)


@given(inside, any_shift)
def test_slope_of_the_step_is_the_derivative(t: float, theta: float) -> None:
    step = 1e-5 * min(t, 1.0 - t)
    ahead, behind = log_step(t + step, theta)[0], log_step(t - step, theta)[0]
    _, slope = log_step(t, theta)
    rounding = 1e-14 * (1.0 + abs(ahead)) / step
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6, abs=rounding)


def test_remainder_of_the_linear_model_is_quadratic() -> None:
    value, slope = log_step(0.4, 1e-3)
    steps = np.logspace(-4, -2, 9)
    remainders = [abs(log_step(0.4 + step, 1e-3)[0] - value - slope * step) for step in steps]
    order = np.polyfit(np.log(steps), np.log(remainders), 1)[0]
    assert order == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("theta", [0.0, 1e-9, 0.5])
def test_step_approaches_contact_and_freedom_continuously(theta: float) -> None:
    contact, free = log_step(0.0, theta), log_step(1.0, theta)
    assert log_step(T_MIN, theta)[1] == pytest.approx(contact[1], rel=1e-5)
    assert contact[0] == (math.log(theta) if theta else -math.inf)
    assert free == (math.log1p(theta), 0.0)
    assert log_step(1.0 - 1e-4, theta) == pytest.approx(free, abs=1e-12)


# Bumps


def test_bump_is_zero_inside_one_outside_and_a_step_between() -> None:
    assert inverse_bump(-0.1, -2.0) == 0.0
    assert inverse_bump(0.0, -2.0) == 0.0
    assert inverse_bump(0.5, -0.5) == 0.5
    assert inverse_bump(1.0, 0.0) == 1.0
    assert inverse_bump(1.0, 5.0, theta=0.25) == 1.25
    expected = smooth_step([0.1 / 1.1, 0.3 / 1.3])
    np.testing.assert_allclose(inverse_bump([0.1, 0.3], -1.0), expected, rtol=1e-12)


@given(values, widths, shift)
def test_log_agrees_with_the_bump(h: float, width: float, theta: float) -> None:
    value, slope = log_inverse_bump(h, width, theta)
    bump: Array = inverse_bump(h, h - width, theta)
    assert math.exp(value) == pytest.approx(bump, rel=1e-12, abs=1e-300)
    assert 0.0 <= slope < math.inf


@given(st.floats(1e-9, 3.0), st.floats(-1.0, 0.0))
def test_bump_is_one_beyond_the_sensing_region_whatever_the_sign_of_the_width(
    h: float, width: float
) -> None:
    assert log_inverse_bump(h, width, 0.0) == (0.0, 0.0)


@given(st.floats(0.05, 0.95), st.floats(0.1, 2.0), shift)
def test_gradient_follows_both_h_and_the_width(t: float, width: float, theta: float) -> None:
    """Along x: h = t w + x, w = w0 - 0.5 x."""
    step = 1e-6 * width * t * (1.0 - t)

    def value(x: float) -> float:
        return float(log_inverse_bump(t * width + x, width - 0.5 * x, theta)[0])

    slope = log_inverse_bump(t * width, width, theta)[1]
    gradient = slope * (1.0 + 0.5 * t)
    numerical = (value(step) - value(-step)) / (2.0 * step)
    rounding = 1e-14 * (1.0 + abs(value(0.0))) / step
    assert gradient == pytest.approx(numerical, rel=1e-6, abs=rounding)
