"""Clouds in a world: each point is a ball, for distances, gradients and proofs alike."""

import threading
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.errors import InvalidValueError
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Box, HalfSpace, Sphere
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.cloud_filter import CloudFilter
from densarm.world.configurations import infeasibility
from densarm.world.separating_planes import SeparatingPlanes, configuration_tube
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World, base_overlaps

SEED = st.integers(0, 2**32 - 1)
TURN = pin.Quaternion(pin.rpy.rpyToMatrix(0.3, -0.2, 0.5))
PLACE = np.array([0.1, 0.05, 0.2])


def points_around(random: np.random.Generator, count: int) -> Array:
    """Return points of two walls and some anywhere (N, 3) [m]."""
    walls = random.uniform([[[0.45, -0.6, 0.0]], [[-0.6, 0.5, 0.0]]], 0.7, (2, count, 3))
    walls[0, :, 0], walls[1, :, 1] = 0.45, 0.5
    return np.vstack([*walls, random.uniform(-0.9, 0.9, (5, 3))])


def cloud_of(points: Array, **fields: object) -> PointCloud:
    values: dict[str, object] = {"position": PLACE, "orientation_xyzw": TURN.coeffs(), **fields}
    return PointCloud(name="cloud", points=points, radius=0.02, **values)  # type: ignore[arg-type]


def balls(cloud: PointCloud) -> list[Sphere]:
    places = cloud.points @ TURN.matrix().T + PLACE
    return [Sphere(name=f"ball{k}", radius=0.02, position=x) for k, x in enumerate(places)]


def to_cloud(world: World) -> NDArray[np.bool_]:
    return np.array([second == "cloud" for _, second in world.pairs])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["two_link", "panda", "panda capsules", "branching, placed"])
def test_distances_are_those_of_the_nearest_ball(
    name: str, arm_named: Callable[[str], Arm], within_limits: Callable[[Arm, Array], Array]
) -> None:
    arm, random = arm_named(name), np.random.default_rng(3)
    cloud = cloud_of(points_around(random, 60))
    world, reference = World(arm, Scene([cloud])), World(arm, Scene(balls(cloud)))
    links = np.array([first for first, _ in reference.pairs])
    is_ball = np.array([second.startswith("ball") for _, second in reference.pairs])
    mine = np.flatnonzero(to_cloud(world))
    for _ in range(20):
        q = arm.configurations(within_limits(arm, random.uniform(size=arm.nv)))
        found, all_balls = world.distances(q)[mine], reference.distances(q)
        for k, distance in zip(mine, found, strict=True):
            least = all_balls[is_ball & (links == world.pairs[k][0])].min()
            assert abs(distance - least) < 1e-8
        assert abs(world.distances(q)[~to_cloud(world)] - all_balls[~is_ball]).max(initial=0) < 1e-8


@pytest.mark.slow
def test_gradients_are_differences_where_one_point_is_nearest(
    arm_named: Callable[[str], Arm], within_limits: Callable[[Arm, Array], Array]
) -> None:
    arm, random, step = arm_named("panda"), np.random.default_rng(5), 1e-6
    world = World(arm, Scene([cloud_of(points_around(random, 40))]))
    checked = 0
    for _ in range(20):
        q = arm.configurations(within_limits(arm, random.uniform(size=arm.nv)))
        gradient, sides = world.clearance(q).gradient, []
        for j in range(arm.nv):
            ahead, behind = (
                world.query(arm.integrate(q, sign * step * np.eye(arm.nv)[j])).copy()
                for sign in (1.0, -1.0)
            )
            same = np.linalg.norm(ahead[:, 7:] - behind[:, 7:], axis=1) < 1e-4
            slope = (ahead[:, 0] - behind[:, 0]) / (2.0 * step)
            sides.append(np.where(same, slope - gradient[:, j], 0.0))
            checked += int(np.count_nonzero(same))
        # A link's own nearest feature may change within a step too, at few of all.
        assert np.percentile(np.abs(sides), 99.0) < 1e-6
    assert checked > 5000


