"""The speed law: stopping ends before the goal and before clearance can be used up."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm, load_arm
from densarm.control.speed_law import SpeedLaw, SpeedParameters
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ExactDistances
from densarm.world.stopping import StoppingTrajectory
from densarm.world.world import World

MARGIN = 0.01  # [m]
NV, PAIRS = 7, 3
POST = Sphere(name="post", radius=0.1, position=[0.6, 0.0, 0.4])
READY = load_arm("panda").postures["ready"]

directions = arrays(float, NV, elements=st.floats(-1, 1)).filter(lambda u: np.linalg.norm(u) > 0.1)
velocities = arrays(float, NV, elements=st.floats(-3, 3))
lengths = st.floats(0.0, 10.0)


@pytest.fixture(scope="module")
def world() -> World:
    return World(load_arm("panda"), Scene([POST]))


@pytest.fixture(scope="module")
def law(world: World) -> SpeedLaw:
    return SpeedLaw(world, MARGIN, SpeedParameters(braking_share=1.0))


def distances(world: World, fill: float) -> Array:
    """Distances of all pairs, one of them small."""
    distance = np.full(world.n_pairs, 0.5)
    distance[int(fill * 1e6) % len(distance)] = fill
    return distance


def travel(world: World, v: Array) -> Array:
    """Summed joint motion |Δq| of stopping straight at the acceleration limits."""
    slowest = (np.abs(v) / world.arm.limits.acceleration).max()
    return np.asarray(np.abs(v) * slowest / 2.0)


@settings(max_examples=50)
@given(u=directions, near=st.floats(-0.05, 0.3), way=lengths)
def test_stopping_from_full_speed_ends_in_the_free_space_and_before_the_goal(
    world: World, law: SpeedLaw, u: Array, near: float, way: float
) -> None:
    u, distance = u / np.linalg.norm(u), distances(world, near)
    v = law.speed(READY, u, ExactDistances(distance), way) * u
    assert (np.abs(v) <= world.arm.limits.velocity * (1 + 1e-12)).all()
    used = world.motion_bound(travel(world, v))
    assert (used <= np.maximum(distance - MARGIN, 0.0) * (1 + 1e-9) + 1e-15).all()
    assert np.linalg.norm(travel(world, v)) <= way * (1 + 1e-9) + 1e-15


@settings(max_examples=50)
@given(u=directions, near=st.floats(-0.05, 0.3), more=st.floats(0, 0.2), way=lengths)
def test_speed_grows_with_distance_and_way(
    world: World, law: SpeedLaw, u: Array, near: float, more: float, way: float
) -> None:
    u, distance = u / np.linalg.norm(u), distances(world, near)
    speed = law.speed(READY, u, ExactDistances(distance), way)
    assert law.speed(READY, u, ExactDistances(distance + more), way) >= 0.99 * speed
    assert law.speed(READY, u, ExactDistances(distance), way + more) >= 0.99 * speed
    careful = SpeedLaw(world, MARGIN, SpeedParameters(braking_share=0.3))
    assert careful.speed(READY, u, ExactDistances(distance), way) <= 1.01 * speed


def test_a_weak_arm_goes_slower() -> None:
    strong = load_arm("two_link")
    urdf = strong.description.urdf.replace('effort="60"', 'effort="22"')
    weak = Arm(replace(strong.description, urdf=urdf))
    level, down = strong.configuration([1.5, 0.0]), np.array([-1.0, 0.0])
    speeds = [
        SpeedLaw(World(arm, Scene()), 0.0).speed(level, down, ExactDistances(np.zeros(0)), 1.0)
        for arm in (strong, weak)
    ]
    assert 0.0 < speeds[1] < 0.8 * speeds[0]


@settings(max_examples=50)
@given(v=velocities, near=st.floats(-0.05, 0.3), moved=st.floats(0, 0.01))
def test_can_stop_exactly_where_stopping_stays_in_the_free_space(
    world: World, law: SpeedLaw, v: Array, near: float, moved: float
) -> None:
    distance, motion = distances(world, near), np.full(NV, moved)
    duration = StoppingTrajectory(world.arm).duration(READY, v)
    used = world.motion_bound(motion + 0.5 * duration * np.abs(v))
    end, limits = world.arm.angles(READY) + 0.5 * duration * v, world.arm.limits
    inside = ((end <= limits.upper) & (end >= limits.lower)).all()
    beyond = distance - MARGIN
    free = ((used < beyond * (1 - 1e-9)) | (used == 0.0)).all()
    touches = ((used > beyond * (1 + 1e-9)) & (used > 0.0)).any()
    if inside and free:
        assert law.can_stop(READY, v, ExactDistances(distance), motion)
    if not inside or touches:
        assert not law.can_stop(READY, v, ExactDistances(distance), motion)


def test_no_speed_without_distance_and_no_bound_without_pairs(world: World, law: SpeedLaw) -> None:
    u = np.eye(NV)[0]
    assert law.speed(READY, u, ExactDistances(distances(world, 0.0)), 1.0) == 0.0
    arm = load_arm("two_link")
    empty = SpeedLaw(World(arm, Scene()), 0.0)
    u, none = np.array([1.0, 0.0]), ExactDistances(np.zeros(0))
    assert empty.speed(arm.postures["hanging"], u, none, 1e9) == 6.0


@pytest.mark.parametrize("key", ["braking_share", "velocity_share"])
@pytest.mark.parametrize("share", [0.0, -0.1, 1.1, np.nan])
def test_shares_are_checked(key: str, share: float) -> None:
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        SpeedParameters(**{key: share})


def test_a_velocity_is_shortened_and_never_turned_or_lengthened(
    world: World, law: SpeedLaw
) -> None:
    near, far = (ExactDistances(distances(world, d)) for d in (0.011, 0.5))
    for v in (np.full(NV, 0.01), np.linspace(-1e200, 1e200, NV), np.zeros(NV)):
        for bounds in (near, far):
            limited = law.limit(READY, v, bounds, 1.0)
            scale = max(np.abs(v).max(), 1.0)
            share = np.abs(limited / scale).max() / max(np.abs(v / scale).max(), 1e-300)
            assert 0.0 <= share <= 1.0
            np.testing.assert_allclose(limited / scale, share * (v / scale), rtol=1e-9, atol=0)
    slow = np.full(NV, 1e-4)
    np.testing.assert_array_equal(law.limit(READY, slow, far, 1.0), slow)


def test_velocity_share(world: World) -> None:
    far, all_the_way = ExactDistances(np.full(world.n_pairs, 1e9)), 1e9
    direction = np.full(NV, NV**-0.5)
    full, half = (
        SpeedLaw(world, MARGIN, SpeedParameters(velocity_share=share)) for share in (1.0, 0.5)
    )
    assert half.speed(READY, direction, far, all_the_way) == pytest.approx(
        0.5 * full.speed(READY, direction, far, all_the_way)
    )
