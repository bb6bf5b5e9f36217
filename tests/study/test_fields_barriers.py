"""Barriers: distances less the margin, then what is left to every limit; the filter keeps them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import load_arm
from densarm.density.goal_distance import TorusDistance
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study.fields import DETECTION_DISTANCE, BarrierFilter, Barriers
from densarm.values.arrays import Array
from densarm.world.world import World

SCENE = Scene([Sphere(name="ball", radius=0.1, position=(0.5, 0.1, 0.4))])
RATE = 10.0
BARRIER_RATE = 5.0

shares = st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7)


@pytest.fixture(scope="module")
def barriers() -> Barriers:
    return Barriers(World(load_arm("panda", shapes="capsule"), SCENE), 0.01)


@given(share=shares)
def test_pairs_then_limits(barriers: Barriers, share: list[float]) -> None:
    world, limits = barriers.world, barriers.world.arm.limits
    q = limits.lower + np.array(share) * (limits.upper - limits.lower)
    barriers.update(q)
    sample = world.clearance(q)
    left = np.concatenate([sample.distance - 0.01, q - limits.lower, limits.upper - q])
    np.testing.assert_allclose(barriers.value, left, atol=1e-15)
    slopes = np.vstack([sample.gradient, np.eye(7), -np.eye(7)])
    np.testing.assert_array_equal(barriers.gradient, slopes)
    np.testing.assert_array_equal(barriers.distances.distance, sample.distance)


def test_spread_tells_pairs_from_limits(barriers: Barriers) -> None:
    spread = barriers.spread(2.0, 3.0)
    assert spread.shape == barriers.value.shape
    np.testing.assert_array_equal(spread[-14:], 3.0)
    np.testing.assert_array_equal(spread[:-14], 2.0)


def test_continuous_joints_have_no_limits() -> None:
    world = World(load_arm("two_link"), Scene())
    assert Barriers(world, 0.0).value.shape == (world.n_pairs,)


def test_margin_is_checked(barriers: Barriers) -> None:
    with pytest.raises(InvalidValueError, match="margin"):
        Barriers(barriers.world, -0.1)


@pytest.fixture(scope="module")
def filter_of(barriers_of: Callable[[str], tuple[Barriers, Array]]) -> Callable[[str], Any]:
    def make(name: str) -> BarrierFilter:
        barriers, goal = barriers_of(name)
        return BarrierFilter(barriers, goal, TorusDistance(barriers.world.arm), RATE, BARRIER_RATE)

    return make


@pytest.fixture(scope="module", params=["panda", "two_link"])
def field(request: pytest.FixtureRequest, filter_of: Callable[[str], Any]) -> BarrierFilter:
    made: BarrierFilter = filter_of(request.param)
    return made


def slope(field: BarrierFilter, q: Array) -> Array:
    out = np.zeros(field.barriers.world.arm.nv)
    field.goal_distance.evaluate(q, field.goal, out)
    return out


@pytest.mark.slow
@settings(max_examples=300)
@given(share=shares)
def test_keeps_every_barrier_and_the_velocity_limits(
    field: BarrierFilter, within_limits: Callable[..., Array], share: list[float]
) -> None:
    arm, barriers = field.barriers.world.arm, field.barriers
    velocity, _ = field.velocity(within_limits(arm, share), None)
    assume(barriers.value.min() >= 0.0)
    kept = barriers.value < barriers.spread(DETECTION_DISTANCE, np.inf)
    floor = -BARRIER_RATE * barriers.value[kept]
    assert (barriers.gradient[kept] @ velocity >= floor - 1e-6).all()
    assert (np.abs(velocity) <= arm.limits.velocity * (1.0 + 1e-9)).all()


def test_in_the_open_it_is_the_pull_of_the_goal(field: BarrierFilter) -> None:
    arm = field.barriers.world.arm
    step = np.full(arm.nv, 1e-3)
    q = arm.integrate(field.goal, step)
    velocity, way_left = field.velocity(q, None)
    np.testing.assert_allclose(velocity, -RATE * slope(field, q), rtol=1e-6)
    assert way_left == pytest.approx(np.linalg.norm(step))


def test_the_pull_is_taken_in_a_metric(field: BarrierFilter) -> None:
    arm = field.barriers.world.arm
    q, metric = arm.integrate(field.goal, np.full(arm.nv, 1e-3)), np.diag(1.0 + np.arange(arm.nv))
    wanted = -RATE * slope(field, q) / np.diag(metric)
    np.testing.assert_allclose(field.velocity(q, metric)[0], wanted, rtol=1e-6)


def test_rests_at_the_goal(field: BarrierFilter) -> None:
    velocity, way_left = field.velocity(field.goal, None)
    np.testing.assert_array_equal(velocity, 0.0)
    assert way_left == 0.0


def test_rests_where_no_velocity_keeps_every_row(filter_of: Callable[[str], Any]) -> None:
    field = filter_of("panda")
    beyond = field.barriers.world.arm.limits.upper + 10.0
    np.testing.assert_array_equal(field.velocity(beyond, None)[0], 0.0)


def test_changes_a_pull_that_leads_into_an_obstacle(filter_of: Callable[[str], Any]) -> None:
    field = filter_of("two_link")
    q = field.barriers.world.arm.configuration([1.08, 0.0])
    pull = slope(field, q)
    velocity, k = field.velocity(q, None)[0], field.barriers.value.argmin()
    towards = field.barriers.gradient[k] / np.linalg.norm(field.barriers.gradient[k])
    assert field.barriers.value[k] < 0.1
    assert towards @ pull > 0.5 * np.linalg.norm(pull)
    assert towards @ velocity > -0.5 * np.linalg.norm(velocity)


def test_parameters_are_checked(barriers: Barriers) -> None:
    arm = barriers.world.arm
    with pytest.raises(InvalidValueError, match=r"^barrier_rate = "):
        BarrierFilter(barriers, arm.postures["ready"], TorusDistance(arm), RATE, 0.0)
