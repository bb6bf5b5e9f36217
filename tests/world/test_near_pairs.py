"""The smallest distance is that of all pairs, by asking few of them."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.near_pairs import NearPairs, least_distances, smallest_distances
from densarm.world.world import Pairs, World

SPARE = [Sphere(name="spare", radius=0.1)]
SEEDS = st.integers(0, 2**32 - 1)


def scene(count: int) -> Scene:
    random = np.random.default_rng(0)
    balls = [
        Sphere(name=f"ball{k}", radius=0.03, position=place)
        for k, place in enumerate(random.uniform(-1.2, 1.2, (count, 3)))
    ]
    return Scene([*balls, Box(name="box", size=(0.3, 0.2, 0.1), position=(0.6, 0, 0.3))])


def walk(arm: Arm, random: np.random.Generator, step: float, count: int) -> Array:
    low = np.where(arm.continuous, -np.pi, arm.limits.lower)
    high = np.where(arm.continuous, np.pi, arm.limits.upper)
    start = arm.configuration(random.uniform(low, high))
    path = [start]
    for _ in range(count - 1):
        path.append(arm.integrate(path[-1], random.uniform(-step, step, arm.nv)))
    return np.array(path)


@pytest.fixture(scope="module", params=["two_link", "gantry", "panda", "branching, placed"])
def world(request: pytest.FixtureRequest, arm_named: Callable[[str], Arm]) -> World:
    return World(arm_named(request.param), scene(20), SPARE)


@settings(max_examples=15)
@given(seed=SEEDS, step=st.sampled_from([1e-3, 0.02, 0.5]))
def test_the_smallest_distance_is_that_of_all_pairs(world: World, seed: int, step: float) -> None:
    """On a walk with jumps, and out of the limits of a gantry's slides."""
    near = NearPairs(world)
    for q in walk(world.arm, np.random.default_rng(seed), step, 20):
        distance, pair = near.smallest(q)
        expected = world.distances(q)
        assert distance == pytest.approx(expected.min(), abs=1e-8)
        assert expected[pair] == pytest.approx(distance, abs=1e-8)


@settings(max_examples=15)
@given(seed=SEEDS, limit=st.floats(-0.1, 0.5))
def test_no_pair_below_a_limit_is_missing(world: World, seed: int, limit: float) -> None:
    near, random = NearPairs(world), np.random.default_rng(seed)
    q = walk(world.arm, random, 0.05, 10)
    for row in q:
        pairs, distance = near.below(row, limit)
        expected = world.distances(row)
        np.testing.assert_allclose(distance, expected[pairs], rtol=0, atol=1e-8)
        assert (np.delete(expected, pairs) >= limit).all()
    least = np.min([world.distances(row) for row in q], axis=0)
    found = least_distances(world, q, limit)
    below = least < limit
    np.testing.assert_allclose(found[below], least[below], rtol=0, atol=1e-8)
    assert (found[~below] >= limit).all()


def test_obstacles_may_change(arm_named: Callable[[str], Arm]) -> None:
    arm = arm_named("panda")
    world, q = World(arm, scene(5), SPARE), arm.postures["ready"]
    near = NearPairs(world)

    def check() -> None:
        expected, (distance, pair) = world.distances(q), near.smallest(q)
        assert distance == pytest.approx(expected.min(), abs=1e-8)
        assert pair == expected.argmin()

    check()
    world.move_obstacle("box", (0.4, 0.0, 0.5))
    check()
    world.remove_obstacle("box")
    check()
    world.add_obstacle(Sphere(name="new", radius=0.2, position=(0.4, 0.1, 0.4)))
    check()


def test_few_pairs_are_asked(
    arm_named: Callable[[str], Arm], monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = arm_named("panda")
    world = World(arm, scene(200))
    q = walk(arm, np.random.default_rng(1), 1e-3, 400)
    asked, query = [0], world.query

    def counted(q: Array, pairs: Pairs | None = None) -> Array:
        asked[0] += world.n_pairs if pairs is None else len(pairs)
        return query(q, pairs)

    monkeypatch.setattr(world, "query", counted)
    smallest_distances(world, q)
    assert asked[0] < 0.05 * world.n_pairs * len(q)


def test_without_pairs(single_link: Callable[..., Arm]) -> None:
    world = World(single_link('<sphere radius="0.1"/>'), Scene())
    assert NearPairs(world).smallest(np.zeros(1)) == (np.inf, -1)
