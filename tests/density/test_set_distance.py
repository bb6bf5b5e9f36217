import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.density.implicit_function import Placed
from densarm.density.implicit_shapes import Ball, Ellipsoid, HalfSpace
from densarm.density.set_distance import boundary_points, distance_from, smallest_gap

EXTENT = np.array([[-6.0, 6.0], [-6.0, 6.0]])


def pair(first, second, count=100):
    return first, second, *(boundary_points(each, EXTENT, count) for each in (first, second))


@pytest.mark.parametrize("function", [Ball(2.0), Ellipsoid((0.5, 2.0), 1.5), HalfSpace((1.0, 1.0))])
def test_boundary_points_are_on_the_boundary_and_in_the_box(function):
    x = boundary_points(function, EXTENT, 100)
    assert len(x) > 20
    slope = np.linalg.norm(function.gradient(x), axis=1)
    np.testing.assert_allclose(function(x) / slope, 0.0, atol=1e-9)
    assert (np.abs(x) <= 6.0).all()


@settings(max_examples=8)
@given(st.floats(0.0, 2.0 * np.pi), st.floats(1.0, 4.0), st.floats(0.3, 1.0), st.floats(0.3, 1.0))
def test_distance_of_two_discs(bearing, apart, first, second):
    centre = apart * np.array([np.cos(bearing), np.sin(bearing)])
    gap = smallest_gap([pair(Ball(first), Placed(Ball(second), centre))])
    expected = apart - first - second
    if expected > 0.0:
        assert gap.distance == pytest.approx(expected, abs=1e-6)
        assert gap.overlaps == 0
    elif expected < -0.1:
        assert gap.distance == 0.0
        assert gap.overlaps == 1


def test_the_nearest_of_many_pairs_counts():
    discs = [Placed(Ball(0.5), (x, 0.0)) for x in (-4.0, -1.0, 1.0, 5.0)]
    pairs = [pair(discs[i], discs[j]) for i in range(4) for j in range(i)]
    assert smallest_gap(pairs).distance == pytest.approx(1.0, abs=1e-6)
    assert smallest_gap([]).distance == np.inf


def test_distance_of_a_point():
    ellipse = Placed(Ellipsoid((0.5, 1.0), 1.0), (1.0, 0.0))
    rim = boundary_points(ellipse, EXTENT, 200)
    assert distance_from(np.array([5.0, 0.0]), ellipse, rim) == pytest.approx(2.0, abs=1e-6)
    assert distance_from(np.array([1.0, 3.0]), ellipse, rim) == pytest.approx(2.0, abs=1e-6)
    assert distance_from(np.array([1.5, 0.2]), ellipse, rim) == 0.0
    assert distance_from(np.zeros(2), ellipse, rim[:0]) == 0.0
