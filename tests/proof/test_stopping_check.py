"""The stopping check: what it proves holds at every brake, and what touches it refuses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.proof.stopping_check import StoppingCheck
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Scene, Sphere

ARM = load_arm("two_link")


def check_around(ball, margin=0.0):
    bound = SweptBound(Clearance(ARM, Scene([ball])), margin)
    return bound, StoppingCheck(bound, StraightBrake(ARM))


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_agrees_with_brakes_proved_one_by_one(seed):
    rng = np.random.default_rng(seed)
    place = rng.uniform([-2.0, -0.05, -2.0], [2.0, 0.05, 2.0])
    bound, check = check_around(Sphere(name="ball", radius=0.1, position=place))
    t = np.linspace(0.0, 1.0, 100)[:, np.newaxis]
    start, v = rng.uniform(-3.0, 3.0, 2), rng.uniform(-4.0, 4.0, 2) * np.cos(t)
    angles = start + np.cumsum(v, axis=0) * 0.01
    result = check.check(ARM.configurations(angles), v)
    for k in range(0, 100, 7):
        end = ARM.configuration(angles[k] + 0.5 * result.duration[k] * v[k])
        single = bound.segment_is_clear(ARM.configuration(angles[k]), end)
        if result.clear[k]:
            assert single
        else:
            wider = bound.with_margin(2e-3)
            assert not wider.segment_is_clear(ARM.configuration(angles[k]), end)


def test_ball_at_the_end_of_one_brake():
    q = ARM.configurations(np.array([[0.0, 0.0], [0.01, 0.0], [0.02, 0.0]]))
    v = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 0.0]])
    _, check = check_around(Sphere(name="ball", radius=0.02, position=(0.9, 0.0, -1.0)))
    result = check.check(q, v)
    assert result.failing.tolist() == [1]
    assert result.holds.tolist() == [True, False, True]


def test_position_limits_are_no_place_to_stop_beyond():
    arm = load_arm("panda")
    check = StoppingCheck(SweptBound(Clearance(arm, Scene())), StraightBrake(arm))
    q = arm.postures["ready"].copy()
    q[0] = arm.limits.upper[0] - 0.01
    v = np.zeros((2, 7))
    v[:, 0] = [1.0, -1.0]
    result = check.check(np.stack([q, q]), v)
    assert result.inside.tolist() == [False, True]
    assert result.failing.tolist() == [0]


@pytest.mark.parametrize("name", ["q", "v"])
def test_nothing_is_proved_of_what_is_not_a_number(name):
    _, check = check_around(Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 2.5)))
    state = {"q": ARM.configurations(np.zeros((3, 2))), "v": np.zeros((3, 2))}
    state[name][1, 0] = np.nan
    assert 1 in check.check(**state).failing
