"""Barriers: distances less the margin, then the room to every position limit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.errors import InvalidValueError
from densarm.fields.barriers import Barriers
from densarm.scene import Scene, Sphere

SCENE = Scene([Sphere(name="ball", radius=0.1, position=[0.5, 0.1, 0.4])])


@pytest.fixture(scope="module")
def barriers():
    return Barriers(Clearance(load_arm("panda", shapes="capsule"), SCENE), 0.01)


@given(share=st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7))
def test_pairs_then_limits(barriers, share):
    clearance, limits = barriers.clearance, barriers.clearance.arm.limits
    q = limits.lower + np.array(share) * (limits.upper - limits.lower)
    barriers.update(q)
    sample = clearance.evaluate(q)
    room = np.concatenate([sample.distance - 0.01, q - limits.lower, limits.upper - q])
    np.testing.assert_allclose(barriers.value, room, atol=1e-15)
    slopes = np.vstack([sample.gradient, np.eye(7), -np.eye(7)])
    np.testing.assert_array_equal(barriers.gradient, slopes)


def test_spread_tells_pairs_from_limits(barriers):
    spread = barriers.spread(2.0, 3.0)
    assert spread.shape == barriers.value.shape
    np.testing.assert_array_equal(spread[-14:], 3.0)
    np.testing.assert_array_equal(spread[:-14], 2.0)


def test_circles_have_no_limits():
    arm = load_arm("two_link")
    clearance = Clearance(arm, Scene([]))
    assert Barriers(clearance, 0.0).value.shape == (clearance.n_pairs,)


def test_margin_is_checked(barriers):
    with pytest.raises(InvalidValueError, match="margin"):
        Barriers(barriers.clearance, -0.1)
