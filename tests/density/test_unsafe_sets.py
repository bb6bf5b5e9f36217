"""Unsafe sets: the sums of the logarithms of their bumps, and the gradients of these."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm, load_arm
from densarm.arms.dynamics import Kinematics
from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.unsafe_sets import (
    ClearanceSet,
    ImplicitSet,
    JointLimitSet,
    SensingParameters,
    UnsafeSet,
)
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Box, Capsule, HalfSpace, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.world import World

GANTRY = Path(__file__).parents[1] / "data" / "gantry.urdf"
SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.4, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.6, -0.5, 0.0)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.6, 0.6)),
    ]
)
ARMS: dict[str, Callable[[], Arm]] = {
    "two_link": lambda: load_arm("two_link"),
    "panda": lambda: load_arm("panda"),
    "gantry": lambda: load_arm(GANTRY),
}
STEPS = {"still": 0.0, "noise": 1e-5, "slow": 1e-3, "fast": 2e-2, "jump": 1.0}  # [rad or m]
SEEDS = st.integers(0, 2**16)
PACES = st.lists(st.sampled_from(list(STEPS)), min_size=3, max_size=8)
coordinates = st.floats(-2.5, 2.5)
PlaneFunction = Callable[[Array], tuple[float, Array]]


@pytest.fixture(scope="module")
def between_walls(ball_on_slides: Arm) -> World:
    """A ball on slides between two walls: 1 + x from the left one, 1 - x from the right one."""
    walls = [
        HalfSpace(name="left", normal=(1.0, 0.0, 0.0), offset=-1.1),
        HalfSpace(name="right", normal=(-1.0, 0.0, 0.0), offset=-1.1),
    ]
    return World(ball_on_slides, Scene(walls))


@pytest.fixture(scope="module", params=ARMS)
def world(request: pytest.FixtureRequest) -> World:
    return World(ARMS[request.param](), SCENE)


def log_bump(unsafe_set: UnsafeSet, q: Array, nv: int, theta: float = 0.0) -> tuple[float, Array]:
    gradient = np.zeros(nv)
    return unsafe_set.add_log_bump(q, theta, gradient), gradient


def at(x: float) -> Array:
    return np.array([x, 0.0])


def walk(arm: Arm, seed: int, paces: list[str]) -> list[Array]:
    """A random walk inside the limits, each pace kept for some steps."""
    random, configurations = np.random.default_rng(seed), []
    ends = np.clip([arm.limits.lower, arm.limits.upper], -np.pi, np.pi)
    angles = np.where(arm.continuous, 0.0, ends.mean(axis=0))
    for pace in paces:
        direction = random.normal(size=arm.nv)
        for _ in range(12):
            angles = angles + STEPS[pace] * (direction + 0.3 * random.normal(size=arm.nv))
            angles = np.clip(angles, arm.limits.lower, arm.limits.upper)
            configurations.append(arm.configuration(angles))
    return configurations


# Clearance


@given(st.floats(-0.99, 0.99), st.floats(0.0, 0.1))
def test_clearance_set_takes_the_margin_off_the_distance(
    between_walls: World, x: float, margin: float
) -> None:
    unsafe_set = ClearanceSet(between_walls, margin, sensing_distance=[0.5, 0.3])
    value, gradient = log_bump(unsafe_set, at(x), 2)
    left = log_inverse_bump(1.0 + x - margin, 0.5, 0.0)
    right = log_inverse_bump(1.0 - x - margin, 0.3, 0.0)
    assert value == pytest.approx(left[0] + right[0], rel=1e-6, abs=1e-12)
    assert gradient[0] == pytest.approx(left[1] - right[1], rel=1e-6, abs=1e-9)
    assert gradient[1] == pytest.approx(0.0, abs=1e-9 * (1.0 + abs(gradient[0])))


def test_clearance_set_senses_at_other_distances_from_when_they_are_set(
    between_walls: World,
) -> None:
    unsafe_set = ClearanceSet(between_walls, 0.02, 0.5)
    assert unsafe_set.sensing_distance.shape == (2,)
    for _ in range(3):
        assert log_bump(unsafe_set, at(0.6), 2)[0] < 0.0
    unsafe_set.set_sensing_distance(np.array([0.7, 0.1]))
    np.testing.assert_array_equal(unsafe_set.sensing_distance, [0.7, 0.1])
    np.testing.assert_allclose(unsafe_set.pairs.reach, [0.72, 0.12])
    for _ in range(3):
        value, gradient = log_bump(unsafe_set, at(0.6), 2)
        assert value == 0.0
        assert not gradient.any()
    assert log_bump(unsafe_set, at(-0.6), 2)[0] < 0.0
    unsafe_set.set_sensing_distance(np.array([0.1, 1.0]))  # wakes what slept
    expected = ClearanceSet(between_walls, 0.02, [0.1, 1.0])
    assert log_bump(unsafe_set, at(0.6), 2)[0] == log_bump(expected, at(0.6), 2)[0] < 0.0


def test_contact_is_minus_infinite_and_its_gradient_points_out(between_walls: World) -> None:
    unsafe_set = ClearanceSet(between_walls, 0.0, 0.5)
    for x in (1.0, 1.5):
        value, gradient = log_bump(unsafe_set, at(x), 2)
        assert value == -math.inf
        assert -math.inf < gradient[0] < 0.0
        assert log_bump(unsafe_set, at(x), 2, theta=0.1)[0] == pytest.approx(
            math.log(0.1) + math.log(1.1), rel=1e-12
        )


@pytest.mark.parametrize(
    ("margin", "sensing"), [(-1.0, 0.5), (math.nan, 0.5), (0.0, 0.0), (0.0, [1.0] * 3), (0.0, -1)]
)
def test_clearance_set_refuses_what_cannot_be(
    between_walls: World, margin: float, sensing: ArrayLike
) -> None:
    with pytest.raises(InvalidValueError):
        ClearanceSet(between_walls, margin, sensing)


@settings(max_examples=6)
@given(
    seed=SEEDS,
    paces=PACES,
    theta=st.sampled_from([0.0, 0.01]),
    sensing=st.sampled_from([0.05, 0.3]),
)
def test_pairs_asleep_change_nothing_to_the_last_bit(
    world: World, seed: int, paces: list[str], theta: float, sensing: float
) -> None:
    """All pairs queried give the same, and what the world's distances give."""
    nv, sets = world.arm.nv, [ClearanceSet(world, 0.01, sensing) for _ in range(2)]
    for q in walk(world.arm, seed, paces):
        sets[1].pairs.wake_all()
        (near, near_slope), (every, every_slope) = (log_bump(one, q, nv, theta) for one in sets)
        assert near == every
        np.testing.assert_array_equal(near_slope, every_slope)
        sample = world.clearance(q)
        bumps = [log_inverse_bump(d - 0.01, sensing, theta) for d in sample.distance]
        value = sum(bump for bump, _ in bumps)
        if value > -20.0:  # nearer, the last digits of distances count for more
            assert near == pytest.approx(value, rel=1e-6, abs=1e-9)
            slope = np.array([slope for _, slope in bumps]) @ sample.gradient
            np.testing.assert_allclose(near_slope, slope, rtol=1e-5, atol=1e-6)


