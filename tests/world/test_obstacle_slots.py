"""A world whose obstacles changed is that of its scene as it is then."""

from collections.abc import Callable
from dataclasses import replace
from threading import Thread

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.control.controller import Gains
from densarm.control.tracking import DensityTracking
from densarm.density.unsafe_sets import ClearanceSet, SensingParameters
from densarm.errors import InvalidValueError, SceneChangedError, UnknownNameError
from densarm.planning.motion import Motion
from densarm.scene.obstacles import Box, Capsule, Obstacle, Sphere
from densarm.scene.scene import Attachment, Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.swept_check import SweptCheck
from densarm.world.world import Pairs, World

QUATERNION = (0.5, 0.5, 0.5, 0.5)
BALL = Sphere(name="ball", radius=0.1, position=(0.5, 0.4, 0.5))
TABLE = Box(name="table", size=(0.4, 0.6, 0.1), position=(0.6, -0.5, 0.0))
SPARE = (
    Sphere(name="spare ball", radius=0.01),
    Capsule(name="spare bar", radius=0.01, length=0.1),
    Box(name="spare box", size=(0.1, 0.1, 0.1)),
)
LARGE = (Box(name="large", size=(1.0, 1.0, 1.0), position=(0.0, 0.0, 3.0)),)
MORE = tuple(replace(item, name=f"more {item.name}") for item in SPARE)
PLACE = st.tuples(*[st.floats(-0.8, 0.8)] * 3)
SIZE = st.floats(0.02, 0.2)
Point = tuple[float, float, float]
Change = Obstacle | tuple[bool, Point] | str
"""An obstacle that is added, whether and where the ball is turned and moved, or a name to remove"""
NEW: st.SearchStrategy[Obstacle] = st.one_of(
    st.builds(Sphere, name=st.just("new ball"), radius=SIZE, position=PLACE),
    st.builds(Capsule, name=st.just("new bar"), radius=SIZE, length=SIZE, position=PLACE),
    st.builds(Box, name=st.just("new box"), size=st.just((0.1, 0.1, 0.1)), position=PLACE),
)
CHANGES: st.SearchStrategy[list[Change]] = st.lists(
    st.one_of(NEW, st.tuples(st.booleans(), PLACE), st.sampled_from(["ball", "table", "new ball"])),
    min_size=1,
    max_size=6,
)


@pytest.fixture(scope="module")
def arm(arm_named: Callable[[str], Arm]) -> Arm:
    return arm_named("panda capsules")


@pytest.fixture(scope="module")
def ready(arm: Arm) -> Array:
    return arm.postures["ready"]


@pytest.fixture
def world(arm: Arm) -> World:
    return make(arm)


def make(arm: Arm) -> World:
    return World(arm, Scene([BALL, TABLE]), SPARE)


def change(world: World, what: Change) -> None:
    """Add an obstacle, move one or take one away, whichever can be done."""
    names = {item.name for item in world.scene}
    if isinstance(what, str):
        if what in names:
            world.remove_obstacle(what)
    elif isinstance(what, tuple):
        if "ball" in names:
            world.move_obstacle("ball", what[1], QUATERNION if what[0] else None)
    elif what.name not in names:
        world.add_obstacle(what)


def check_is_that_of_its_scene(world: World, q: Array) -> None:
    fresh = World(world.arm, world.scene)
    expected = dict(zip(fresh.pairs, fresh.distances(q), strict=True))
    sample = world.clearance(q)
    there = world.changes >= 0
    assert (sample.distance[~there] == np.inf).all()
    assert (sample.gradient[~there] == 0.0).all()
    np.testing.assert_allclose(world.distances(q), sample.distance, rtol=0, atol=1e-9)
    some = np.arange(0, world.n_pairs, 2)
    np.testing.assert_allclose(world.distances(q, some), sample.distance[some], atol=1e-9)
    pairs = [pair for pair, is_there in zip(sample.pairs, there, strict=True) if is_there]
    assert sorted(pairs) == sorted(expected)
    distance = [expected[pair] for pair in pairs]
    np.testing.assert_allclose(sample.distance[there], distance, rtol=0, atol=1e-9)
    nearest, of_fresh = world.nearest(q), fresh.nearest(q)
    assert nearest is not None
    assert of_fresh is not None
    assert nearest.distance == pytest.approx(of_fresh.distance, abs=1e-9)


@settings(max_examples=8)
@given(changes=CHANGES)
def test_distances_are_those_of_the_scene_as_it_is(
    arm: Arm, ready: Array, changes: list[Change]
) -> None:
    world = make(arm)
    check_is_that_of_its_scene(world, ready)
    for what in changes:
        change(world, what)
        check_is_that_of_its_scene(world, ready)


