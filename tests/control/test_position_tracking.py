"""Positions of a motion, streamed: they never jump, and come to rest inside the limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.control.position_tracking import PositionTracking
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.planning.plan import plan_motion
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.world import World

PERIOD = 0.004  # [s]


@pytest.fixture(scope="module")
def arm() -> Arm:
    return load_arm("ur5")


@pytest.fixture(scope="module")
def motion(arm: Arm) -> Motion:
    start, goal = (arm.configuration([x, -1.5, 1.5, -1.5, -1.5, 0.0]) for x in (-0.8, 0.8))
    return plan_motion(World(arm, Scene()), start, goal, period=PERIOD)


def ticks(count: int) -> Array:
    return PERIOD * np.arange(count, dtype=np.float64)


def followed(tracking: PositionTracking, arm: Arm, times: Array) -> Array:
    """Return what is told (N, nv) to a robot that is where it was told to be before."""
    told = [tracking.motion.position[0]]
    for t in times:
        told.append(tracking.position(t, arm.configuration(told[-1]), np.zeros(arm.nv)))
    return np.array(told)


def test_the_motion_is_told_one_period_ahead(arm: Arm, motion: Motion) -> None:
    times = ticks(len(motion.position))
    told = followed(PositionTracking(arm, motion), arm, times)
    np.testing.assert_allclose(told[1:-1], motion.position[1:], atol=1e-9)


@settings(max_examples=8)
@given(share=st.floats(0.0, 1.0))
def test_a_pause_rests_on_the_motion_inside_the_limits_and_goes_on(
    arm: Arm, motion: Motion, share: float
) -> None:
    tracking, steps = PositionTracking(arm, motion), len(motion.position)
    times = ticks(2 * steps + 800)
    at = int(share * steps)
    told = [followed(tracking, arm, times[:at])]
    tracking.pause("for a test")
    told.append(followed_from(tracking, arm, told[0][-1], times[at : at + 400]))
    assert tracking.is_paused
    assert tracking.describe_stall(arm.configuration(told[1][-1])) == "for a test"
    tracking.resume()
    told.append(followed_from(tracking, arm, told[1][-1], times[at + 400 :]))
    every = np.vstack(told)
    a = np.diff(every, 2, axis=0) / PERIOD**2
    assert (np.abs(a) <= 1.02 * arm.limits.acceleration).all()
    assert (np.abs(np.diff(every, axis=0)) <= PERIOD * arm.limits.velocity).all()
    np.testing.assert_allclose(every[-1], motion.position[-1], atol=1e-6)


def followed_from(tracking: PositionTracking, arm: Arm, last: Array, times: Array) -> Array:
    told = []
    for t in times:
        last = tracking.position(t, arm.configuration(last), np.zeros(arm.nv))
        told.append(last)
    return np.array(told)


def test_a_late_call_lets_the_motion_wait(arm: Arm, motion: Motion) -> None:
    tracking = PositionTracking(arm, motion)
    last = followed(tracking, arm, ticks(50))[-1]
    late = tracking.position(50 * PERIOD + 0.5, arm.configuration(last), np.zeros(arm.nv))
    assert (np.abs(late - last) <= 3.0 * PERIOD * arm.limits.velocity).all()


def test_an_arm_that_is_pushed_off_pauses_and_says_which_joint(arm: Arm, motion: Motion) -> None:
    tracking = PositionTracking(arm, motion)
    last = followed(tracking, arm, ticks(50))[-1]
    pushed = arm.configuration(last + np.eye(arm.nv)[2] * 0.5)
    tracking.position(50 * PERIOD, pushed, np.zeros(arm.nv))
    assert "elbow_joint was 0.5" in tracking.describe_stall(pushed)
    assert tracking.tracking_error == pytest.approx(0.5, abs=0.05)


def test_a_lag_is_positive(arm: Arm, motion: Motion) -> None:
    with pytest.raises(InvalidValueError, match="lag = 0"):
        PositionTracking(arm, motion, lag=0.0)
