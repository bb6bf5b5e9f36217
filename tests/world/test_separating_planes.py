"""Segments proved by separating planes are those that the swept check proves by distances."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.errors import InvalidValueError, SceneChangedError
from densarm.scene.mesh import Mesh
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes, Tube
from densarm.world.separation import ACCURACY
from densarm.world.swept_check import SweptCheck
from densarm.world.world import DISTANCE_TOLERANCE, World

SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.2, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.5, -0.3, 0.2)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.4, 0.6)),
        Cylinder(name="post", radius=0.05, length=0.6, position=(-0.3, -0.5, 0.4)),
        HalfSpace(name="wall", normal=(1.0, 0.2, -0.1), offset=-0.7),
    ]
)
ARMS = [
    "two_link",
    "panda",
    "branching, placed",
    "gantry",
    pytest.param("panda capsules", marks=pytest.mark.slow),
    pytest.param("branching", marks=pytest.mark.slow),
]
BIT = 1.01  # by which a margin is wider, so that bounds within 1 % of a distance decide alike
MARGIN = 0.005  # [m]
RADII = 0.3  # [m], more than those of two round bodies: bounds are as accurate as without them
SEED = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module", params=ARMS)
def world(request: pytest.FixtureRequest, arm_named: Callable[[str], Arm]) -> World:
    return World(arm_named(request.param), SCENE)


@pytest.fixture(scope="module")
def used_planes(world: World) -> SeparatingPlanes:
    """One object for all questions, that remembers what it was asked."""
    return SeparatingPlanes(world, MARGIN)


@settings(max_examples=40)
@given(seed=SEED, length=st.floats(0.01, 3.0))
def test_decides_as_the_swept_check_does(
    world: World,
    used_planes: SeparatingPlanes,
    within_limits: Callable[[Arm, Array], Array],
    seed: int,
    length: float,
) -> None:
    """What it proves, distances prove; what distances prove with a bit to spare, it proves."""
    arm, rng = world.arm, np.random.default_rng(seed)
    q, q_other = arm.configurations(within_limits(arm, rng.random((2, arm.nv))))
    step = arm.difference(q, q_other)
    q_to = arm.integrate(q, min(1.0, length / float(np.linalg.norm(step))) * step)
    fresh = SeparatingPlanes(world, MARGIN)
    for planes in (fresh, used_planes):  # what one remembers decides nothing
        if planes.segment_is_clear(q, q_to):
            assert SweptCheck(world, MARGIN - 1e-4).segment_is_clear(q, q_to)
        else:
            assert not SweptCheck(world, BIT * MARGIN + 1e-3).segment_is_clear(q, q_to)


@settings(max_examples=20)
@given(seed=SEED, count=st.integers(2, 6))
def test_a_polyline_is_clear_where_all_its_segments_are(
    world: World,
    used_planes: SeparatingPlanes,
    within_limits: Callable[[Arm, Array], Array],
    seed: int,
    count: int,
) -> None:
    arm, rng = world.arm, np.random.default_rng(seed)
    ends = within_limits(arm, rng.random((2, arm.nv)))
    angles = ends[0] + np.linspace(0.0, 0.3, count)[:, np.newaxis] * (ends[1] - ends[0])
    angles[1:-1] += rng.uniform(-0.01, 0.01, angles[1:-1].shape)
    segments = list(pairwise(arm.configurations(angles)))
    if used_planes.polyline_is_clear(angles):
        looser = SweptCheck(world, MARGIN - 1e-4)
        assert all(looser.segment_is_clear(*segment) for segment in segments)
    else:
        stricter = SweptCheck(world, BIT * MARGIN + 1e-3)
        assert not all(stricter.segment_is_clear(*segment) for segment in segments)


@settings(max_examples=40)
@given(seed=SEED)
def test_is_never_clear_where_there_is_contact(
    world: World,
    used_planes: SeparatingPlanes,
    within_limits: Callable[[Arm, Array], Array],
    seed: int,
) -> None:
    """At any configuration that a segment proved clear runs through, distances tell so."""
    arm, rng = world.arm, np.random.default_rng(seed)
    q = arm.configuration(within_limits(arm, rng.random(arm.nv)))
    distance = world.distances(q).min()
    if used_planes.configuration_is_clear(q):
        assert distance > MARGIN - DISTANCE_TOLERANCE
    else:
        short = ACCURACY * (distance + RADII)
        assert distance - short <= MARGIN + 3.0 * DISTANCE_TOLERANCE
    if distance < MARGIN:  # nor on a segment that it is the middle of
        angles = arm.angles(q)
        space = np.minimum(angles - arm.limits.lower, arm.limits.upper - angles)
        step = np.clip(0.3 * rng.normal(size=arm.nv), -space, space)
        ends = arm.configurations(np.array([angles - step, angles + step]))
        assert not used_planes.segment_is_clear(*ends)


@settings(max_examples=30)
@given(seed=SEED, length=st.floats(0.1, 3.0))
def test_what_distances_come_down_to_on_a_segment_is_not_proved_to_be_exceeded(
    world: World, within_limits: Callable[[Arm, Array], Array], seed: int, length: float
) -> None:
    """A margin as large as the smallest distance on the way; a bit less is proved."""
    arm, rng = world.arm, np.random.default_rng(seed)
    q, q_other = arm.configurations(within_limits(arm, rng.random((2, arm.nv))))
    step = arm.difference(q, q_other)
    step *= min(1.0, length / float(np.linalg.norm(step)))
    on_the_way = arm.integrate(q, np.linspace(0.0, 1.0, 60)[:, np.newaxis] * step)
    least = min(world.distances(x).min() for x in on_the_way)
    q_to = on_the_way[-1]
    assert not SeparatingPlanes(world, max(least, 0.0)).segment_is_clear(q, q_to)
    between = world.motion_bound(step / 59).max()
    less = 0.98 * (least - between) - 3.0 * DISTANCE_TOLERANCE
    if less > 0.0:
        assert SeparatingPlanes(world, less).segment_is_clear(q, q_to)


@pytest.mark.parametrize("towards", [np.pi, 2.2])
@given(before=st.floats(0.05, 1.5), after=st.floats(0.05, 1.5), gap=st.floats(-0.1, 0.1))
def test_a_tip_that_swings_past_a_wall_comes_nearest_on_the_way(
    two_link: Arm, towards: float, before: float, after: float, gap: float
) -> None:
    """A wall that the stretched arm points at halfway, along an axis of its frame and aslant.

    Ends and middle of the swing are farther from it than the place where the tip bends towards it.
    """
    normal = (-np.sin(towards), 0.0, np.cos(towards))
    wall = HalfSpace(name="wall", normal=normal, offset=-(2.0 + 0.05 + gap))
    planes = SeparatingPlanes(World(two_link, Scene([wall])))
    start, goal = (two_link.configuration([towards + by, 0.0]) for by in (-before, after))
    if gap <= 0.0:
        assert not planes.segment_is_clear(start, goal)
    elif gap > 1e-3:
        assert planes.segment_is_clear(start, goal)


@settings(max_examples=30)
@given(seed=SEED)
def test_bodies_of_any_shape_at_any_pose(
    free_among: Callable[[Obstacle, Obstacle], World],
    random_mesh: Callable[[str, np.random.Generator], Mesh],
    seed: int,
) -> None:
    """Decides by distances within the accuracy of its bounds, wherever it was asked before."""
    rng = np.random.default_rng(seed)
    world = free_among(random_mesh("one", rng), random_mesh("other", rng))
    angles, margin = rng.normal(size=6), rng.choice([0.0, 0.01, 0.3, 1.0])
    planes = SeparatingPlanes(world, margin)
    for _ in range(5):
        q = world.arm.configuration(angles)
        distance = world.distances(q).min()
        if planes.configuration_is_clear(q):
            assert distance > margin
        else:
            assert (1.0 - ACCURACY) * distance <= margin + 3.0 * DISTANCE_TOLERANCE
        angles = angles + rng.choice([0.02, 0.3]) * rng.normal(size=6)


@pytest.mark.parametrize("gap", [1e-6, 1e-3, 0.5])
@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_boxes_face_to_face(
    free_among: Callable[[Obstacle, Obstacle], World], gap: float, slip: float
) -> None:
    world = free_among(
        Box(name="one", size=(1.0, 2.0, 3.0)), Box(name="other", size=(1.0, 1.0, 1.0))
    )
    q = world.arm.configuration([1.0 + gap, slip, -slip, 0.0, 0.0, 0.0])
    nearly, beyond = (1.0 - ACCURACY) * gap - 2.0 * DISTANCE_TOLERANCE, gap * (1.0 + 1e-9)
    assert SeparatingPlanes(world, nearly).configuration_is_clear(q)
    assert not SeparatingPlanes(world, beyond).configuration_is_clear(q)


@pytest.mark.parametrize("depth", [0.0, 1e-3, 0.7, 1.0])
def test_overlapping_bodies_are_not_clear(
    free_among: Callable[[Obstacle, Obstacle], World], depth: float
) -> None:
    world = free_among(*(Box(name=name, size=(1.0, 1.0, 1.0)) for name in ("one", "other")))
    q = world.arm.configuration([1.0 - depth, 0.1, 0.2, 0.0, 0.0, 0.0])
    assert not SeparatingPlanes(world).configuration_is_clear(q)


def test_capsules_and_spheres_are_round(
    free_among: Callable[[Obstacle, Obstacle], World],
) -> None:
    """A capsule and a sphere whose centres are 5 m apart: their radii are taken off."""
    world = free_among(
        Capsule(name="one", radius=0.1, length=1.0), Sphere(name="other", radius=0.3)
    )
    q = world.arm.configuration([3.0, 0.0, 4.5, 0.0, 0.0, 0.0])
    assert SeparatingPlanes(world, 5.0 * (1.0 - ACCURACY) - 0.4 - 1e-6).configuration_is_clear(q)
    assert not SeparatingPlanes(world, 4.6).configuration_is_clear(q)


def test_an_obstacle_between_clear_ends(two_link: Arm) -> None:
    ball = Scene([Sphere(name="ball", radius=0.02, position=[1.5, 0.0, 0.0])])
    planes = SeparatingPlanes(World(two_link, ball))
    start, goal = two_link.configuration([0.0, 0.0]), two_link.configuration([3.0, 0.0])
    assert planes.configuration_is_clear(start)
    assert planes.configuration_is_clear(goal)
    assert not planes.segment_is_clear(start, goal)
    assert planes.segment_is_clear(start, two_link.configuration([1.4, 0.0]))
    assert not planes.configuration_is_clear(two_link.configuration([np.pi / 2, 0.0]))


def test_everything_is_clear_without_pairs(two_link: Arm) -> None:
    planes = SeparatingPlanes(World(two_link, Scene()))
    start, goal = two_link.configuration([0.0, 0.0]), two_link.configuration([3.0, 1.0])
    assert planes.segment_is_clear(start, goal)


def test_obstacles_that_change(two_link: Arm) -> None:
    """What was proved before a change is no proof; a spare obstacle is in nobody's way."""
    ball = Sphere(name="ball", radius=0.02, position=[5.0, 0.0, 0.0])
    spare = Sphere(name="spare", radius=0.02, position=[1.5, 0.0, 0.0])
    world = World(two_link, Scene([ball]), spare=[spare])
    start, goal = two_link.configuration([0.0, 0.0]), two_link.configuration([3.0, 0.0])
    planes = SeparatingPlanes(world)
    assert planes.segment_is_clear(start, goal)
    world.move_obstacle("ball", [1.5, 0.0, 0.0])
    with pytest.raises(SceneChangedError):
        planes.segment_is_clear(start, goal)
    with pytest.raises(SceneChangedError):
        planes.configuration_is_clear(start)
    with pytest.raises(SceneChangedError):
        planes.tube_is_clear(Tube(np.zeros(2), np.ones(2), np.zeros(2)))
    assert not SeparatingPlanes(world).segment_is_clear(start, goal)
    world.remove_obstacle("ball")
    assert SeparatingPlanes(world).segment_is_clear(start, goal)
    world.add_obstacle(Sphere(name="new", radius=0.02, position=[1.5, 0.0, 0.0]))
    assert not SeparatingPlanes(world).segment_is_clear(start, goal)


@pytest.mark.parametrize("margin", [-0.01, np.nan, np.inf])
def test_wrong_margin(two_link: Arm, margin: float) -> None:
    with pytest.raises(InvalidValueError, match="margin"):
        SeparatingPlanes(World(two_link, Scene()), margin)
