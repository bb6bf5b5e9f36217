import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.density import (
    DensityParameters,
    EuclideanDistance,
    Gauge,
    ImplicitSet,
    NavigationDensity,
    TorusDistance,
    rantzer_condition,
    rantzer_map,
)
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.implicit_function import UnsafeRegion
from densarm.density.implicit_shapes import Ball
from densarm.fields.critical_point import find_critical_point


def condition(density, x):
    return rantzer_condition(density, x, np.add)


@given(st.integers(1, 6), st.sampled_from([0.1, 0.6, 1.1, 2.1]), st.floats(0.3, 3.0))
def test_free_space_has_its_closed_form(n, alpha, radius):
    """L = -α ln r²: ΔL = -2α(n - 2)/r², ‖∇L‖² = 4α²/r²."""
    density = NavigationDensity([], EuclideanDistance(np.zeros(n)), DensityParameters(alpha=alpha))
    record = condition(density, np.full(n, radius / np.sqrt(n)))
    assert record.laplacian == pytest.approx(-2.0 * alpha * (n - 2) / radius**2, abs=1e-4)
    assert record.squared_gradient == pytest.approx(4.0 * alpha**2 / radius**2, rel=1e-12)
    if n != 2:
        assert record.sign(Gauge.DENSITY) == np.sign(alpha - (n - 2) / 4)
        assert record.sign(Gauge.LOG) == np.sign(alpha - (n - 2) / 2)
        assert record.sign(Gauge.RECIPROCAL) == np.sign(2 - n)


def test_margin_is_the_divergence_of_the_flow_over_its_factor(disc):
    goal, x, step = np.array([3.0, 0.0]), np.array([-1.5, 0.2]), 1e-5
    density = NavigationDensity([ImplicitSet(*disc)], EuclideanDistance(goal))
    record, value = condition(density, x), density.evaluate(x).value
    factors = {Gauge.DENSITY: value**2, Gauge.LOG: value, Gauge.RECIPROCAL: 1.0}
    for gauge, factor in factors.items():

        def flow(y, gauge=gauge):
            sample = density.evaluate(y)
            return sample.value * sample.gradient(gauge)

        divergence = sum(
            (flow(x + axis)[i] - flow(x - axis)[i]) / (2 * step)
            for i, axis in enumerate(step * np.eye(2))
        )
        assert record.margin(gauge) == pytest.approx(divergence / factor, rel=1e-5)


def test_circle_joints_are_differenced_along_the_circle(joint_space):
    """V = 1 - cos e: L'' = 1/(1 - cos e) for α = 1."""
    arm = joint_space("c")
    density = NavigationDensity([], TorusDistance(arm, arm.configuration([0.0]), kappa=np.inf))
    record = rantzer_condition(density, arm.configuration([2.5]), arm.integrate)
    assert record.laplacian == pytest.approx(1.0 / (1.0 - np.cos(2.5)), rel=1e-6)


def test_the_map_agrees_with_the_condition_at_single_points(disc):
    goal, x = np.array([3.0, 0.0]), np.array([[[-1.5, 0.2], [0.1, 1.3]], [[-1.7, 0.2], [0.0, 5.0]]])
    single = NavigationDensity([ImplicitSet(*disc)], EuclideanDistance(goal))
    batch = EuclideanDensity([UnsafeRegion(Ball(1.0), Ball(2.0))], goal)
    record = rantzer_map(batch, x)
    for index in np.ndindex(2, 2):
        expected = condition(single, x[index])
        for gauge in Gauge:
            margin = record.margin(gauge)[index]
            assert margin == pytest.approx(expected.margin(gauge), rel=1e-5, abs=1e-5)
    assert record.laplacian[1, 1] == 0.0  # the logarithm is harmonic in the plane


@given(st.integers(1, 6), st.sampled_from([0.1, 0.6, 2.1]), st.floats(0.3, 3.0))
def test_the_map_is_exact_in_free_space(n, alpha, radius):
    density = EuclideanDensity([], np.zeros(n), DensityParameters(alpha=alpha))
    record = rantzer_map(density, np.full((1, n), radius / np.sqrt(n)))
    np.testing.assert_allclose(record.laplacian, -2.0 * alpha * (n - 2) / radius**2, rtol=1e-12)
    np.testing.assert_allclose(record.squared_gradient, 4.0 * alpha**2 / radius**2, rtol=1e-12)


def test_the_condition_fails_at_a_saddle_in_every_gauge():
    density = EuclideanDensity([UnsafeRegion(Ball(2.0), Ball(3.0))], [4.0, -3.0])
    saddle = find_critical_point(density, np.array([-2.3, 1.7]))
    record = rantzer_map(density, saddle.position)
    assert [int(record.sign(gauge)) for gauge in Gauge] == [-1, -1, -1]