@pytest.mark.slow
def test_active_pairs_follow_the_arm_and_the_cloud(panda_ready: tuple[Arm, Array]) -> None:
    arm, q = panda_ready
    random = np.random.default_rng(0)
    world = World(arm, Scene([cloud_of(points_around(random, 200))]))
    pairs = ActivePairs(world)
    pairs.set_reach(0.2)
    for k in range(40):
        q = arm.integrate(q, random.uniform(-0.02, 0.02, arm.nv))
        if k % 8 == 7:
            world.update_cloud("cloud", points_around(random, 150))
        pairs.update(q)
        distances, awake = world.distances(q), pairs.state == 1
        np.testing.assert_allclose(pairs.rows[awake, 0], distances[awake], atol=1e-7)
        assert (pairs.distance <= distances + 1e-7).all()
        assert (distances[~awake] > 0.2).all()
    assert 0 < np.count_nonzero(awake) < len(awake)


@pytest.fixture(scope="module")
def panda_ready(arm_named: Callable[[str], Arm]) -> tuple[Arm, Array]:
    arm = arm_named("panda")
    return arm, arm.configuration([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])


@pytest.mark.slow
@settings(max_examples=20)
@given(seed=SEED, size=st.floats(0.02, 1.0))
def test_segments_proved_clear_are_clear(
    arm_named: Callable[[str], Arm], seed: int, size: float
) -> None:
    arm, random = arm_named("panda"), np.random.default_rng(seed)
    cloud = cloud_of(points_around(random, 100))
    world = World(arm, Scene([cloud]))
    planes, margin = SeparatingPlanes(world, 0.01), 0.01
    limits, proved = arm.limits, 0
    for _ in range(20):
        a = random.uniform(limits.lower, limits.upper)
        b = np.clip(a + size * random.normal(size=arm.nv), limits.lower, limits.upper)
        way = [arm.configurations(a + s * (b - a)) for s in np.linspace(0.0, 1.0, 20)]
        least = min(float(world.distances(q).min()) for q in way)
        is_clear = planes.segment_is_clear(way[0], way[-1])
        assert not is_clear or least > margin
        parts = a + np.linspace(0.0, 1.0, 4)[:, np.newaxis] * (b - a)
        assert not planes.polyline_is_clear(parts) or least > margin
        # Both proofs may stop short, at different depths, but of what keeps off far enough.
        assert (
            is_clear
            or least < margin + 0.02
            or not SweptCheck(world, 0.01).segment_is_clear(way[0], way[-1])
        )
        proved += is_clear
        tube = configuration_tube(np.array([a, b]), b - a)._replace(radius=np.full(arm.nv, 0.01))
        if planes.tube_is_clear(tube):
            off = arm.configurations(
                a + random.uniform() * (b - a) + random.uniform(-0.01, 0.01, 7)
            )
            assert world.distances(off).min() > margin


def test_new_points_end_proofs_and_their_old_ones_stay_where_new_ones_are_bad(
    panda_ready: tuple[Arm, Array],
) -> None:
    arm, q = panda_ready
    world = World(
        arm,
        Scene(
            [
                cloud_of(np.array([[2.0, 0.0, 0.0]])),
                Sphere(name="a", radius=0.1, position=(3, 0, 0)),
            ]
        ),
    )
    before, version = world.distances(q).copy(), world.version
    with pytest.raises(InvalidValueError, match="at least one, of 5"):
        world.update_cloud("cloud", np.full((5, 3), np.nan))
    with pytest.raises(InvalidValueError, match="point cloud"):
        world.update_cloud("a", np.zeros((1, 3)))
    assert world.version == version
    np.testing.assert_allclose(world.distances(q), before, atol=1e-9)
    world.update_cloud("cloud", np.array([[1.9, 0.0, 0.0]]))
    assert world.version > version
    assert (world.distances(q)[to_cloud(world)] < before[to_cloud(world)]).all()
    now = world.scene.obstacles[0]
    assert isinstance(now, PointCloud)
    np.testing.assert_allclose(now.points, [[1.9, 0.0, 0.0]], atol=1e-6)


