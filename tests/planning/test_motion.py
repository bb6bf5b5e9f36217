"""The motion: Hermite polynomials through its knots, at rest beyond its ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.errors import DensarmError, InvalidValueError
from densarm.planning.motion import Motion, PlanningError
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome

PERIOD = 0.01  # [s]
TIME: Array = PERIOD * np.arange(101, dtype=np.float64)


def swing(t: float | Array, order: int = 0) -> Array:
    """A motion from rest to rest in one second, or its derivative."""
    w = np.pi
    wave = [0.5 - 0.5 * np.cos(w * t), 0.5 * w * np.sin(w * t), 0.5 * w**2 * np.cos(w * t)][order]
    return np.stack([2.0 * wave, -wave], axis=-1)


@pytest.fixture(scope="module")
def motion() -> Motion:
    velocity = swing(TIME, 1)
    velocity[-1] = 0.0
    return Motion(PERIOD, swing(TIME), velocity)


def test_goes_through_its_knots(motion: Motion) -> None:
    for k in range(100):
        point = motion.sample(k * PERIOD + 1e-12)
        np.testing.assert_allclose(point.position, swing(TIME[k]), atol=1e-9)
        np.testing.assert_allclose(point.velocity, swing(TIME[k], 1), atol=1e-9)


@given(t=st.floats(0.0, 0.999))
def test_follows_the_motion_between_knots(motion: Motion, t: float) -> None:
    point = motion.sample(t)
    np.testing.assert_allclose(point.position, swing(t), atol=1e-6)
    np.testing.assert_allclose(point.velocity, swing(t, 1), atol=1e-4)
    np.testing.assert_allclose(point.acceleration, swing(t, 2), atol=5e-3)


@given(k=st.integers(0, 99), x=st.floats(0.1, 0.9))
def test_derivatives_by_differences(motion: Motion, k: int, x: float) -> None:
    t, h = (k + x) * PERIOD, 1e-6
    ahead, behind, here = motion.sample(t + h), motion.sample(t - h), motion.sample(t)
    slope = (ahead.position - behind.position) / (2 * h)
    curvature = (ahead.velocity - behind.velocity) / (2 * h)
    np.testing.assert_allclose(here.velocity, slope, atol=1e-6)
    np.testing.assert_allclose(here.acceleration, curvature, atol=1e-5)


@pytest.mark.parametrize("t", [-1.0, 1.0, 1.5, 1e9])
def test_rests_beyond_its_ends(motion: Motion, t: float) -> None:
    point = motion.sample(t)
    np.testing.assert_array_equal(point.position, swing(0.0 if t < 0 else TIME[-1]))
    np.testing.assert_array_equal(point.velocity, 0.0)
    np.testing.assert_array_equal(point.acceleration, 0.0)


def test_duration(motion: Motion) -> None:
    assert motion.duration == pytest.approx(1.0)


@given(period=st.floats(0.004, 2.0))
def test_samples_at_equal_intervals_include_the_end(motion: Motion, period: float) -> None:
    samples = motion.samples(period)
    np.testing.assert_allclose(np.diff(samples.time)[:-1], period, rtol=1e-9)
    assert 0.0 < np.diff(samples.time)[-1] <= period * (1.0 + 1e-6)
    assert (samples.time[0], samples.time[-1]) == (0.0, motion.duration)
    for k in (0, len(samples.time) // 2, -1):
        point = motion.sample(samples.time[k])
        np.testing.assert_array_equal(samples.position[k], point.position)
        np.testing.assert_array_equal(samples.velocity[k], point.velocity)
        np.testing.assert_array_equal(samples.acceleration[k], point.acceleration)


@pytest.mark.parametrize(("period", "count"), [(0.1, 11), (0.01, 101), (0.3, 5), (5.0, 2)])
def test_a_period_that_divides_the_duration_adds_no_sample(
    motion: Motion, period: float, count: int
) -> None:
    samples = motion.samples(period)
    assert len(samples.time) == count
    assert samples.position.shape == samples.velocity.shape == (count, 2)
    np.testing.assert_array_equal(samples.velocity[[0, -1]], 0.0)


def test_derivatives_of_samples_by_differences(motion: Motion) -> None:
    samples, h = motion.samples(1e-4), 1e-4
    slope = (samples.position[2:] - samples.position[:-2]) / (2 * h)
    np.testing.assert_allclose(samples.velocity[1:-1], slope, rtol=0, atol=1e-5)
    inside = np.arange(1, len(samples.time) - 1) % 100 != 0  # the acceleration jumps at knots
    curvature = (samples.velocity[2:] - samples.velocity[:-2]) / (2 * h)
    apart = samples.acceleration[1:-1][inside] - curvature[inside]
    np.testing.assert_allclose(apart, 0.0, rtol=0, atol=1e-4)


def test_a_lead_takes_the_acceleration_later(motion: Motion) -> None:
    now, then = motion.sample(0.2, lead=0.1), motion.sample(0.3)
    np.testing.assert_array_equal(now.position, motion.sample(0.2).position)
    np.testing.assert_allclose(now.acceleration, then.acceleration, rtol=1e-9)


@pytest.mark.parametrize("period", [0.0, -0.1, np.nan, "short", 1e-9, 1e-320])
def test_the_period_of_samples_is_checked(motion: Motion, period: float) -> None:
    with pytest.raises(InvalidValueError, match=r"^period = "):
        motion.samples(period)


def test_a_planning_error_is_an_error_of_the_library_with_its_parts(motion: Motion) -> None:
    error = PlanningError(Outcome.STUCK, "a wall", motion)
    assert isinstance(error, DensarmError)
    assert (error.outcome, error.detail, error.motion) == (Outcome.STUCK, "a wall", motion)
    assert str(error) == "stuck: a wall"
    assert PlanningError(Outcome.NO_PATH, "a wall").motion is None
