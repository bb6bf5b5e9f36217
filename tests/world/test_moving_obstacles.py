"""Obstacles that move: how fast distances change by it, and what is known of their velocity."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.errors import DensarmError, InvalidValueError
from densarm.scene.motion import BackAndForth, ConstantVelocity
from densarm.scene.obstacles import Box, Capsule, HalfSpace, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.distance_view import pair_rates
from densarm.world.near_pairs import NearPairs
from densarm.world.world import World

VECTOR = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
BODIES: tuple[Obstacle, ...] = (
    Capsule(name="it", radius=0.1, length=0.3, position=(0.6, 0.3, 0.6)),
    Sphere(name="it", radius=0.1, position=(0.6, 0.3, 0.6)),
    Box(  # no edge along one of the arm's, where distances have no derivative
        name="it",
        size=(0.2, 0.1, 0.3),
        position=(0.6, 0.3, 0.6),
        orientation_xyzw=(0.1, 0.5, 0.5, 0.7),
    ),
)
PERIOD = 0.01


@pytest.fixture(scope="module")
def arm(arm_named: Callable[[str], Arm]) -> Arm:
    return arm_named("panda capsules")


@pytest.fixture(scope="module")
def ready(arm: Arm) -> Array:
    return arm.postures["ready"]


@settings(max_examples=20)
@given(body=st.sampled_from(BODIES), linear=VECTOR, angular=VECTOR)
def test_rates_are_the_differences_of_distances(
    arm: Arm, ready: Array, body: Obstacle, linear: Array, angular: Array
) -> None:
    step = 1e-6
    moving = Scene([_moving(body, linear, angular)])
    world = World(arm, moving)
    sample, pairs = world.clearance(ready), ActivePairs(world)
    pairs.update(ready)
    np.testing.assert_allclose(pair_rates(pairs.rows, world.twist), sample.rate, atol=1e-5)
    before = world.distances(ready)
    world.set_time(step)
    change = (world.distances(ready) - before) / step
    np.testing.assert_allclose(change, sample.rate, atol=1e-3)
    stands = World(arm, Scene([body]))
    assert not stands.clearance(ready).rate.any()


def _moving(body: Obstacle, linear: Array, angular: Array) -> Obstacle:
    return replace(body, motion=ConstantVelocity(linear=linear, angular=angular))


def test_a_told_velocity_is_that_of_the_frames_origin(arm: Arm, ready: Array) -> None:
    world = World(arm, Scene([BODIES[0]]))
    told = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    world.move_obstacle("it", (0.6, 0.3, 0.7), velocity=told)
    np.testing.assert_array_equal(world.obstacle_velocity("it"), told)
    of_motion = World(arm, Scene([_moving(BODIES[0], told[:3], told[3:])]))
    of_motion.move_obstacle("it", (0.6, 0.3, 0.7), velocity=told)
    np.testing.assert_allclose(
        world.clearance(ready).rate, of_motion.clearance(ready).rate, atol=1e-12
    )
    world.move_obstacle("it", (0.6, 0.3, 0.7))
    assert not world.clearance(ready).rate.any()


def test_velocity_is_estimated_from_noisy_poses(arm: Arm) -> None:
    """5 mm at 100 Hz: within 0.1 m/s of the true one from a quarter of a second on."""
    world, random = World(arm, Scene([BODIES[0]])), np.random.default_rng(0)
    velocity, angular, errors = np.array([0.5, -1.0, 0.3]), np.array([0.0, 1.0, 0.0]), []
    for k in range(200):
        time = k * PERIOD
        position = velocity * time + 5e-3 * random.standard_normal(3)
        turned = pin.Quaternion(pin.exp3(time * angular + 5e-3 * random.standard_normal(3)))
        world.move_obstacle("it", position, turned.coeffs(), time=time)
        errors.append(world.obstacle_velocity("it") - [*velocity, *angular])
    assert np.sqrt(np.mean(np.square(errors[25:]), axis=0)).max() < 0.04
    assert np.abs(errors[25:]).max() < 0.1


@pytest.mark.parametrize("period", [0.001, 0.01, 0.033])
def test_velocity_without_noise_is_known_soon(arm: Arm, period: float) -> None:
    world, velocity = World(arm, Scene([BODIES[0]])), np.array([0.5, -1.0, 0.3])
    for k in range(1 + math.ceil(0.1 / period)):
        world.move_obstacle("it", k * period * velocity, time=k * period)
    estimated = world.obstacle_velocity("it")
    np.testing.assert_allclose(estimated, [*velocity, 0, 0, 0], atol=0.01)
    world.move_obstacle("it", (0, 0, 0), time=0.0)  # another recording
    assert not world.obstacle_velocity("it").any()


@settings(max_examples=3)
@given(seed=st.integers(0, 99))
def test_no_pair_sleeps_through_what_comes(arm: Arm, ready: Array, seed: int) -> None:
    """Of obstacles that come near and turn, told or by their motions, while the arm moves."""
    random = np.random.default_rng(seed)
    motion = BackAndForth(position=(0.2, 0.2, 0.5), orientation_xyzw=(0, 1, 0, 0), period=1.0)
    bar = Capsule(name="bar", radius=0.05, length=0.6, position=(1.5, 0.2, 0.5), motion=motion)
    floor = HalfSpace(name="floor", offset=-0.5, motion=ConstantVelocity(linear=(0, 0, 0.5)))
    world = World(arm, Scene([bar, floor, BODIES[1]]))
    pairs, near, angles = ActivePairs(world), NearPairs(world), arm.angles(ready)
    pairs.reach[:] = 0.05
    slept = 0
    for k in range(200):
        angles = angles + 1e-3 * random.normal(size=arm.nv)
        q = arm.configuration(angles)
        world.set_time(k * 0.005)
        ball = [0.9 - 0.003 * k, 0.3, 0.6 + 0.01 * random.normal()]
        world.move_obstacle("it", np.array(ball), time=k * 0.005)
        pairs.update(q)
        exact, asleep = world.distances(q), pairs.state == 0
        assert (exact[asleep] > 0.05).all()
        assert (pairs.distance <= exact + 1e-8).all()
        assert near.smallest(q)[0] == pytest.approx(exact.min(), abs=1e-8)
        slept += int(asleep.sum())
    assert slept > 100 * world.n_pairs


def test_far_moves_are_moves_too(arm: Arm, ready: Array) -> None:
    world = World(arm, Scene([BODIES[0]]))
    pairs, near = ActivePairs(world), NearPairs(world)
    pairs.reach[:] = 0.05
    for x in (5e5, 0.5, -9e5, 0.6):
        world.move_obstacle("it", (x, 0.3, 0.6))
        pairs.update(ready)
        exact = world.distances(ready)
        assert (exact[pairs.state == 0] > 0.05).all()
        assert near.smallest(ready)[0] == pytest.approx(exact.min(), abs=1e-8)


def test_the_motion_of_an_obstacle_ends_where_it_is_moved_to(arm: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, motion=ConstantVelocity(linear=(0, 0, 1)))
    world = World(arm, Scene([ball]))
    world.set_time(2.0)
    assert world.scene == Scene([ball])
    np.testing.assert_array_equal(world.obstacle_velocity("ball"), [0, 0, 1, 0, 0, 0])
    assert world.motion_way(0.0, 2.0).max() == pytest.approx(2.0)
    world.move_obstacle("ball", (1, 0, 0))
    world.set_time(3.0)
    assert world.scene == Scene([Sphere(name="ball", radius=0.1, position=(1, 0, 0))])
    assert not world.obstacle_velocity("ball").any()
    assert not world.motion_way(0.0, 2.0).any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"position": (0, 0, math.nan)}, "it.position = .*finite"),
        ({"position": np.array([0, 0, 1e7])}, "it.position = .*less than 1000 km"),
        ({"position": "123"}, "it.position"),
        ({"position": (0, 0, 1), "orientation_xyzw": (1, 1, 1, 1)}, "it.orientation_xyzw"),
        ({"position": (0, 0, 1), "velocity": (0, 0)}, r"velocity = .*shape \(3,\)"),
        ({"position": (0, 0, 1), "velocity": np.array([0, math.inf, 0])}, "velocity = .*finite"),
        ({"position": (0, 0, 1), "time": math.nan}, "time = nan: must be a finite number"),
    ],
)
def test_moves_that_are_refused(arm: Arm, arguments: dict[str, Any], message: str) -> None:
    world = World(arm, Scene([BODIES[0]]))
    with pytest.raises(DensarmError, match=message):
        world.move_obstacle("it", **arguments)
    assert world.scene == Scene([BODIES[0]])


def test_obstacles_that_are_not_seen_any_more_are_named(arm: Arm) -> None:
    world = World(arm, Scene([Sphere(name=n, radius=0.1) for n in ("a", "b", "c")]))
    assert world.unseen(5.0, 0.1) == ()
    world.move_obstacle("a", [2.0, 0.0, 0.0], time=1.0)
    world.move_obstacle("b", [0.0, 2.0, 0.0], time=1.05)
    world.move_obstacle("c", [0.0, 0.0, 2.0])  # has no stream
    assert world.unseen(1.08, 0.1) == ()
    assert world.unseen(1.12, 0.1) == ("a",)
    assert world.unseen(1.2, 0.1) == ("a", "b")
    world.move_obstacle("a", [2.0, 0.0, 0.0], time=1.2)
    assert world.unseen(1.2, 0.1) == ("b",)


def test_obstacles_are_predicted_to_go_on_as_they_do(arm: Arm) -> None:
    turns = ConstantVelocity(linear=[0.1, 0.0, 0.0], angular=[0.0, 0.0, 1.0])
    bar = Box(name="bar", size=[0.4, 0.1, 0.1], position=[2.0, 0.0, 0.0], motion=turns)
    still = Sphere(name="still", radius=0.1, position=[0.0, 3.0, 0.0])
    world = World(arm, Scene([bar, still]))
    world.set_time(0.5)
    then, unmoved = world.predicted(0.3)
    np.testing.assert_allclose(then.pose_at(0.0), bar.pose_at(0.8), atol=1e-12)
    assert (then.motion, unmoved) == (None, still)
    assert world.scene.obstacles[0] == bar
    np.testing.assert_allclose(pin.XYZQUATToSE3(world.obstacle_pose("bar")), bar.pose_at(0.5))
    with pytest.raises(InvalidValueError, match=r"^ahead = -0\.1"):
        world.predicted(-0.1)
