"""The reference: Hermite polynomials through its samples, at rest beyond its ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.reference import Reference

PERIOD = 0.01  # [s]
TIME = PERIOD * np.arange(101)


def swing(t, order=0):
    """A motion from rest to rest in one second, or its derivative."""
    w = np.pi
    wave = [0.5 - 0.5 * np.cos(w * t), 0.5 * w * np.sin(w * t), 0.5 * w**2 * np.cos(w * t)][order]
    return np.stack([2.0 * wave, -wave], axis=-1)


@pytest.fixture(scope="module")
def reference():
    velocity = swing(TIME, 1)
    velocity[-1] = 0.0
    return Reference(PERIOD, swing(TIME), velocity)


def test_goes_through_its_samples(reference):
    for k in range(100):
        point = reference.sample(k * PERIOD + 1e-12)
        np.testing.assert_allclose(point.position, swing(TIME[k]), atol=1e-9)
        np.testing.assert_allclose(point.velocity, swing(TIME[k], 1), atol=1e-9)


@given(t=st.floats(0.0, 0.999))
def test_follows_the_motion_between_samples(reference, t):
    point = reference.sample(t)
    np.testing.assert_allclose(point.position, swing(t), atol=1e-6)
    np.testing.assert_allclose(point.velocity, swing(t, 1), atol=1e-4)
    np.testing.assert_allclose(point.acceleration, swing(t, 2), atol=5e-3)


@given(k=st.integers(0, 99), x=st.floats(0.1, 0.9))
def test_derivatives_by_differences(reference, k, x):
    t, h = (k + x) * PERIOD, 1e-6
    ahead, behind, here = reference.sample(t + h), reference.sample(t - h), reference.sample(t)
    slope = (ahead.position - behind.position) / (2 * h)
    curvature = (ahead.velocity - behind.velocity) / (2 * h)
    np.testing.assert_allclose(here.velocity, slope, atol=1e-6)
    np.testing.assert_allclose(here.acceleration, curvature, atol=1e-5)


@pytest.mark.parametrize("t", [-1.0, 1.0, 1.5, 1e9])
def test_rests_beyond_its_ends(reference, t):
    point = reference.sample(t)
    np.testing.assert_array_equal(point.position, swing(0.0 if t < 0 else TIME[-1]))
    np.testing.assert_array_equal(point.velocity, 0.0)
    np.testing.assert_array_equal(point.acceleration, 0.0)


def test_duration(reference):
    assert reference.duration == pytest.approx(1.0)
