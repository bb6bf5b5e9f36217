import numpy as np
import pytest
from scipy.optimize import brentq

from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.gauge import Gauge
from densarm.density.implicit_function import UnsafeRegion
from densarm.density.implicit_shapes import Ball, CShape, Ellipsoid
from densarm.fields.critical_point import CriticalKind, find_critical_point, log_hessian

GOAL = np.array([4.0, -3.0])
AWAY = -GOAL / 5.0


def disc():
    return EuclideanDensity([UnsafeRegion(Ball(2.0), Ball(3.0))], GOAL)


def test_the_saddle_behind_a_disc():
    density = disc()
    radius = brentq(lambda r: density.gradient(r * AWAY, Gauge.LOG) @ AWAY, 2.5, 2.99, xtol=1e-14)
    point = find_critical_point(density, 2.6 * AWAY + 0.05)
    assert point.kind is CriticalKind.SADDLE
    assert point.slope < 1e-10
    np.testing.assert_allclose(point.position, radius * AWAY, atol=1e-9)
    assert point.eigenvalues[0] < 0.0 < point.eigenvalues[1]


def test_a_flat_sensing_region_makes_a_maximum_of_it():
    flat = Ellipsoid((0.1, 1.0), 1.0)  # 20 m wide, flatter than a circle of 6 m about the goal
    density = EuclideanDensity([UnsafeRegion(flat, Ellipsoid((0.1, 1.0), 1.6))], [0.0, -5.0])
    point = find_critical_point(density, np.array([0.1, 1.5]))
    assert point.slope < 1e-10
    assert point.kind is CriticalKind.MAXIMUM


def test_hessian_is_the_derivative_of_the_gradient_along_any_direction():
    density, x, along = disc(), np.array([-2.3, 0.7]), np.array([0.6, 0.8])
    step = 1e-4
    ahead, behind = (density.gradient(x + s * step * along, Gauge.LOG) for s in (1.0, -1.0))
    expected = (ahead - behind) / (2.0 * step)
    np.testing.assert_allclose(log_hessian(density, x) @ along, expected, rtol=1e-4)


def test_in_free_space_the_hessian_is_known():
    x = np.array([-6.0, 1.0])
    error = x - GOAL
    square = error @ error
    expected = -2.0 * (np.eye(2) - 2.0 * np.outer(error, error) / square) / square
    np.testing.assert_allclose(log_hessian(disc(), x), expected, atol=1e-8)


def test_where_newton_finds_nothing_the_slope_tells():
    density = EuclideanDensity([UnsafeRegion(CShape(2.2, 0.4, 0.0, 2.0), Ball(4.0))], GOAL)
    assert find_critical_point(density, np.array([20.0, 20.0]), iterations=5).slope == (
        pytest.approx(2.0 / np.linalg.norm(np.array([20.0, 20.0]) - GOAL), rel=0.05)
    )
