"""Stopping trajectories: inside the limits all along, on a line, no longer than they must be."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm
from densarm.errors import SceneChangedError
from densarm.scene.obstacles import Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.stopping import HELD_SHARE, StoppingCheck, StoppingTrajectory
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

BETWEEN = 1.05  # by which torques may exceed their limits between the instants that are checked


def with_effort(arm: Arm, shoulder: str, elbow: str = "30") -> Arm:
    """A two-link arm of other torque limits."""
    urdf = arm.description.urdf.replace('effort="60"', f'effort="{shoulder}"')
    return Arm(replace(arm.description, urdf=urdf.replace('effort="30"', f'effort="{elbow}"')))


@pytest.fixture(scope="module")
def weak_arm(two_link: Arm) -> Arm:
    """It can hold itself everywhere, and little more."""
    return with_effort(two_link, "24", "6.5")


@pytest.fixture(scope="module", params=["panda", "weak"])
def arm(request: pytest.FixtureRequest, weak_arm: Arm, arm_named: Callable[[str], Arm]) -> Arm:
    return weak_arm if request.param == "weak" else arm_named(request.param)


def torques(arm: Arm, q: Array, v: Array, duration: float, shares: Array) -> Array:
    def each() -> Iterator[Array]:
        angles = arm.angles(q)
        for x in shares:
            ahead = arm.configuration(angles + (x - 0.5 * x**2) * duration * v)
            yield pin.rnea(arm.model, arm.data, ahead, (1.0 - x) * v, -v / duration).copy()

    return np.array(list(each()))


@settings(max_examples=40)
@given(
    angles=arrays(float, 7, elements=st.floats(-1.5, 1.5)),
    v=arrays(float, 7, elements=st.floats(-3.0, 3.0, allow_subnormal=False)),
)
def test_limits_hold_all_along(arm: Arm, angles: Array, v: Array) -> None:
    q, v = arm.configuration(angles[: arm.nv]), v[: arm.nv]
    duration = StoppingTrajectory(arm).duration(q, v)
    if not np.isfinite(duration) or not v.any():
        return
    held = HELD_SHARE * arm.limits.acceleration * (1 + 1e-9)
    assert (np.abs(v) <= held * duration).all()
    checked = torques(arm, q, v, duration, np.linspace(0, 1, 5))
    assert (np.abs(checked) <= arm.limits.effort * (1 + 1e-6)).all()
    if duration < 0.3:  # five instants say little of a long one
        every = torques(arm, q, v, duration, np.linspace(0, 1, 41))
        assert (np.abs(every) <= BETWEEN * arm.limits.effort).all()


def test_torque_limits_lengthen_it(two_link: Arm, weak_arm: Arm) -> None:
    q, v = two_link.configuration([1.5, 0.0]), np.array([-2.0, 0.5])
    fast, slow = (StoppingTrajectory(arm).duration(q, v) for arm in (two_link, weak_arm))
    assert fast == pytest.approx((np.abs(v) / (HELD_SHARE * two_link.limits.acceleration)).max())
    assert slow > 1.5 * fast
    # Hardly shorter, and a torque exceeds its limit.
    shorter = torques(weak_arm, q, v, 0.97 * slow, np.linspace(0, 1, 5))
    assert (np.abs(shorter) > weak_arm.limits.effort).any()


def test_shares_of_the_limits_lengthen_it(two_link: Arm, weak_arm: Arm) -> None:
    q, v = two_link.configuration([1.5, 0.0]), np.array([-2.0, 0.5])
    whole, half = (
        StoppingTrajectory(two_link, acceleration_share=share).duration(q, v)
        for share in (1.0, 0.5)
    )
    assert half == pytest.approx(2.0 * whole)
    less = StoppingTrajectory(weak_arm, torque_share=0.9).duration(q, v)
    assert less > StoppingTrajectory(weak_arm).duration(q, v)
    kept = torques(weak_arm, q, v, less, np.linspace(0, 1, 5))
    assert (np.abs(kept) <= 0.9 * weak_arm.limits.effort * (1 + 1e-6)).all()


def test_none_where_the_arm_cannot_hold_itself(two_link: Arm) -> None:
    arm, v = with_effort(two_link, "5"), np.array([0.1, 0.0])
    stopping = StoppingTrajectory(arm)
    assert stopping.duration(arm.configuration([1.5, 0.0]), v) == np.inf
    assert np.isfinite(stopping.duration(arm.configuration([0.0, 0.0]), v))


def test_many_states_at_once_are_each_their_own(arm: Arm) -> None:
    rng = np.random.default_rng(0)
    q = arm.configurations(rng.uniform(-1, 1, (20, arm.nv)))
    v = rng.uniform(-3, 3, (20, arm.nv))
    v[3] = 0.0
    stopping = StoppingTrajectory(arm)
    durations = stopping.durations(q, v)
    assert durations[3] == 0.0
    np.testing.assert_array_equal(
        durations, [stopping.duration(*state) for state in zip(q, v, strict=True)]
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_none_from_what_is_no_state(arm: Arm, value: float) -> None:
    q, v = arm.configuration(np.zeros(arm.nv)), np.full(arm.nv, value)
    assert not np.isfinite(StoppingTrajectory(arm).duration(q, v))


# Proofs that they touch nothing


def check_around(
    arm: Arm, *obstacles: Obstacle, margin: float = 0.0
) -> tuple[World, StoppingCheck]:
    world = World(arm, Scene(obstacles))
    return world, StoppingCheck(world, StoppingTrajectory(arm), margin)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**32 - 1), margin=st.sampled_from([0.0, 0.03]))
def test_agrees_with_those_proved_one_by_one(two_link: Arm, seed: int, margin: float) -> None:
    arm, rng = two_link, np.random.default_rng(seed)
    place = rng.uniform([-2.0, -0.05, -2.0], [2.0, 0.05, 2.0])
    ball = Sphere(name="ball", radius=0.1, position=place)
    world, check = check_around(arm, ball, margin=margin)
    exact, wider = SweptCheck(world, margin), SweptCheck(world, 1.01 * margin + 2e-3)
    t = np.linspace(0.0, 1.0, 100)[:, np.newaxis]
    start, v = rng.uniform(-3.0, 3.0, 2), rng.uniform(-4.0, 4.0, 2) * np.cos(t)
    angles = start + np.cumsum(v, axis=0) * 0.01
    result = check.check(arm.configurations(angles), v)
    for k in range(0, 100, 7):
        begin = arm.configuration(angles[k])
        end = arm.configuration(angles[k] + 0.5 * result.duration[k] * v[k])
        np.testing.assert_allclose(np.cos(result.end[k] - arm.angles(end)), 1.0, atol=1e-9)
        if result.clear[k]:
            assert exact.segment_is_clear(begin, end)
        else:
            assert not wider.segment_is_clear(begin, end)


def test_ball_at_the_end_of_one_of_them(two_link: Arm) -> None:
    q = two_link.configurations(np.array([[0.0, 0.0], [0.01, 0.0], [0.02, 0.0]]))
    v = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 0.0]])
    _, check = check_around(two_link, Sphere(name="ball", radius=0.02, position=(0.9, 0.0, -1.0)))
    result = check.check(q, v)
    assert result.failing.tolist() == [1]
    assert result.holds.tolist() == [True, False, True]


def test_position_limits_are_no_place_to_stop_beyond(arm_named: Callable[[str], Arm]) -> None:
    arm = arm_named("panda")
    _, check = check_around(arm)
    q = arm.postures["ready"].copy()
    q[0] = arm.limits.upper[0] - 0.01
    v = np.zeros((2, 7))
    v[:, 0] = [1.0, -1.0]
    result = check.check(np.stack([q, q]), v)
    assert result.inside.tolist() == [False, True]
    assert result.failing.tolist() == [0]


def test_stopping_is_not_proved_where_the_arm_cannot_stop(two_link: Arm) -> None:
    arm = with_effort(two_link, "5")
    _, check = check_around(arm)
    q = arm.configurations(np.array([[0.0, 0.0], [1.5, 0.0]]))
    result = check.check(q, np.full((2, 2), 0.1))
    assert np.isfinite(result.duration).tolist() == [True, False]
    assert result.holds.tolist() == [True, False]


@pytest.mark.parametrize("name", ["q", "v"])
def test_nothing_is_proved_of_what_is_not_a_number(two_link: Arm, name: str) -> None:
    _, check = check_around(two_link, Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 2.5)))
    state = {"q": two_link.configurations(np.zeros((3, 2))), "v": np.zeros((3, 2))}
    state[name][1, 0] = np.nan
    assert 1 in check.check(**state).failing


def test_obstacles_that_change_ask_for_a_new_check(two_link: Arm) -> None:
    world, check = check_around(two_link, Sphere(name="ball", radius=0.1, position=(0, 0, 2.5)))
    q, v = two_link.configurations(np.zeros((1, 2))), np.zeros((1, 2))
    assert check.check(q, v).holds.all()
    world.move_obstacle("ball", (0.0, 0.0, -1.0))
    with pytest.raises(SceneChangedError):
        check.check(q, v)
