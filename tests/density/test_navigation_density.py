import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from densarm.density import (
    DensityParameters,
    DensitySample,
    EuclideanDistance,
    Gauge,
    ImplicitSet,
    JointLimitSet,
    NavigationDensity,
    TorusDistance,
)
from densarm.density.gauge_gradient import write_gauge_gradient
from densarm.errors import InvalidValueError

GOAL = np.array([3.0, 0.5])
points = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)).map(np.array)
alphas = st.sampled_from([0.1, 0.5, 1.0, 2.0])
FUNCTIONS = {
    Gauge.DENSITY: lambda sample: sample.value,
    Gauge.LOG: lambda sample: sample.log_value,
    Gauge.RECIPROCAL: lambda sample: -1.0 / sample.value,
}


@pytest.fixture(scope="module")
def density(disc):
    def make(**parameters):
        return NavigationDensity(
            [ImplicitSet(*disc)], EuclideanDistance(GOAL), DensityParameters(**parameters)
        )

    return make


@pytest.mark.parametrize("gauge", list(Gauge))
@given(x=points, alpha=alphas, theta=st.sampled_from([0.0, 0.1]))
def test_gradient_is_the_derivative_of_the_gauge(
    density, numerical_gradient, gauge, x, alpha, theta
):
    assume(np.linalg.norm(x) > 1.1)
    assume(np.linalg.norm(x - GOAL) > 0.1)
    field = density(alpha=alpha, theta=theta)
    gradient = field.evaluate(x).gradient(gauge)
    numerical = numerical_gradient(lambda y: FUNCTIONS[gauge](field.evaluate(y)), x, 2)
    scale = np.abs(gradient).max() + abs(FUNCTIONS[gauge](field.evaluate(x)))
    np.testing.assert_allclose(gradient, numerical, atol=1e-5 * scale)


@pytest.mark.parametrize("gauge", list(Gauge))
def test_remainder_of_the_linear_model_is_quadratic(density, gauge):
    field, function = density(alpha=0.5), FUNCTIONS[gauge]
    x, direction = np.array([-1.5, 0.3]), np.array([0.6, 0.8])
    sample = field.evaluate(x)
    slope = sample.gradient(gauge) @ direction
    steps = np.logspace(-4, -2.5, 9)
    remainders = [
        abs(function(field.evaluate(x + step * direction)) - function(sample) - step * slope)
        for step in steps
    ]
    order = np.polyfit(np.log(steps), np.log(remainders), 1)[0]
    assert order == pytest.approx(2.0, abs=0.05)


@given(points, alphas)
def test_gauges_are_parallel(density, x, alpha):
    sample = density(alpha=alpha).evaluate(x)
    assume(sample.log_psi > -300.0)
    directions = [sample.gradient(gauge) for gauge in Gauge]
    lengths = [np.linalg.norm(direction) for direction in directions]
    assume(min(lengths) > 0.0)
    units = [direction / length for direction, length in zip(directions, lengths, strict=True)]
    np.testing.assert_allclose(units, [units[0]] * 3, atol=1e-12)


@given(points, alphas)
def test_every_gauge_is_finite_everywhere(density, x, alpha):
    sample = density(alpha=alpha).evaluate(x)
    assert not math.isnan(sample.log_value)
    assert sample.value >= 0.0
    for gauge in Gauge:
        assert np.isfinite(np.linalg.norm(sample.gradient(gauge)))


@given(st.floats(-math.pi, math.pi), st.sampled_from([1e-3, 1e-8, 1e-30, 1e-170]))
def test_reciprocal_gauge_is_linear_near_the_goal(angle, distance):
    error = distance * np.array([math.cos(angle), math.sin(angle)])
    field = NavigationDensity([], EuclideanDistance(np.zeros(2)))
    np.testing.assert_allclose(
        field.evaluate(error).gradient(Gauge.RECIPROCAL), -2.0 * error, rtol=1e-12
    )


@given(alphas)
def test_the_goal_is_an_exact_equilibrium_in_every_gauge(density, alpha):
    sample = density(alpha=alpha).evaluate(GOAL)
    assert sample.log_value == math.inf
    assert sample.value == math.inf
    for gauge in Gauge:
        np.testing.assert_array_equal(sample.gradient(gauge), np.zeros(2))


def test_the_goal_is_an_equilibrium_inside_a_sensing_region(disc):
    goal = np.array([1.5, 0.0])
    field = NavigationDensity([ImplicitSet(*disc)], EuclideanDistance(goal))
    sample = field.evaluate(goal)
    assert sample.log_psi < 0.0
    assert np.abs(sample.log_psi_gradient).max() > 0.1
    np.testing.assert_array_equal(sample.gradient(Gauge.RECIPROCAL), np.zeros(2))


