"""The density of what moves: its derivatives, its rest, and how fast it may fall."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import load_arm
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import Gauge, density_towards
from densarm.density.unsafe_sets import SensingParameters
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.study.time_varying_density import TimeVaryingDensity
from densarm.values.arrays import Array
from densarm.world.world import World

PERIOD, DECAY = 0.001, 2.0
BALL = np.array([0.55, 0.1, 0.45])
FARAWAY = Box(name="faraway", size=(0.1, 0.1, 0.1), position=(3.0, 0.0, 3.0))
SENSING = SensingParameters(distance=0.4)

shares = st.lists(st.floats(0.1, 0.9), min_size=7, max_size=7)
vectors = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(np.array)


@pytest.fixture(params=["two_link", "panda"], scope="module")
def world(request: pytest.FixtureRequest) -> World:
    arm = load_arm(request.param, shapes="capsule" if request.param == "panda" else "hull")
    return World(arm, Scene([Sphere(name="ball", radius=0.1, position=tuple(BALL)), FARAWAY]))


def make(world: World) -> TimeVaryingDensity:
    world.move_obstacle("ball", BALL)
    goal, distance = world.arm.configuration(np.full(world.arm.nv, -0.4)), TorusDistance(world.arm)
    return TimeVaryingDensity(world, goal, distance, SENSING, period=PERIOD, decay=DECAY)


def near_the_ball(world: World, share: list[float]) -> Array:
    limits, nv = world.arm.limits, world.arm.nv
    lower, upper = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    q = world.arm.configuration(lower + np.array(share[:nv]) * (upper - lower))
    assume(world.distances(q).min() > 0.05)
    return q


@settings(max_examples=30)
@given(share=shares, w=vectors)
def test_derivatives_in_space_and_time(world: World, share: list[float], w: Array) -> None:
    q, field, arm, step = near_the_ball(world, share), make(world), world.arm, 1e-6
    goal, rate = field.density.goal.copy(), np.resize(w, arm.nv)
    assume(np.abs(arm.difference(goal, q)).max() > 0.1)
    field.log_density(q)
    world.move_obstacle("ball", BALL + PERIOD * w)
    field.set_goal(goal, rate)
    _, slope, change = field.log_density(q)

    def log_density(x: Array, time: float) -> float:
        world.move_obstacle("ball", BALL + (PERIOD + time) * w)
        field.set_goal(arm.integrate(goal, time * rate), rate)
        return field.log_density(x)[0]

    found = [
        (log_density(arm.integrate(q, step * e), 0.0) - log_density(arm.integrate(q, -step * e), 0))
        / (2.0 * step)
        for e in np.eye(arm.nv)
    ]
    np.testing.assert_allclose(slope, found, rtol=1e-3, atol=1e-3)
    flow = (log_density(q, step) - log_density(q, -step)) / (2.0 * step)
    assert change == pytest.approx(flow, rel=1e-3, abs=1e-3)


@settings(max_examples=20)
@given(share=shares, w=vectors)
def test_it_is_the_plain_density_where_nothing_moves(
    world: World, share: list[float], w: Array
) -> None:
    q, field = near_the_ball(world, share), make(world)
    plain = density_towards(world, field.density.goal, sensing=SENSING).evaluate(q)
    expected = 10.0 * plain.gradient(Gauge.RECIPROCAL)
    np.testing.assert_array_equal(field.velocity(q, None)[0], expected)
    world.move_obstacle("ball", BALL + PERIOD * w)
    field.velocity(q, None)
    world.move_obstacle("ball", BALL)
    field.velocity(q, None)  # it has just come
    velocity, way_left = field.velocity(q, None)
    np.testing.assert_array_equal(velocity, expected)
    assert way_left == pytest.approx(np.linalg.norm(plain.goal_error))


@settings(max_examples=30)
@given(share=shares, w=vectors)
def test_it_falls_no_faster_than_it_may(world: World, share: list[float], w: Array) -> None:
    q, field = near_the_ball(world, share), make(world)
    world.move_obstacle("ball", BALL + PERIOD * w)
    velocity, way_left = field.velocity(q, None)
    again = make(world)
    world.move_obstacle("ball", BALL + PERIOD * w)
    _, slope, change = again.log_density(q)
    assert slope @ velocity + change >= -DECAY - 1e-6 * abs(change)
    assert np.isinf(way_left) == (slope @ velocity + change <= -DECAY + 1e-6 * abs(change))


def test_what_is_out_of_reach_does_not_count(world: World) -> None:
    field, q = make(world), world.arm.configuration(np.full(world.arm.nv, 0.3))
    still = field.velocity(q, None)[0]
    world.move_obstacle("faraway", [2.9, 0.0, 3.0])
    np.testing.assert_array_equal(field.velocity(q, None)[0], still)
    assert field.log_density(q)[2] == 0.0
