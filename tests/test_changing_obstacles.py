"""A clearance whose obstacles changed is that of the scene as it is then."""

from dataclasses import replace
from threading import Thread

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.attachment import Attachment
from densarm.clearance import Clearance
from densarm.control.density_tracking import DensityTracking
from densarm.control.gains import Gains
from densarm.density import (
    DensityParameters,
    JointLimitSet,
    NavigationDensity,
    NearClearanceSet,
    NearPairs,
    TorusDistance,
)
from densarm.errors import InvalidValueError, SceneChangedError, UnknownNameError
from densarm.proof.swept_bound import SweptBound
from densarm.reference.reference import Reference
from densarm.scene import Box, Capsule, Scene, Sphere

ARM = load_arm("panda", shapes="capsule")
READY = ARM.postures["ready"]
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
NEW = st.one_of(
    st.builds(Sphere, name=st.just("new ball"), radius=SIZE, position=PLACE),
    st.builds(Capsule, name=st.just("new bar"), radius=SIZE, length=SIZE, position=PLACE),
    st.builds(Box, name=st.just("new box"), size=st.just((0.1, 0.1, 0.1)), position=PLACE),
)
CHANGES = st.lists(
    st.one_of(NEW, st.tuples(st.booleans(), PLACE), st.sampled_from(["ball", "table", "new ball"])),
    min_size=1,
    max_size=6,
)


def make() -> Clearance:
    return Clearance(ARM, Scene([BALL, TABLE]), SPARE)


def change(clearance: Clearance, what) -> None:
    """Add an obstacle, move one or take one away, whichever can be done."""
    names = {item.name for item in clearance.scene}
    if isinstance(what, str):
        if what in names:
            clearance.remove_obstacle(what)
    elif isinstance(what, tuple):
        if "ball" in names:
            clearance.move_obstacle("ball", what[1], QUATERNION if what[0] else None)
    elif what.name not in names:
        clearance.add_obstacle(what)


def check_is_that_of_its_scene(clearance: Clearance, q: np.ndarray) -> None:
    fresh = Clearance(ARM, clearance.scene)
    expected = dict(zip(fresh.pairs, fresh.distances(q), strict=True))
    sample = clearance.evaluate(q)
    there = clearance.changes >= 0
    assert (sample.distance[~there] == np.inf).all()
    assert (sample.gradient[~there] == 0.0).all()
    np.testing.assert_allclose(clearance.distances(q), sample.distance, rtol=0, atol=1e-9)
    some = np.arange(0, clearance.n_pairs, 2)
    np.testing.assert_allclose(clearance.distances(q, some), sample.distance[some], atol=1e-9)
    pairs = [pair for pair, is_there in zip(sample.pairs, there, strict=True) if is_there]
    assert sorted(pairs) == sorted(expected)
    distance = [expected[pair] for pair in pairs]
    np.testing.assert_allclose(sample.distance[there], distance, rtol=0, atol=1e-9)


@settings(max_examples=12)
@given(changes=CHANGES)
def test_distances_are_those_of_the_scene_as_it_is(changes):
    clearance = make()
    check_is_that_of_its_scene(clearance, READY)
    for what in changes:
        change(clearance, what)
        check_is_that_of_its_scene(clearance, READY)


@settings(max_examples=12)
@given(changes=CHANGES, seed=st.integers(0, 2**16))
def test_who_sleeps_is_out_of_reach_of_what_changed(changes, seed):
    clearance, random = make(), np.random.default_rng(seed)
    pairs, angles = NearPairs(SweptBound(clearance)), ARM.angles(READY)
    pairs.sensing_distance[:] = 0.05
    for what in [None, *changes]:
        if what is not None:
            change(clearance, what)
        for _ in range(3):
            angles = angles + 0.01 * random.normal(size=ARM.nv)
            q = ARM.configuration(angles)
            pairs.update(q, 0.0)
            exact, asleep = clearance.distances(q), pairs.state == 0
            assert (exact[asleep] > 0.05).all()
            np.testing.assert_allclose(pairs.distance[~asleep], exact[~asleep], rtol=0, atol=1e-8)
            assert asleep[clearance.changes < 0].all()


