"""The field: the direction of ∇ρ, no faster than the speed law, zero where ρ has no slope."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.density import Gauge
from densarm.density.distance_bounds import ExactDistances
from densarm.fields import DensityField, SpeedLaw, SpeedParameters

ANGLES = st.tuples(*[st.floats(-3, 3)] * 2)


@pytest.fixture(scope="module")
def parts(make_guided):
    bound, guided = make_guided("direct", goal=(0.3, -0.2))
    law = SpeedLaw(bound, SpeedParameters())
    return bound, guided, law, DensityField(guided, law, rate=10.0)


@given(angles=ANGLES)
def test_direction_is_the_gradient_and_speed_within_the_law(parts, angles):
    bound, guided, law, field = parts
    q = bound.arm.configuration(angles)
    k = field.update(q)
    gradient = guided.density.evaluate(q).gradient(Gauge.RECIPROCAL)
    norm = np.linalg.norm(k)
    assert k @ gradient == pytest.approx(norm * np.linalg.norm(gradient))
    if norm > 0.0:
        distance = ExactDistances(bound.clearance.distances(q))
        assert norm <= law.speed(q, k / norm, distance, sum(guided.way_left(q))) * (1 + 1e-9)


def test_no_jump_where_the_next_sub_goal_comes_in_sight(make_guided):
    bound, guided = make_guided()
    field = DensityField(guided, SpeedLaw(bound, SpeedParameters()), rate=10.0)
    q, speeds = guided.chain.q[0], []
    for _ in range(600):
        k = field.update(q)
        speeds.append(np.linalg.norm(k))
        q = bound.arm.integrate(q, 0.002 * k)
    assert guided.chain.current > 20
    assert (np.diff(speeds) / speeds[1:]).max() < 0.1


def test_near_the_goal_it_is_linear(parts):
    bound, _, _, field = parts
    q = bound.arm.configuration([0.3 + 1e-4, -0.2 - 2e-4])
    np.testing.assert_allclose(field.update(q), [-1e-3, 2e-3], rtol=1e-3)


def test_metric_bends_the_direction(parts):
    bound, _, _, field = parts
    q, metric = bound.arm.configuration([0.31, -0.19]), np.diag([1.0, 2.0])
    np.testing.assert_allclose(field.update(q, metric), field.update(q) / [1.0, 2.0], rtol=1e-12)


def test_zero_at_a_critical_point(make_guided):
    bound, guided = make_guided("direct")
    field = DensityField(guided, SpeedLaw(bound, SpeedParameters()), rate=10.0)
    np.testing.assert_array_equal(field.update(bound.arm.configuration([0, 0])), 0.0)


@pytest.mark.parametrize("gauge", Gauge)
def test_blend_is_linear_near_the_goal_in_every_gauge(make_guided, gauge):
    bound, guided = make_guided("direct", goal=(0.3, -0.2), gauge=gauge, blend_radius=0.05)
    field = DensityField(guided, SpeedLaw(bound, SpeedParameters()), rate=10.0)
    q = bound.arm.configuration([0.301, -0.2])
    np.testing.assert_allclose(field.update(q), [-0.01, 0.0], rtol=1e-9, atol=1e-12)
