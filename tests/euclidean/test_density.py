import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.joint_space import EuclideanSpace
from densarm.density.critical_points import find_critical_point
from densarm.density.goal_distance import EuclideanDistance
from densarm.density.navigation_density import DensityParameters, Gauge, NavigationDensity
from densarm.density.rantzer import rantzer_condition
from densarm.density.unsafe_sets import ImplicitSet
from densarm.errors import InvalidValueError
from densarm.euclidean.density import EuclideanDensity, rantzer_map
from densarm.euclidean.implicit import ImplicitFunction, Placed, UnsafeRegion
from densarm.euclidean.shapes import Ball, CShape, Egg, Ellipsoid, PNormBall
from densarm.values.arrays import Array

GOAL = np.array([3.0, 0.5])
REGIONS = [
    UnsafeRegion(Ball(1.0), Ellipsoid((0.8, 1.0), 2.0)),
    UnsafeRegion(
        Placed(PNormBall(0.7), (2.0, 2.0), 0.3), Placed(Egg(0.9, 1.0, 1.3, 1.5), (2.0, 2.0), 0.3)
    ),
]
clouds = arrays(np.float64, (6, 2), elements=st.floats(-4.0, 4.0))
parameters = st.builds(
    DensityParameters,
    alpha=st.sampled_from([0.2, 1.0, 2.0]),
    theta=st.sampled_from([0.0, 0.01]),
    gauge=st.sampled_from(list(Gauge)),
    blend_radius=st.sampled_from([0.0, 0.4]),
)


def single_point_density(
    regions: Sequence[UnsafeRegion], goal: Array, parameters: DensityParameters
) -> NavigationDensity:
    def paired(function: ImplicitFunction) -> Callable[[Array], tuple[float, Array]]:
        return lambda x: (float(function(x)), function.gradient(x))

    sets = [ImplicitSet(paired(region.h), paired(region.s)) for region in regions]
    return NavigationDensity(EuclideanSpace(2), goal, sets, EuclideanDistance(), parameters)