@settings(max_examples=12)
@given(changes=CHANGES)
def test_a_clearance_made_meanwhile_is_brought_up_to_date(changes):
    running, larger = make(), Clearance(ARM, Scene([BALL, TABLE]), (*SPARE, *MORE))
    for what in changes:
        change(running, what)
    larger.change_to(running.scene)
    check_is_that_of_its_scene(larger, READY)
    assert set(larger.scene) == set(running.scene)
    larger.change_to(Scene([BALL, TABLE]))
    larger.change_to(Scene([BALL, TABLE]))
    check_is_that_of_its_scene(larger, READY)
    assert set(larger.scene) == {BALL, TABLE}


def test_changing_to_a_scene_costs_its_differences():
    clearance = make()
    before = clearance.version
    clearance.change_to(Scene([replace(TABLE, position=(0, 0, -1)), BALL]))
    assert clearance.version == before + 1


@pytest.mark.parametrize(
    ("scene", "match"),
    [
        (Scene([replace(TABLE, position=(0, 0, -1)), *MORE, *LARGE]), "spare obstacle"),
        (Scene([replace(BALL, name="panda_link0_0")]), "not in use"),
        (Scene([], [Attachment(LARGE[0], "panda_hand")]), "attached bodies"),
    ],
)
def test_a_refused_change_changes_nothing(scene, match):
    clearance = make()
    before = clearance.version, clearance.scene, clearance.pairs, clearance.distances(READY)
    with pytest.raises(InvalidValueError, match=match):
        clearance.change_to(scene)
    assert (clearance.version, clearance.scene, clearance.pairs) == before[:3]
    np.testing.assert_array_equal(clearance.distances(READY), before[3])


def test_an_obstacle_may_change_its_kind():
    clearance = make()
    other = Sphere(name=TABLE.name, radius=0.1, position=(0.5, 0.0, 1.0))
    clearance.change_to(Scene([replace(BALL, name="thing"), other]))
    assert [item.name for item in clearance.scene] == ["thing", TABLE.name]
    check_is_that_of_its_scene(clearance, READY)


def hold(clearance: Clearance, q: np.ndarray, sensing: float) -> DensityTracking:
    """A controller that holds the arm at rest."""
    near = NearClearanceSet(NearPairs(SweptBound(clearance)), 0.0, sensing)
    density = NavigationDensity(
        [near, JointLimitSet(ARM, 0.05)], TorusDistance(ARM, q), DensityParameters()
    )
    reference = Reference(0.001, np.tile(ARM.angles(q), (2, 1)), np.zeros((2, ARM.nv)))
    return DensityTracking(ARM, density, reference, Gains(position=25.0, velocity=15.0))


def test_a_controller_with_more_room_takes_over_between_two_steps():
    """Made in a thread; the arm does not notice, until something comes that had no room."""
    near = Sphere(name="ball", radius=0.1, position=(0.35, 0.25, 0.6))
    running, made = Clearance(ARM, Scene([near])), []

    def make_room(scene: Scene) -> None:
        larger = Clearance(ARM, scene, [Sphere(name="spare", radius=0.1)])
        made.append((larger, hold(larger, READY, 0.1)))

    thread = Thread(target=make_room, args=[running.scene])
    thread.start()
    running.move_obstacle("ball", (0.35, 0.25, 0.61))
    thread.join()
    alone = hold(Clearance(ARM, running.scene), READY, 0.1)
    larger, controller = made[0]
    larger.change_to(running.scene)
    v = 0.1 * np.ones(ARM.nv)
    for k in range(20):
        q = ARM.integrate(READY, 0.002 * k * v)
        np.testing.assert_array_equal(controller.torque(0.0, q, v), alone.torque(0.0, q, v))
    larger.add_obstacle(Sphere(name="new", radius=0.1, position=(0.35, -0.25, 0.6)))
    assert (controller.torque(0.0, q, v) != alone.torque(0.0, q, v)).any()