@settings(max_examples=8)
@given(changes=CHANGES, seed=st.integers(0, 2**16))
def test_who_sleeps_is_out_of_reach_of_what_changed(
    arm: Arm, ready: Array, changes: list[Change], seed: int
) -> None:
    world, random = make(arm), np.random.default_rng(seed)
    pairs, angles = ActivePairs(world), arm.angles(ready)
    pairs.reach[:] = 0.05
    for what in [None, *changes]:
        if what is not None:
            change(world, what)
        for _ in range(3):
            angles = angles + 0.01 * random.normal(size=arm.nv)
            q = arm.configuration(angles)
            pairs.update(q)
            exact, asleep = world.distances(q), pairs.state == 0
            assert (exact[asleep] > 0.05).all()
            np.testing.assert_allclose(pairs.distance[~asleep], exact[~asleep], rtol=0, atol=1e-8)
            assert asleep[world.changes < 0].all()


@settings(max_examples=8)
@given(changes=CHANGES)
def test_a_world_made_meanwhile_is_brought_up_to_date(
    arm: Arm, ready: Array, changes: list[Change]
) -> None:
    running, larger = make(arm), World(arm, Scene([BALL, TABLE]), (*SPARE, *MORE))
    for what in changes:
        change(running, what)
    larger.change_to(running.scene)
    check_is_that_of_its_scene(larger, ready)
    assert set(larger.scene) == set(running.scene)
    larger.change_to(Scene([BALL, TABLE]))
    larger.change_to(Scene([BALL, TABLE]))
    check_is_that_of_its_scene(larger, ready)
    assert set(larger.scene) == set(Scene([BALL, TABLE]))


def test_changing_to_a_scene_costs_its_differences(world: World) -> None:
    before = world.version
    world.change_to(Scene([replace(TABLE, position=(0, 0, -1)), BALL]))
    assert world.version == before + 1


@pytest.mark.parametrize(
    ("scene", "match"),
    [
        (Scene([replace(TABLE, position=(0, 0, -1)), *MORE, *LARGE]), "spare obstacle"),
        (Scene([replace(BALL, name="panda_link0_0")]), "not in use"),
        (Scene([], [Attachment(LARGE[0], "panda_hand")]), "attached bodies"),
    ],
)
def test_a_refused_change_changes_nothing(
    world: World, ready: Array, scene: Scene, match: str
) -> None:
    before, distances = (world.version, world.scene, world.pairs), world.distances(ready)
    with pytest.raises(InvalidValueError, match=match):
        world.change_to(scene)
    assert (world.version, world.scene, world.pairs) == before
    np.testing.assert_array_equal(world.distances(ready), distances)


def test_an_obstacle_may_change_its_kind(world: World, ready: Array) -> None:
    other = Sphere(name=TABLE.name, radius=0.1, position=(0.5, 0.0, 1.0))
    world.change_to(Scene([replace(BALL, name="thing"), other]))
    assert [item.name for item in world.scene] == ["thing", TABLE.name]
    check_is_that_of_its_scene(world, ready)


def hold(world: World, q: Array, sensing: float) -> DensityTracking:
    """A controller that holds the arm at rest, obstacles sensed wherever it holds it."""
    arm = world.arm
    motion = Motion(0.001, np.tile(arm.angles(q), (2, 1)), np.zeros((2, arm.nv)))
    return DensityTracking(
        world,
        motion,
        gains=Gains(position=25.0, velocity=15.0),
        unsafe_sets=[ClearanceSet(world, 0.0, sensing)],
        sensing=SensingParameters(distance=1e-3, joint=0.05),
    )


def test_a_controller_with_more_room_takes_over_between_two_steps(arm: Arm, ready: Array) -> None:
    """Made in a thread; the arm does not notice, until something comes that had no room."""
    near = Sphere(name="ball", radius=0.1, position=(0.35, 0.25, 0.6))
    running = World(arm, Scene([near]))
    made: list[tuple[World, DensityTracking]] = []

    def make_room(scene: Scene) -> None:
        larger = World(arm, scene, [Sphere(name="spare", radius=0.1)])
        made.append((larger, hold(larger, ready, 0.1)))

    thread = Thread(target=make_room, args=[running.scene])
    thread.start()
    running.move_obstacle("ball", (0.35, 0.25, 0.61))
    thread.join()
    alone, away = hold(World(arm, running.scene), ready, 0.1), hold(World(arm, Scene()), ready, 0.1)
    larger, controller = made[0]
    larger.change_to(running.scene)
    v = 0.1 * np.ones(arm.nv)
    for k in range(20):
        q = arm.integrate(ready, 0.002 * k * v)
        np.testing.assert_array_equal(controller.torque(0.0, q, v), alone.torque(0.0, q, v))
    assert (alone.torque(0.0, q, v) != away.torque(0.0, q, v)).any()
    larger.add_obstacle(Sphere(name="new", radius=0.1, position=(0.35, -0.25, 0.6)))
    assert (controller.torque(0.0, q, v) != alone.torque(0.0, q, v)).any()