def test_points_come_in_another_thread(panda_ready: tuple[Arm, Array]) -> None:
    arm, q = panda_ready
    far, near = np.array([[2.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    world = World(arm, Scene([cloud_of(far)]))
    either = [world.distances(q).copy()]
    world.update_cloud("cloud", near)
    either.append(world.distances(q).copy())
    done = threading.Event()

    def see() -> None:
        for k in range(200):
            world.update_cloud("cloud", (far, near)[k % 2])
        done.set()

    thread = threading.Thread(target=see)
    thread.start()
    while not done.is_set():
        found = world.distances(q)
        assert any(np.allclose(found, known, atol=1e-9) for known in either)
    thread.join()


def test_a_cloud_moves_as_a_body(panda_ready: tuple[Arm, Array]) -> None:
    arm, q = panda_ready
    points = points_around(np.random.default_rng(1), 20)
    moving = ConstantVelocity(linear=(0.1, 0.0, 0.0), angular=(0.0, 0.2, 0.0))
    world = World(arm, Scene([cloud_of(points, motion=moving)]))
    world.set_time(0.5 - 1e-6)
    before = world.distances(q)
    world.set_time(0.5 + 1e-6)
    slope = (world.distances(q) - before) / 2e-6
    world.set_time(0.5)
    np.testing.assert_allclose(world.clearance(q).rate, slope, atol=1e-5)
    assert (np.abs(slope[to_cloud(world)]) > 1e-3).any()


def test_what_is_the_arms_own_is_taken_out(panda_ready: tuple[Arm, Array]) -> None:
    arm, q = panda_ready
    world = World(arm, Scene([Sphere(name="far", radius=0.1, position=(0.0, 2.0, 0.0))]))
    skin = world.query(q)[np.array([second == "far" for _, second in world.pairs]), 4:7]
    there = Box(name="table", size=(0.4, 0.4, 0.1), position=(0.8, 0.0, 0.0))
    rows = np.vstack(
        [skin, [[0.8, 0.1, 0.04]], [[0.3, 0.9, -0.2]], [[0.9, 0.9, 0.9]], [[np.nan, 0, 0]]]
    )
    seen = PointCloud(name="cloud", points=rows, radius=0.01)
    (fault,) = infeasibility(SweptCheck(World(arm, Scene([seen]))), {"start": q}).splitlines()
    assert "overlap the cloud cloud by up to" in fault
    assert "CloudFilter" in fault
    regions = [there, HalfSpace(name="floor", offset=-0.1)]
    taker = CloudFilter(arm, 0.02, regions)
    np.testing.assert_array_equal(taker.kept(q, rows), [[0.9, 0.9, 0.9]])
    assert dict(taker.taken) == {"panda": len(skin), "table": 1, "floor": 1}
    pose = pin.SE3(TURN.matrix(), PLACE)
    turned = (rows - PLACE) @ pose.rotation
    np.testing.assert_allclose(pose.rotation @ taker.kept(q, turned, pose)[0] + PLACE, 0.9)
    with pytest.raises(InvalidValueError, match="region"):
        CloudFilter(arm, regions=[seen])


def test_a_base_in_a_cloud_is_told(arm_named: Callable[[str], Arm]) -> None:
    points = np.array([[0.0, 0.0, 0.05], [2.0, 0.0, 0.0]])
    inside = PointCloud(name="cloud", points=points, radius=0.01)
    (told,) = base_overlaps(arm_named("panda"), Scene([inside]))
    assert told.startswith("'panda_link0_0' is in 'cloud' by ")
    assert (
        base_overlaps(
            arm_named("panda"), Scene([PointCloud(name="c", points=points[1:], radius=0.01)])
        )
        == ()
    )


def test_inverse_kinematics_keeps_clear_of_a_cloud(panda_ready: tuple[Arm, Array]) -> None:
    arm, q = panda_ready
    points = points_around(np.random.default_rng(0), 300)
    world = World(arm, Scene([PointCloud(name="cloud", points=points, radius=0.02)]))
    for found in world.inverse_kinematics(arm.pose(q), count=4):
        assert world.distances(found).min() > 0.0