def test_every_pair_of_a_moved_obstacle_wakes():
    clearance = make()
    pairs = NearPairs(SweptBound(clearance))
    pairs.sensing_distance[:] = 1e-3
    mine = np.array(["ball" in pair for pair in clearance.pairs])
    for _ in range(2):
        pairs.update(READY, 0.0)
    assert not pairs.state.any()
    clearance.move_obstacle("ball", (0.5, 0.4, 0.51))
    pairs.update(READY, 0.0)
    np.testing.assert_array_equal(pairs.state == 1, mine)


def test_an_arm_waits_for_a_ball_to_leave_in_a_loop_of_ones_own():
    clearance = Clearance(ARM, Scene(), [Sphere(name="spare", radius=0.05)])
    goal = ARM.angles(READY) + np.eye(ARM.nv)[0]
    controller = hold(clearance, ARM.configuration(goal), 0.05)
    data, q, v, nearest, waited = ARM.model.createData(), READY, np.zeros(ARM.nv), 1.0, 0.0
    middle = ARM.configuration(ARM.angles(READY) + 0.7 * np.eye(ARM.nv)[0])
    pin.framesForwardKinematics(ARM.model, data, middle)
    way = data.oMf[ARM.model.getFrameId("panda_hand")].translation.copy()
    clearance.add_obstacle(Sphere(name="ball", radius=0.06, position=way))
    for k in range(3000):
        if k >= 1000:  # it rises at 0.4 m/s
            clearance.move_obstacle("ball", way + np.array([0.0, 0.0, 0.0004 * (k - 1000)]))
        tau = controller.torque(k * 0.001, q, v)
        v = v + 0.001 * pin.aba(ARM.model, data, q, v, tau)
        q = ARM.integrate(q, 0.001 * v)
        nearest = min(nearest, clearance.distances(q, near_ball(clearance)).min())
        waited = np.abs(ARM.difference(q, ARM.configuration(goal))).max() if k == 999 else waited
    assert nearest > 0.0
    assert waited > 0.1
    assert np.abs(ARM.difference(q, ARM.configuration(goal))).max() < 0.05


def near_ball(clearance: Clearance) -> np.ndarray:
    return np.array([k for k, pair in enumerate(clearance.pairs) if "ball" in pair])


def test_a_swept_bound_sees_what_was_moved():
    clearance = make()
    bound = SweptBound(clearance)
    q = ARM.integrate(READY, 0.02 * np.ones(ARM.nv))
    assert bound.segment_is_clear(READY, q)
    shape = clearance.geometry_model.geometryObjects[3]
    data = clearance.geometry_data
    clearance.move_obstacle(
        "ball", data.oMg[clearance.geometry_model.getGeometryId(shape.name)].translation
    )
    assert not bound.segment_is_clear(READY, q)


def test_what_was_computed_before_is_refused():
    clearance = make()
    version = clearance.version
    clearance.require_version(version)
    clearance.move_obstacle("ball", (0, 0, 2))
    with pytest.raises(SceneChangedError, match="compute it anew"):
        clearance.require_version(version)


@pytest.mark.parametrize(
    ("obstacle", "message"),
    [
        (BALL, "'ball': must be not in use"),
        (Sphere(name="panda_link3_0", radius=0.1), "obstacle name"),
        (Box(name="large", size=(1, 1, 1)), r"like a spare obstacle \(Box, Capsule, Sphere\)"),
    ],
)
def test_what_cannot_be_added(obstacle, message):
    clearance = make()
    if obstacle.name.startswith("panda"):
        obstacle = Sphere(name=clearance.pairs[0][0], radius=0.1)
    with pytest.raises(InvalidValueError, match=message):
        clearance.add_obstacle(obstacle)


def test_no_room_left():
    clearance = Clearance(ARM, Scene())
    with pytest.raises(InvalidValueError, match=r"none left\), or make a new Clearance"):
        clearance.add_obstacle(BALL)


def test_unknown_names_and_poses_that_are_none():
    clearance = make()
    with pytest.raises(UnknownNameError, match=r"unknown obstacle 'bal'.*'ball'"):
        clearance.remove_obstacle("bal")
    with pytest.raises(InvalidValueError, match="finite"):
        clearance.move_obstacle("ball", (0, 0, np.nan))
    check_is_that_of_its_scene(clearance, READY)
