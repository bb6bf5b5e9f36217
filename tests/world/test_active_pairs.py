"""Pairs asleep are farther than their reach, and nothing but time tells that they are."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.arms.dynamics import Kinematics
from densarm.arms.joint_space import sliding_joints
from densarm.scene.obstacles import Box, Capsule, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs, ExactDistances, all_exceed, longest_travel
from densarm.world.distance_view import DistanceView
from densarm.world.world import DISTANCE_TOLERANCE, World

SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.4, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.6, -0.5, 0.0)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.6, 0.6)),
    ]
)
ARMS = ["two_link", "panda", "gantry", pytest.param("panda capsules", marks=pytest.mark.slow)]
STEPS = {"still": 0.0, "noise": 1e-5, "slow": 1e-3, "fast": 2e-2, "jump": 1.0}  # [rad or m]
SEEDS = st.integers(0, 2**16)
PACES = st.lists(st.sampled_from(list(STEPS)), min_size=3, max_size=8)


@pytest.fixture(scope="module", params=ARMS)
def world(request: pytest.FixtureRequest, arm_named: Callable[[str], Arm]) -> World:
    return World(arm_named(request.param), SCENE)


def middle(arm: Arm) -> Array:
    ends = np.clip([arm.limits.lower, arm.limits.upper], -np.pi, np.pi)
    return np.where(arm.continuous, 0.0, ends.mean(axis=0))


def walk(arm: Arm, seed: int, paces: list[str]) -> list[Array]:
    """A random walk inside the limits, each pace kept for some steps."""
    random, angles, configurations = np.random.default_rng(seed), middle(arm), []
    for pace in paces:
        direction = random.normal(size=arm.nv)
        for _ in range(12):
            angles = angles + STEPS[pace] * (direction + 0.3 * random.normal(size=arm.nv))
            angles = np.clip(angles, arm.limits.lower, arm.limits.upper)
            configurations.append(arm.configuration(angles))
    return configurations


def within_reach(world: World, reach: float, kinematics: Kinematics | None = None) -> ActivePairs:
    pairs = ActivePairs(world, kinematics)
    pairs.set_reach(reach)
    return pairs


@settings(max_examples=8)
@given(seed=SEEDS, paces=PACES, reach=st.sampled_from([0.001, 0.06, 0.3]))
def test_who_sleeps_is_out_of_reach(
    world: World, seed: int, paces: list[str], reach: float
) -> None:
    pairs = within_reach(world, reach)
    for q in walk(world.arm, seed, paces):
        pairs.update(q)
        exact, asleep = world.distances(q), pairs.state == 0
        assert (exact[asleep] > reach).all()
        assert (pairs.distance[asleep] <= exact[asleep] + DISTANCE_TOLERANCE).all()
        np.testing.assert_allclose(pairs.distance[~asleep], exact[~asleep], rtol=0, atol=1e-8)


@settings(max_examples=5)
@given(seed=SEEDS, paces=PACES)
def test_shared_kinematics_give_the_same_rows_as_own_ones(
    world: World, seed: int, paces: list[str]
) -> None:
    """Who shares them updates them first."""
    kinematics = Kinematics(world.arm)
    own, sharing = within_reach(world, 0.1), within_reach(world, 0.1, kinematics)
    assert sharing.kinematics is kinematics
    for q in walk(world.arm, seed, paces):
        own.update(q)
        kinematics.update(q)
        sharing.update(q)
        np.testing.assert_array_equal(own.state, sharing.state)
        awake = own.state != 0
        np.testing.assert_array_equal(own.rows[awake], sharing.rows[awake])
        np.testing.assert_array_equal(own.kinematics.jacobian, kinematics.jacobian)
        np.testing.assert_array_equal(own.distance, sharing.distance)


def test_kinematics_that_are_shared_are_left_to_their_owner(two_link: Arm) -> None:
    """Who moves on without them measures where they are."""
    world, kinematics = World(two_link, SCENE), Kinematics(two_link)
    here, there = two_link.configurations(np.array([[0.3, 0.4], [1.3, -0.4]]))
    sharing = within_reach(world, 10.0, kinematics)
    kinematics.update(here)
    sharing.update(there)
    np.testing.assert_allclose(sharing.distance, world.distances(here), rtol=0, atol=1e-8)
    assert np.abs(world.distances(here) - world.distances(there)).max() > 0.1


@settings(max_examples=5)
@given(seed=SEEDS, paces=PACES, asked=st.lists(SEEDS, min_size=1, max_size=4))
def test_asking_for_distances_changes_nothing_else(
    world: World, seed: int, paces: list[str], asked: list[int]
) -> None:
    pairs, other = within_reach(world, 0.06), within_reach(world, 0.06)
    for q in walk(world.arm, seed, paces):
        pairs.update(q)
        other.update(q)
        near = world.distances(q) <= 0.06
        assert pairs.state[near].all()
        np.testing.assert_array_equal(pairs.rows[near], other.rows[near])
        exact = world.distances(q)
        for k in asked:
            pair = k % world.n_pairs
            slept = bool(pairs.state[pair] == 0)
            assert [pairs.query(pair), pairs.query(pair)] == [slept, False]
            assert pairs.distance[pair] == pytest.approx(exact[pair], abs=1e-8)
        assert (pairs.distance <= exact + DISTANCE_TOLERANCE).all()


def test_most_pairs_sleep_on_a_slow_way(world: World) -> None:
    pairs = within_reach(world, 0.01)
    awake = []
    for q in walk(world.arm, 0, ["noise"] * 8):
        pairs.update(q)
        awake.append(np.count_nonzero(pairs.state))
    assert awake[0] == world.n_pairs
    near = np.count_nonzero(world.distances(q) < 0.03)
    assert awake[-1] <= near


def test_longer_reach_wakes_at_once(world: World) -> None:
    pairs, q = within_reach(world, 1e-3), world.arm.configuration(middle(world.arm))
    for _ in range(2):
        pairs.update(q)
    assert (pairs.state == 0).any()
    pairs.set_reach(10.0)
    pairs.update(q)
    assert pairs.state.all()


def test_all_wake_when_they_are_told_to(world: World) -> None:
    pairs, q = within_reach(world, 1e-3), world.arm.configuration(middle(world.arm))
    for _ in range(2):
        pairs.update(q)
    pairs.wake_all()
    pairs.update(q)
    assert pairs.state.all()
    np.testing.assert_allclose(pairs.distance, world.distances(q), rtol=0, atol=1e-8)


def test_all_wake_while_a_slide_is_beyond_its_limits(arm_named: Callable[[str], Arm]) -> None:
    arm = arm_named("gantry")
    slide = int(np.flatnonzero(sliding_joints(arm.model))[0])
    inside = np.clip(middle(arm), arm.limits.lower + 0.01, arm.limits.upper - 0.01)
    outside = inside.copy()
    outside[slide] = arm.limits.upper[slide] + 1e-6
    pairs = within_reach(World(arm, SCENE), 1e-3)
    states = []
    for angles in (inside, inside, outside, inside, inside):
        pairs.update(arm.configuration(angles))
        states.append(bool(pairs.state.all()))
    assert states == [True, False, True, True, False]


def test_a_way_too_long_to_be_summed_wakes_all(two_link: Arm) -> None:
    """Half turns to and fro, whose sum would round off small steps after a while."""
    far = World(two_link, Scene([Sphere(name="far", radius=0.1, position=(0, 0, 1e5))]))
    pairs = within_reach(far, 1e-3)
    ends = two_link.configurations(np.array([[0.0, 0.0], [3.0, 3.0]]))
    woken = []
    for k in range(7000):
        pairs.update(ends[k % 2])
        if pairs.state.any():
            woken.append(k)
    assert woken[0] == 0
    assert len(woken) == 3
    steps = np.diff(woken)
    assert (3.0 * steps <= 1e4 + 3.0).all()
    assert (3.0 * steps > 0.9e4).all()
    exact = far.distances(ends[1])
    assert (pairs.distance <= exact + DISTANCE_TOLERANCE).all()


def test_without_the_direct_view(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    direct = within_reach(world, 0.3)
    monkeypatch.setattr(DistanceView, "_strided", lambda _: None)
    by_getters = within_reach(world, 0.3)
    for q in walk(world.arm, 1, ["slow", "fast", "slow"]):
        direct.update(q)
        by_getters.update(q)
        np.testing.assert_array_equal(direct.state, by_getters.state)
        awake = direct.state != 0
        np.testing.assert_array_equal(direct.rows[awake], by_getters.rows[awake])


# What bounds decide is what distances decide, and few are queried

NUMBERS = st.floats(-2.0, 2.0)
PAIRS = st.lists(
    st.tuples(NUMBERS, st.floats(0.0, 1.0), NUMBERS, st.sampled_from([0.0, 0.3, 1.0])), max_size=8
)


@dataclass
class Hidden:
    """Distances behind bounds."""

    truth: Array
    distance: Array
    queried: list[int] = field(default_factory=list)

    def query(self, pair: int) -> bool:
        if pair in self.queried:
            return False
        self.queried.append(pair)
        self.distance[pair] = self.truth[pair]
        return True


def split(pairs: list[tuple[float, ...]]) -> tuple[Array, Hidden, Array, Array]:
    """Distances, bounds, needs and rates of pairs."""
    truth, below, need, rate = np.array(pairs, float).reshape(-1, 4).T
    return truth, Hidden(truth, truth - below), need, np.ascontiguousarray(rate)


@given(pairs=PAIRS)
def test_the_longest_travel_is_that_of_the_distances_to_the_last_bit(
    pairs: list[tuple[float, ...]],
) -> None:
    truth, hidden, need, rate = split(pairs)
    bounds, moves = hidden.distance.copy(), rate > 0.0
    expected = ((truth - need)[moves] / rate[moves]).min(initial=np.inf)
    assert longest_travel(hidden, need, rate) == expected
    assert longest_travel(ExactDistances(truth), need, rate) == expected
    queried = np.array(hidden.queried, int)
    assert moves[queried].all()
    assert ((bounds - need)[queried] / rate[queried] <= expected).all()


@given(pairs=PAIRS, enough=NUMBERS)
def test_enough_travel_is_never_too_short(pairs: list[tuple[float, ...]], enough: float) -> None:
    truth, hidden, need, rate = split(pairs)
    exact = longest_travel(ExactDistances(truth), need, rate)
    travel = longest_travel(hidden, need, rate, enough)
    assert travel == exact or enough < travel <= exact


@given(pairs=PAIRS)
def test_all_exceed_is_decided_as_by_the_distances(pairs: list[tuple[float, ...]]) -> None:
    truth, hidden, need, _ = split(pairs)
    bounds = hidden.distance.copy()
    assert all_exceed(hidden, need) == bool((truth > need).all())
    assert not (bounds > need)[hidden.queried].any()


@settings(max_examples=5)
@given(seed=SEEDS, paces=PACES)
def test_active_pairs_travel_as_far_as_exact_distances(
    world: World, seed: int, paces: list[str]
) -> None:
    """Asking wakes the pair that decides, and the answer is the same to what coal can tell."""
    pairs = within_reach(world, 0.01)
    for q in walk(world.arm, seed, paces):
        pairs.update(q)
        rate = world.motion_bound(np.ones(world.arm.nv))
        expected = longest_travel(ExactDistances(world.distances(q)), 0.01, rate)
        assert longest_travel(pairs, 0.01, rate) == pytest.approx(expected, abs=1e-7)


@pytest.mark.slow
def test_who_sleeps_on_a_real_run_is_out_of_reach(swing_up_run: Run) -> None:
    world = World(swing_up_run.task.arm, swing_up_run.task.scene)
    pairs, slept = within_reach(world, 0.05), 0
    for q in swing_up_run.q:
        pairs.update(q)
        asleep = pairs.state == 0
        assert (world.distances(q)[asleep] > 0.05).all()
        slept += int(np.count_nonzero(asleep))
    assert slept > 0.3 * world.n_pairs * len(swing_up_run.q)