@settings(max_examples=6)
@given(seed=SEEDS, paces=PACES, asked=st.lists(SEEDS, min_size=1, max_size=4))
def test_asking_for_distances_changes_no_bump(
    world: World, seed: int, paces: list[str], asked: list[int]
) -> None:
    one, other = (ClearanceSet(world, 0.01, 0.05) for _ in range(2))
    for q in walk(world.arm, seed, paces):
        (value, slope), (other_value, other_slope) = (
            log_bump(unsafe, q, world.arm.nv) for unsafe in (one, other)
        )
        assert value == other_value
        np.testing.assert_array_equal(slope, other_slope)
        for k in asked:
            one.pairs.query(k % world.n_pairs)


@settings(max_examples=6)
@given(seed=SEEDS, paces=PACES)
def test_pairs_may_share_the_kinematics_of_who_updates_them(
    world: World, seed: int, paces: list[str]
) -> None:
    kinematics = Kinematics(world.arm)
    own = ClearanceSet(world, 0.01, 0.1)
    sharing = ClearanceSet(world, 0.01, 0.1, ActivePairs(world, kinematics))
    for q in walk(world.arm, seed, paces):
        kinematics.update(q)
        (value, slope), (other_value, other_slope) = (
            log_bump(unsafe, q, world.arm.nv) for unsafe in (own, sharing)
        )
        assert value == other_value
        np.testing.assert_array_equal(slope, other_slope)


# Joint limits