@given(x=clouds, parameters=parameters)
def test_agrees_with_the_density_of_single_points(x: Array, parameters: DensityParameters) -> None:
    batch = EuclideanDensity(REGIONS, GOAL, parameters)
    samples = [single_point_density(REGIONS, GOAL, parameters).evaluate(point) for point in x]
    values = [sample.log_value for sample in samples]
    np.testing.assert_allclose(batch.log_value(x), values, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(batch.log_psi(x), [s.log_psi for s in samples], atol=1e-12)
    for gauge in Gauge:
        expected = np.array([sample.gradient(gauge) for sample in samples])
        scale = np.abs(expected).max(axis=1, keepdims=True) + 1e-300
        np.testing.assert_allclose(batch.gradient(x, gauge) / scale, expected / scale, atol=1e-12)
    expected = np.array([sample.blended_gradient() for sample in samples])
    scale = np.abs(expected).max(axis=1, keepdims=True) + 1e-300
    np.testing.assert_allclose(batch.direction(x) / scale, expected / scale, atol=1e-12)


positive_weights = arrays(np.float64, 2, elements=st.floats(0.1, 10.0))


@given(x=clouds, weights=positive_weights, alpha=st.sampled_from([0.5, 1.0, 3.0]))
def test_weights_stretch_the_goal_distance_along_each_axis(
    x: Array, weights: Array, alpha: float
) -> None:
    parameters = DensityParameters(alpha, gauge=Gauge.LOG)
    density = EuclideanDensity([], GOAL, parameters, weights)
    stretched = EuclideanDensity([], np.sqrt(weights) * GOAL, parameters)
    assume(np.linalg.norm(x - GOAL, axis=1).min() > 0.1)
    np.testing.assert_allclose(
        density.log_value(x), stretched.log_value(np.sqrt(weights) * x), atol=1e-12
    )
    np.testing.assert_allclose(
        density.direction(x),
        np.sqrt(weights) * stretched.direction(np.sqrt(weights) * x),
        atol=1e-12,
    )


@given(weights=positive_weights)
def test_the_map_of_a_weighted_density_is_its_laplacian(weights: Array) -> None:
    density = EuclideanDensity([UnsafeRegion(Ball(1.0), Ball(2.0))], GOAL, weights=weights)
    x, step = np.array([[-1.0, 1.2], [4.0, 2.0]]), 1e-3
    total = -4.0 * density.log_value(x)
    for axis in step * np.eye(2):
        total += density.log_value(x + axis) + density.log_value(x - axis)
    np.testing.assert_allclose(
        rantzer_map(density, x).laplacian, total / step**2, rtol=1e-3, atol=1e-5
    )


@pytest.mark.parametrize("weights", [[1.0, 0.0], [1.0, -2.0], [1.0], [1.0, 1.0, 1.0]])
def test_refuses_weights_that_are_not_one_positive_number_per_axis(weights: list[float]) -> None:
    with pytest.raises(InvalidValueError, match="weights"):
        EuclideanDensity([], GOAL, weights=weights)


def test_any_batch_shape() -> None:
    density = EuclideanDensity(REGIONS, GOAL)
    x = np.random.default_rng(0).uniform(-3.0, 3.0, (4, 5, 2))
    assert density.height(x).shape == (4, 5)
    assert density.direction(x).shape == (4, 5, 2)
    np.testing.assert_allclose(density.direction(x)[2, 3], density.direction(x[2, 3]), rtol=1e-12)


def test_without_obstacles_it_leads_straight_to_the_goal() -> None:
    density = EuclideanDensity([], GOAL, DensityParameters(gauge=Gauge.LOG))
    x = np.array([[0.0, 0.5], [3.0, -1.5]])
    np.testing.assert_allclose(density.direction(x), [[2.0 / 3.0, 0.0], [0.0, 1.0]], rtol=1e-12)
    assert density.obstacles == ()


def test_psi_is_theta_in_the_unsafe_set_also_where_it_is_not_sensed() -> None:
    region = UnsafeRegion(CShape(2.2, 0.4, 0.0, 2.0), Egg(1.0, 1.0, 1.1, 2.0))
    bare = np.array([-2.4, 0.0])  # in the C, out of the egg
    assert region.h(bare) < 0.0 < region.s(bare)
    assert EuclideanDensity([region], GOAL).log_psi(bare) == -math.inf
    shifted = EuclideanDensity([region], GOAL, DensityParameters(theta=0.1))
    assert shifted.log_psi(bare) == pytest.approx(math.log(0.1), rel=1e-12)


def test_the_map_agrees_with_the_condition_at_single_points() -> None:
    goal, x = np.array([3.0, 0.0]), np.array([[[-1.5, 0.2], [0.1, 1.3]], [[-1.7, 0.2], [0.0, 5.0]]])
    regions = [UnsafeRegion(Ball(1.0), Ball(2.0))]
    batch, single = (
        EuclideanDensity(regions, goal),
        single_point_density(regions, goal, DensityParameters()),
    )
    record = rantzer_map(batch, x)
    for index in np.ndindex(2, 2):
        expected = rantzer_condition(single, x[index])
        for gauge in Gauge:
            margin = record.margin(gauge)[index]
            assert margin == pytest.approx(expected.margin(gauge), rel=1e-5, abs=1e-5)
    assert record.laplacian[1, 1] == 0.0  # the logarithm is harmonic in the plane


@given(st.integers(1, 6), st.sampled_from([0.1, 0.6, 2.1]), st.floats(0.3, 3.0))
def test_the_map_is_exact_in_free_space(n: int, alpha: float, radius: float) -> None:
    density = EuclideanDensity([], np.zeros(n), DensityParameters(alpha=alpha))
    record = rantzer_map(density, np.full((1, n), radius / np.sqrt(n)))
    np.testing.assert_allclose(record.laplacian, -2.0 * alpha * (n - 2) / radius**2, rtol=1e-12)
    np.testing.assert_allclose(record.squared_gradient, 4.0 * alpha**2 / radius**2, rtol=1e-12)


def test_the_condition_fails_at_a_saddle_in_every_gauge() -> None:
    density = EuclideanDensity([UnsafeRegion(Ball(2.0), Ball(3.0))], [4.0, -3.0])
    saddle = find_critical_point(lambda x: density.gradient(x, Gauge.LOG), np.array([-2.3, 1.7]))
    record = rantzer_map(density, saddle.position)
    assert [int(record.sign(gauge)) for gauge in Gauge] == [-1, -1, -1]
