"""Pairs asleep are farther than their reach, and nothing but time tells that they are."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import DISTANCE_TOLERANCE, Clearance
from densarm.density import ClearanceSet, NearClearanceSet, NearPairs
from densarm.density.near_pairs import _wake
from densarm.distance_view import DistanceView
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Box, Capsule, Scene, Sphere

DATA = Path(__file__).parents[1] / "data"
SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.4, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.6, -0.5, 0.0)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.6, 0.6)),
    ]
)
ARMS = {
    "two_link": lambda: load_arm("two_link"),
    "panda": lambda: load_arm("panda"),
    "panda capsules": lambda: load_arm("panda", shapes="capsule"),
    "gantry": lambda: load_arm(DATA / "gantry.urdf"),
}
STEPS = {"still": 0.0, "noise": 1e-5, "slow": 1e-3, "fast": 2e-2, "jump": 1.0}  # [rad or m]


@pytest.fixture(scope="module", params=ARMS)
def bound(request) -> SweptBound:
    return SweptBound(Clearance(ARMS[request.param](), SCENE))


def middle(arm) -> np.ndarray:
    limits = arm.limits
    ends = np.clip([limits.lower, limits.upper], -np.pi, np.pi)
    return np.where(arm.is_circle, 0.0, ends.mean(axis=0))


def walk(arm, seed: int, paces) -> list[np.ndarray]:
    """A random walk inside the limits, each pace kept for some steps."""
    random, angles, configurations = np.random.default_rng(seed), middle(arm), []
    for pace in paces:
        direction = random.normal(size=arm.nv)
        for _ in range(12):
            angles = angles + STEPS[pace] * (direction + 0.3 * random.normal(size=arm.nv))
            angles = np.clip(angles, arm.limits.lower, arm.limits.upper)
            configurations.append(arm.configuration(angles))
    return configurations


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    paces=st.lists(st.sampled_from(list(STEPS)), min_size=3, max_size=8),
    sensing=st.sampled_from([0.001, 0.05, 0.3]),
    margin=st.sampled_from([0.0, 0.01]),
)
def test_who_sleeps_is_out_of_reach(bound, seed, paces, sensing, margin):
    pairs = NearPairs(bound)
    pairs.sensing_distance[:] = sensing
    for q in walk(bound.arm, seed, paces):
        pairs.update(q, margin)
        exact, asleep = bound.clearance.distances(q), pairs.state == 0
        assert (exact[asleep] > margin + sensing).all()
        assert (pairs.distance[asleep] <= exact[asleep] + DISTANCE_TOLERANCE).all()
        np.testing.assert_allclose(pairs.distance[~asleep], exact[~asleep], rtol=0, atol=1e-8)


@settings(max_examples=10, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    paces=st.lists(st.sampled_from(list(STEPS)), min_size=3, max_size=8),
    theta=st.sampled_from([0.0, 0.01]),
    sensing=st.sampled_from([0.05, 0.3]),
)
def test_the_density_is_that_of_all_pairs_to_the_last_bit(bound, seed, paces, theta, sensing):
    sets = [NearClearanceSet(NearPairs(bound), 0.01, sensing) for _ in range(2)]
    plain = ClearanceSet(bound.clearance, 0.01, sensing)
    for q in walk(bound.arm, seed, paces):
        sets[1].pairs.wake_all()
        (near, near_slope), (every, every_slope), (value, slope) = (
            log_bump(unsafe, q, bound.arm.nv, theta) for unsafe in (*sets, plain)
        )
        assert near == every
        np.testing.assert_array_equal(near_slope, every_slope)
        if value > -20.0:  # nearer, the last digits of distances count for more
            assert near == pytest.approx(value, rel=1e-6, abs=1e-9)
            np.testing.assert_allclose(near_slope, slope, rtol=1e-5, atol=1e-6)


def log_bump(unsafe_set, q, nv, theta):
    slope = np.zeros(nv)
    return unsafe_set.add_log_bump(q, theta, slope), slope


@settings(max_examples=10, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    paces=st.lists(st.sampled_from(list(STEPS)), min_size=3, max_size=8),
    asked=st.lists(st.integers(0, 2**16), min_size=1, max_size=4),
)
def test_asking_for_distances_changes_nothing_else(bound, seed, paces, asked):
    sets = [NearClearanceSet(NearPairs(bound), 0.01, 0.05) for _ in range(2)]
    pairs = sets[0].pairs
    for q in walk(bound.arm, seed, paces):
        (value, slope), (other_value, other_slope) = (
            log_bump(unsafe, q, bound.arm.nv, 0.0) for unsafe in sets
        )
        assert value == other_value
        np.testing.assert_array_equal(slope, other_slope)
        exact = bound.clearance.distances(q)
        for k in asked:
            pair = k % bound.clearance.n_pairs
            slept = pairs.state[pair] == 0
            assert [pairs.query(pair), pairs.query(pair)] == [slept, False]
            assert pairs.distance[pair] == pytest.approx(exact[pair], abs=1e-8)
        assert (pairs.distance <= exact + DISTANCE_TOLERANCE).all()


def test_most_pairs_sleep_on_a_slow_way(bound):
    pairs = NearPairs(bound)
    pairs.sensing_distance[:] = 0.01
    awake = []
    for q in walk(bound.arm, 0, ["noise"] * 8):
        pairs.update(q, 0.0)
        awake.append(np.count_nonzero(pairs.state))
    assert awake[0] == bound.clearance.n_pairs
    near = np.count_nonzero(bound.clearance.distances(q) < 0.03)
    assert awake[-1] <= near


def test_longer_reach_wakes_at_once(bound):
    pairs, q = NearPairs(bound), bound.arm.configuration(middle(bound.arm))
    pairs.sensing_distance[:] = 1e-3
    for _ in range(2):
        pairs.update(q, 0.0)
    assert (pairs.state == 0).any()
    pairs.sensing_distance[:] = 10.0
    pairs.update(q, 0.0)
    assert pairs.state.all()


def test_all_wake_while_a_slide_is_beyond_its_limits():
    arm = ARMS["gantry"]()
    bound = SweptBound(Clearance(arm, SCENE))
    slide = int(np.flatnonzero(bound.slides)[0])
    inside = np.clip(middle(arm), arm.limits.lower + 0.01, arm.limits.upper - 0.01)
    outside = inside.copy()
    outside[slide] = arm.limits.upper[slide] + 1e-6
    pairs = NearPairs(bound)
    pairs.sensing_distance[:] = 1e-3
    states = []
    for angles in (inside, inside, outside, inside, inside):
        pairs.update(arm.configuration(angles), 0.0)
        states.append(bool(pairs.state.all()))
    assert states == [True, False, True, True, False]


def test_the_way_gone_never_grows_beyond_what_can_be_summed(bound):
    pairs, arm = NearPairs(bound), bound.arm
    pairs.sensing_distance[:] = 1e-3
    angles = middle(arm)
    for k in range(5):
        pairs.update(arm.configuration(angles), 0.0)
        pairs._joint_numbers[0] += 3e3 * (k < 4)
        pairs._level += pairs._lever @ (3e3 * (k < 4) * np.ones(arm.nv))
    assert (pairs._joint_numbers[0] < 1e4).all()
    exact = bound.clearance.distances(arm.configuration(angles))
    assert (pairs.distance <= exact + DISTANCE_TOLERANCE).all()


def test_without_the_direct_view(bound, monkeypatch):
    sets = [NearClearanceSet(NearPairs(bound), 0.0, 0.3)]
    monkeypatch.setattr(DistanceView, "_strided", lambda _: None)
    sets.append(NearClearanceSet(NearPairs(bound), 0.0, 0.3))
    for q in walk(bound.arm, 1, ["slow", "fast", "slow"]):
        one, other = (log_bump(unsafe, q, bound.arm.nv, 0.0) for unsafe in sets)
        assert one[0] == other[0]
        np.testing.assert_array_equal(one[1], other[1])


def test_wake_kernel_equals_its_python_form(bound):
    compiled, plain = NearPairs(bound), NearPairs(bound)
    for pairs in (compiled, plain):
        pairs.sensing_distance[:] = 0.05
    for q in walk(bound.arm, 2, ["slow", "fast", "still", "jump", "slow"]):
        compiled.update(q, 0.0)
        _wake.py_func(q, 0.0, *plain._arrays)
        plain.rows = compiled.rows
        np.testing.assert_array_equal(compiled.state, plain.state)
        np.testing.assert_allclose(compiled._pair_numbers, plain._pair_numbers, atol=1e-12)
        plain._arrays = (*plain._arrays[:4], compiled.rows.copy(), *plain._arrays[5:])


def test_who_sleeps_on_a_real_run_is_out_of_reach(swing_up_run):
    scenario = swing_up_run.scenario
    clearance = Clearance(scenario.arm, scenario.scene)
    pairs = NearPairs(SweptBound(clearance))
    pairs.sensing_distance[:] = 0.05
    slept = 0
    for q in swing_up_run.q:
        pairs.update(q, 0.0)
        asleep = pairs.state == 0
        assert (clearance.distances(q)[asleep] > 0.05).all()
        slept += np.count_nonzero(asleep)
    assert slept > 0.3 * clearance.n_pairs * len(swing_up_run.q)