@given(coordinates, coordinates, coordinates)
def test_joint_limits_act_on_bounded_joints_alone(
    joint_space: Callable[..., Arm], a: float, b: float, c: float
) -> None:
    arm = joint_space("bcb", lower=[-1.0, -1e15, -2.0], upper=[1.5, 1e15, 1e15])
    unsafe_set = JointLimitSet(arm, sensing_distance=[0.2, 1.0, 0.5])
    value, gradient = log_bump(unsafe_set, arm.configuration([a, b, c]), 3)
    parts = [
        log_inverse_bump(h, width, 0.0)
        for h, width in [(a + 1.0, 0.2), (1.5 - a, 0.2), (c + 2.0, 0.5)]
    ]
    assert value == sum(part for part, _ in parts)
    expected = np.array([parts[0][1] - parts[1][1], 0.0, parts[2][1]])
    np.testing.assert_allclose(gradient, expected, rtol=1e-12)


@given(st.floats(-0.99, 0.99), st.sampled_from([0.0, 0.1]))
def test_gradient_of_joint_limits_is_the_derivative(
    joint_space: Callable[..., Arm],
    numerical_gradient: Callable[..., Array],
    x: float,
    theta: float,
) -> None:
    arm = joint_space("bb", lower=[-1.0, -1.0], upper=[1.0, 1.0])
    unsafe_set, q = JointLimitSet(arm, 0.5), np.array([x, 0.3])
    value, gradient = log_bump(unsafe_set, q, 2, theta)
    step = 1e-6 * (1.0 - abs(x))
    numerical = numerical_gradient(
        lambda p: log_bump(unsafe_set, p, 2, theta)[0], q, 2, arm.integrate, step
    )
    rounding = 1e-14 * (1.0 + abs(value)) / step
    np.testing.assert_allclose(gradient, numerical, rtol=1e-5, atol=1e-6 + rounding)


@pytest.mark.parametrize("sensing", [0.0, -1.0, [0.1, 0.1, 0.1]])
def test_joint_limit_set_refuses_what_cannot_be(
    joint_space: Callable[..., Arm], sensing: ArrayLike
) -> None:
    with pytest.raises(InvalidValueError):
        JointLimitSet(joint_space("bb", lower=[-1.0] * 2, upper=[1.0] * 2), sensing)


def test_a_set_adds_to_the_gradient_it_is_given(joint_space: Callable[..., Arm]) -> None:
    arm = joint_space("b", lower=[-1.0], upper=[1.0])
    gradient = np.full(1, 7.0)
    JointLimitSet(arm, 0.1).add_log_bump(np.zeros(1), 0.0, gradient)
    assert gradient[0] == 7.0


# Sets given as functions


@given(st.floats(1.05, 1.95), st.floats(-math.pi, math.pi), st.sampled_from([0.0, 0.1]))
def test_implicit_gradient_is_the_derivative(
    disc: tuple[PlaneFunction, PlaneFunction],
    numerical_gradient: Callable[..., Array],
    radius: float,
    angle: float,
    theta: float,
) -> None:
    """An ellipse around a circle: the width h - s varies."""
    stretch = np.array([1.0, 0.8])

    def ellipse(x: Array) -> tuple[float, Array]:
        return float((stretch * x) @ (stretch * x) - 4.0), 2.0 * stretch**2 * x

    unsafe_set = ImplicitSet(disc[0], ellipse)
    x = radius * np.array([math.cos(angle), math.sin(angle)])
    value, gradient = log_bump(unsafe_set, x, 2, theta)
    numerical = numerical_gradient(lambda y: log_bump(unsafe_set, y, 2, theta)[0], x, 2, step=1e-7)
    np.testing.assert_allclose(gradient, numerical, rtol=1e-5, atol=1e-6 * (1.0 + abs(value)))


def test_implicit_set_is_free_beyond_its_sensing_region_and_contact_inside(
    disc: tuple[PlaneFunction, PlaneFunction],
) -> None:
    unsafe_set = ImplicitSet(*disc)
    assert log_bump(unsafe_set, np.array([2.0, 0.1]), 2)[0] == 0.0
    value, gradient = log_bump(unsafe_set, np.array([0.9, 0.0]), 2)
    assert value == -math.inf
    assert gradient[0] > 0.0


def test_implicit_set_refuses_a_sensing_region_inside_the_unsafe_set(
    disc: tuple[PlaneFunction, PlaneFunction],
) -> None:
    h, s = disc
    with pytest.raises(InvalidValueError, match="sensing function"):
        ImplicitSet(s, h).add_log_bump(np.zeros(2), 0.0, np.zeros(2))


@pytest.mark.parametrize(
    ("key", "value"),
    [("distance", 0.0), ("joint", -1.0), ("path_share", 0.0), ("path_share", 0.6)],
)
def test_sensing_parameters_are_checked(key: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        SensingParameters(**{key: value})
