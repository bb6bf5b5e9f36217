import math
import sys

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from densarm.density.smooth_step import T_MIN, log_shifted_step, smooth_step

any_float = st.floats(allow_nan=False)
inside = st.floats(1e-3, 1.0 - 1e-3)
shift = st.one_of(st.just(0.0), st.floats(sys.float_info.min, 1.0))


def naive(t):
    f = np.exp(-1.0 / t)
    return f / (f + np.exp(-1.0 / (1.0 - t)))


@given(any_float)
def test_is_exact_outside_and_bounded_inside(t):
    step = smooth_step(t)
    if t <= 0.0:
        assert step == 0.0
    elif t >= 1.0:
        assert step == 1.0
    else:
        assert 0.0 <= step <= 1.0


@given(st.floats(1.0 / 300.0, 1.0 - 1.0 / 300.0))
def test_equals_the_naive_form_where_that_is_finite(t):
    assert smooth_step(t) == pytest.approx(naive(t), rel=1e-12)


@given(st.floats(0.0, 1.0))
def test_is_symmetric_about_one_half(t):
    assert smooth_step(t) + smooth_step(1.0 - t) == pytest.approx(1.0, abs=1e-12)


@given(st.lists(any_float, min_size=2, max_size=8))
def test_is_monotone_over_arrays(values):
    steps = smooth_step(np.sort(values))
    assert steps.shape == (len(values),)
    assert (np.diff(steps) >= 0.0).all()


@given(any_float, shift)
@example(0.0, 0.0)
@example(1.0, 0.0)
@example(T_MIN, 0.0)
@example(5e-324, 0.0)
@example(1.0 - 2.0**-53, 1e-300)
@example(-math.inf, 0.5)
@example(math.inf, 0.5)
def test_log_is_finite_or_contact_for_every_float(t, theta):
    value, slope = log_shifted_step(t, theta)
    assert not math.isnan(value)
    assert value <= math.log1p(theta) * (1.0 + 1e-12)
    assert 0.0 <= slope < math.inf
    assert math.isinf(value) == (theta == 0.0 and t < T_MIN)


@given(any_float, shift)
def test_kernel_equals_its_python_form(t, theta):
    compiled, plain = log_shifted_step(t, theta), log_shifted_step.py_func(t, theta)
    assert compiled == pytest.approx(plain, rel=1e-12, abs=1e-300)


@given(inside, shift)
def test_log_agrees_with_the_step(t, theta):
    value, _ = log_shifted_step(t, theta)
    if smooth_step(t) + theta > 1e-300:
        assert value == pytest.approx(math.log(smooth_step(t) + theta), rel=1e-12, abs=1e-12)


@given(inside, shift)
def test_slope_is_the_derivative(t, theta):
    step = 1e-5 * min(t, 1.0 - t)
    ahead, behind = log_shifted_step(t + step, theta)[0], log_shifted_step(t - step, theta)[0]
    _, slope = log_shifted_step(t, theta)
    rounding = 1e-14 * (1.0 + abs(ahead)) / step
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6, abs=rounding)


def test_remainder_of_the_linear_model_is_quadratic():
    value, slope = log_shifted_step(0.4, 1e-3)
    steps = np.logspace(-4, -2, 9)
    remainders = [
        abs(log_shifted_step(0.4 + step, 1e-3)[0] - value - slope * step) for step in steps
    ]
    order = np.polyfit(np.log(steps), np.log(remainders), 1)[0]
    assert order == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("theta", [0.0, 1e-9, 0.5])
def test_approaches_contact_and_freedom_continuously(theta):
    contact, free = log_shifted_step(0.0, theta), log_shifted_step(1.0, theta)
    assert log_shifted_step(T_MIN, theta)[1] == pytest.approx(contact[1], rel=1e-5)
    assert contact[0] == (math.log(theta) if theta else -math.inf)
    assert free == (math.log1p(theta), 0.0)
    assert log_shifted_step(1.0 - 1e-4, theta) == pytest.approx(free, abs=1e-12)
