"""An enclosing tube holds its points, and those on a line need no radius."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.proof.enclosing_tube import enclosing_tube

NUMBERS = st.floats(-4.0, 4.0)
POINTS = st.integers(1, 9).flatmap(lambda n: arrays(float, (n, 3), elements=NUMBERS))


def off(tube, points):
    """Return, for each point, by how much it is outside the tube at the best of many places."""
    share = np.linspace(0.0, 1.0, 2001)
    middle = tube.begin + share[:, np.newaxis] * tube.step
    outside = np.abs(points[:, np.newaxis] - middle) - tube.radius
    return outside.max(axis=2).min(axis=1)


@given(points=POINTS, step=arrays(float, 3, elements=NUMBERS))
def test_holds_every_point(points, step):
    tube = enclosing_tube(points, step)
    assert (tube.radius >= 0.0).all()
    # Places are this far apart.
    assert (off(tube, points) <= np.abs(step).max() / 2000 + 1e-9).all()


@given(begin=arrays(float, 3, elements=NUMBERS), step=arrays(float, 3, elements=NUMBERS))
def test_points_on_the_segment_need_no_radius(begin, step):
    share = np.linspace(0.0, 1.0, 7)[:, np.newaxis]
    tube = enclosing_tube(begin + share * step, step)
    np.testing.assert_allclose(tube.radius, 0.0, atol=1e-12)


def test_points_beside_it_need_half_their_spread():
    points = np.array([[0.0, 0.0], [1.0, 0.2], [2.0, 0.0], [3.0, 0.1]])
    tube = enclosing_tube(points, np.array([3.0, 0.0]))
    assert tube.radius == pytest.approx([0.0, 0.1])
    assert tube.begin == pytest.approx([0.0, 0.1])
