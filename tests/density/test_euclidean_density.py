import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.density import (
    DensityParameters,
    EuclideanDistance,
    Gauge,
    ImplicitSet,
    NavigationDensity,
)
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.implicit_function import Placed, UnsafeRegion
from densarm.density.implicit_shapes import Ball, CShape, Egg, Ellipsoid, PNormBall

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


def single_point_density(regions, parameters):
    def paired(function):
        return lambda x: (float(function(x)), function.gradient(x))

    sets = [ImplicitSet(paired(region.h), paired(region.s)) for region in regions]
    return NavigationDensity(sets, EuclideanDistance(GOAL), parameters)


@given(x=clouds, parameters=parameters)
def test_agrees_with_the_density_of_single_points(x, parameters):
    batch = EuclideanDensity(REGIONS, GOAL, parameters)
    samples = [single_point_density(REGIONS, parameters).evaluate(point) for point in x]
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


def test_any_batch_shape():
    density = EuclideanDensity(REGIONS, GOAL)
    x = np.random.default_rng(0).uniform(-3.0, 3.0, (4, 5, 2))
    assert density.height(x).shape == (4, 5)
    assert density.direction(x).shape == (4, 5, 2)
    np.testing.assert_allclose(density.direction(x)[2, 3], density.direction(x[2, 3]), rtol=1e-12)


def test_without_obstacles_it_leads_straight_to_the_goal():
    density = EuclideanDensity([], GOAL, DensityParameters(gauge=Gauge.LOG))
    x = np.array([[0.0, 0.5], [3.0, -1.5]])
    np.testing.assert_allclose(density.direction(x), [[2.0 / 3.0, 0.0], [0.0, 1.0]], rtol=1e-12)
    assert density.obstacles == ()


def test_psi_is_theta_in_the_unsafe_set_also_where_it_is_not_sensed():
    region = UnsafeRegion(CShape(2.2, 0.4, 0.0, 2.0), Egg(1.0, 1.0, 1.1, 2.0))
    bare = np.array([-2.4, 0.0])  # in the C, out of the egg
    assert region.h(bare) < 0.0 < region.s(bare)
    assert EuclideanDensity([region], GOAL).log_psi(bare) == -math.inf
    shifted = EuclideanDensity([region], GOAL, DensityParameters(theta=0.1))
    assert shifted.log_psi(bare) == pytest.approx(math.log(0.1), rel=1e-12)
