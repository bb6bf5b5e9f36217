import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.density.enclosing_ellipsoid import Ellipsoid, enclosing_ellipsoid
from densarm.errors import InvalidValueError


@given(seed=st.integers(0, 10_000), n=st.integers(1, 3), count=st.integers(6, 60))
def test_encloses_every_point(seed, n, count):
    points = np.random.default_rng(seed).normal(size=(count, n))
    assert (enclosing_ellipsoid(points).level(points) <= 1.0).all()


def test_of_a_box_is_its_circumscribed_ellipse():
    ellipse = enclosing_ellipsoid(np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [0.0, 2.0]]))
    np.testing.assert_allclose(ellipse.centre, [3.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(ellipse.semi_axes, np.sqrt(2.0) * np.array([1.0, 3.0]))
    np.testing.assert_allclose(ellipse.extent, np.sqrt(2.0) * np.array([3.0, 1.0]))


@given(turn=st.floats(0.0, 3.0), by=st.floats(0.0, 2.0))
def test_inflation_lengthens_every_semi_axis(turn, by):
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    ellipse = Ellipsoid(np.array([1.0, -2.0]), (rotation * np.array([0.25, 4.0])) @ rotation.T)
    inflated = ellipse.inflated(by)
    np.testing.assert_allclose(inflated.semi_axes, np.array([0.5, 2.0]) + by)
    np.testing.assert_allclose(
        inflated.level(ellipse.centre + (2.0 + by) * rotation[:, 1]), 1.0, rtol=1e-9
    )


def test_does_not_deflate():
    with pytest.raises(InvalidValueError, match=r"by = -0\.1"):
        Ellipsoid(np.zeros(2), np.eye(2)).inflated(-0.1)