def test_pairs_of_a_moved_obstacle_sleep_until_it_may_be_near(world: World, ready: Array) -> None:
    pairs, woke = ActivePairs(world), 0
    pairs.reach[:] = 0.02
    for k in range(300):
        x = 0.5 - 0.002 * min(k, 150)
        world.move_obstacle("ball", (x, 0.4, 0.5), QUATERNION if k % 2 else (0, 0, 0, 1))
        pairs.update(ready)
        exact = world.distances(ready)
        asleep = pairs.state == 0
        assert (exact[asleep] > 0.02).all()
        assert (pairs.distance <= exact + 1e-9).all()
        woke += int(np.count_nonzero(~asleep))
    assert 0 < woke < 300 * world.n_pairs / 4


def test_where_it_is_an_obstacle_is_not_moved_to(world: World) -> None:
    version, scene = world.version, world.scene
    world.move_obstacle("ball", BALL.position)
    world.move_obstacle("table", TABLE.position, TABLE.orientation_xyzw, velocity=(0, 0, 0))
    assert world.version == version
    assert world.scene == scene


@pytest.mark.slow
def test_an_arm_waits_for_a_ball_to_leave_in_a_loop_of_ones_own(arm: Arm, ready: Array) -> None:
    world = World(arm, Scene(), [Sphere(name="spare", radius=0.05)])
    goal = arm.configuration(arm.angles(ready) + np.eye(arm.nv)[0])
    controller = hold(world, goal, 0.05)
    data, q, v, nearest, waited = arm.model.createData(), ready, np.zeros(arm.nv), 1.0, 0.0
    middle = arm.configuration(arm.angles(ready) + 0.7 * np.eye(arm.nv)[0])
    pin.framesForwardKinematics(arm.model, data, middle)
    way = data.oMf[arm.model.getFrameId("panda_hand")].translation.copy()
    world.add_obstacle(Sphere(name="ball", radius=0.06, position=way))
    for k in range(3000):
        if k >= 1000:  # it rises at 0.4 m/s
            world.move_obstacle("ball", way + np.array([0.0, 0.0, 0.0004 * (k - 1000)]))
        tau = controller.torque(k * 0.001, q, v)
        v = v + 0.001 * pin.aba(arm.model, data, q, v, tau)
        q = arm.integrate(q, 0.001 * v)
        nearest = min(nearest, world.distances(q, near_ball(world)).min())
        waited = np.abs(arm.difference(q, goal)).max() if k == 999 else waited
    assert nearest > 0.0
    assert waited > 0.1
    assert np.abs(arm.difference(q, goal)).max() < 0.05


def near_ball(world: World) -> Pairs:
    return np.array([k for k, pair in enumerate(world.pairs) if "ball" in pair])


def test_a_swept_check_sees_what_was_moved(arm: Arm, world: World, ready: Array) -> None:
    check, q = SweptCheck(world), arm.integrate(ready, 0.02 * np.ones(arm.nv))
    assert check.segment_is_clear(ready, q)
    geometry, data = world.geometry_model.createData(), arm.model.createData()
    pin.updateGeometryPlacements(arm.model, data, world.geometry_model, geometry, ready)
    world.move_obstacle("ball", geometry.oMg[3].translation)
    assert not check.segment_is_clear(ready, q)


def test_what_was_computed_before_is_refused(world: World) -> None:
    version = world.version
    world.require_version(version)
    world.move_obstacle("ball", (0, 0, 2))
    with pytest.raises(SceneChangedError, match="compute it anew"):
        world.require_version(version)


@pytest.mark.parametrize(
    ("obstacle", "message"),
    [
        (BALL, "'ball': must be not in use"),
        (Sphere(name="panda_link3_0", radius=0.1), "obstacle name"),
        (Box(name="large", size=(1, 1, 1)), r"like a spare obstacle \(Box, Capsule, Sphere\)"),
    ],
)
def test_what_cannot_be_added(world: World, obstacle: Obstacle, message: str) -> None:
    assert any("panda_link3_0" in pair for pair in world.pairs)
    with pytest.raises(InvalidValueError, match=message):
        world.add_obstacle(obstacle)


def test_no_room_left(arm: Arm) -> None:
    world = World(arm, Scene())
    with pytest.raises(InvalidValueError, match=r"none left\), or make a new World"):
        world.add_obstacle(BALL)


def test_unknown_names_and_poses_that_are_none(world: World, ready: Array) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown obstacle 'bal'.*'ball'"):
        world.remove_obstacle("bal")
    with pytest.raises(InvalidValueError, match="finite"):
        world.move_obstacle("ball", (0, 0, np.nan))
    check_is_that_of_its_scene(world, ready)