def test_the_density_gauge_saturates_towards_the_goal():
    field = NavigationDensity([], EuclideanDistance(np.zeros(2)))
    gradient = field.evaluate(np.array([1e-60, 0.0])).gradient(Gauge.DENSITY)
    np.testing.assert_allclose(gradient, [-1e150, 0.0], rtol=1e-12)


def test_contact_pushes_out_but_in_the_flat_density_gauge(density):
    sample = density().evaluate(np.array([-0.9, 0.0]))
    assert sample.log_value == -math.inf
    assert sample.value == 0.0
    np.testing.assert_array_equal(sample.gradient(Gauge.DENSITY), np.zeros(2))
    assert sample.log_gradient[0] < 0.0
    np.testing.assert_allclose(sample.gradient(Gauge.RECIPROCAL)[0], -1e150, rtol=1e-12)


def test_a_goal_in_contact_has_no_density(disc):
    field = NavigationDensity([ImplicitSet(*disc)], EuclideanDistance(np.zeros(2)))
    assert field.evaluate(np.zeros(2)).value == 0.0


@given(points, st.sampled_from(list(Gauge)))
def test_the_blend_is_the_gradient_outside_and_linear_inside(density, x, gauge):
    sample = density(gauge=gauge, blend_radius=0.7).evaluate(x)
    blended, distance = sample.blended_gradient(), np.linalg.norm(sample.goal_error)
    if distance <= 0.7:
        np.testing.assert_array_equal(blended, -sample.goal_error)
    elif distance >= 1.4:
        np.testing.assert_array_equal(blended, sample.gradient(gauge))
    else:
        between = np.sort([sample.gradient(gauge), -sample.goal_error], axis=0)
        assert ((between[0] - 1e-12 <= blended) & (blended <= between[1] + 1e-12)).all()


def test_without_a_radius_nothing_is_blended(density):
    sample = density().evaluate(GOAL + 1e-9)
    np.testing.assert_array_equal(sample.blended_gradient(), sample.gradient(Gauge.RECIPROCAL))


def test_update_and_write_gradient_work_in_place_and_samples_are_copies(density):
    field, out = density(), np.empty(2)
    held = field.log_psi_gradient, field.goal_distance_gradient
    first = field.evaluate(np.array([-1.2, 0.1]))
    kept = first.log_psi_gradient.copy()
    second = field.evaluate(np.array([-1.5, 0.2]))
    np.testing.assert_array_equal(first.log_psi_gradient, kept)
    assert field.log_psi_gradient is held[0]
    assert field.goal_distance_gradient is held[1]
    for gauge in Gauge:
        field.write_gradient(gauge, out)
        np.testing.assert_array_equal(out, second.gradient(gauge))


@given(st.lists(st.floats(-1.4, 1.4), min_size=3, max_size=3))
def test_bumps_of_all_sets_multiply(joint_space, angles):
    arm = joint_space("bcb", lower=[-1.5] * 3, upper=[1.5] * 3)
    sets = [JointLimitSet(arm, 0.5), JointLimitSet(arm, 1.0)]
    q, goal = arm.configuration(angles), arm.configuration([0.3, 0.2, 0.1])
    together = NavigationDensity(sets, TorusDistance(arm, goal)).evaluate(q)
    apart = [NavigationDensity([one], TorusDistance(arm, goal)).evaluate(q) for one in sets]
    assert together.log_psi == pytest.approx(sum(one.log_psi for one in apart), rel=1e-12)
    np.testing.assert_allclose(
        together.log_psi_gradient, sum(one.log_psi_gradient for one in apart), rtol=1e-12
    )


@given(
    points,
    points,
    st.floats(1e-300, 1e3),
    alphas,
    st.floats(-800.0, 0.0),
    st.sampled_from([(-2.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]),
)
def test_kernel_equals_its_python_form(log_gradient, gradient, distance, alpha, log_psi, exponents):
    compiled, plain = np.empty(2), np.empty(2)
    arguments = (log_gradient, distance, gradient, alpha, log_psi, *exponents)
    write_gauge_gradient(*arguments, compiled)
    write_gauge_gradient.py_func(*arguments, plain)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("name", ["alpha", "theta", "blend_radius"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_parameters_out_of_range_are_refused(name, value):
    with pytest.raises(InvalidValueError, match=name):
        DensityParameters(**{name: value})


def test_a_gauge_is_known_by_its_name():
    assert DensityParameters(gauge="log").gauge is Gauge.LOG
    with pytest.raises(InvalidValueError, match="reciprocal"):
        DensityParameters(gauge="linear")
    with pytest.raises(InvalidValueError, match="alpha"):
        DensityParameters(alpha=0.0)


def test_a_sample_cannot_be_changed(density):
    sample = density().evaluate(np.zeros(2))
    assert isinstance(sample, DensitySample)
    with pytest.raises(AttributeError):
        sample.log_psi = 0.0
