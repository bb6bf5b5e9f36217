"""Signed distances and their gradients, against differences, closed forms and each other."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from densarm.scene.scene import Attachment, Scene
from densarm.values.arrays import Array
from densarm.world.distance_view import DistanceView
from densarm.world.world import World

STEP = 1e-6  # [rad or m]
AGREE = 1e-4  # one-sided differences farther apart than this are those of a kink
ARMS = [
    "two_link",
    "panda",
    "branching",
    pytest.param("panda capsules", marks=pytest.mark.slow),
]
OBSTACLES: dict[str, Callable[..., Obstacle]] = {
    "sphere": lambda **pose: Sphere(name="it", radius=0.07, **pose),
    "box": lambda **pose: Box(name="it", size=(0.2, 0.1, 0.15), **pose),
    "capsule": lambda **pose: Capsule(name="it", radius=0.05, length=0.2, **pose),
    "cylinder": lambda **pose: Cylinder(name="it", radius=0.06, length=0.2, **pose),
    "half-space": lambda **pose: HalfSpace(name="it", **pose),
}
DEPTHS = {"apart": 0.05, "touching": 1e-6, "sunk": -1e-6, "penetrating": -0.004}  # distance [m]
NAMED_OBSTACLES = Scene(
    [
        Sphere(name="sphere", radius=0.1, position=(0.5, 0.1, 0.4)),
        Box(name="box", size=(0.5, 0.4, 0.1), position=(-0.3, 0.5, 0.2)),
        Capsule(name="capsule", radius=0.1, length=0.5, position=(0, -0.6, 0.5)),
        Cylinder(name="cylinder", radius=0.1, length=0.4, position=(0.4, 0.4, 0)),
    ]
)


@pytest.fixture(scope="module", params=ARMS)
def arm(request: pytest.FixtureRequest, arm_named: Callable[[str], Arm]) -> Arm:
    return arm_named(request.param)


def one_sided_differences(world: World, q: Array, step: float = STEP) -> tuple[Array, Array]:
    """Backward and forward differences of every distance along every joint, each (K, nv)."""
    arm, here = world.arm, world.distances(q)
    back, forth = (
        np.column_stack(
            [
                sign * (world.distances(arm.integrate(q, sign * e)) - here) / step
                for e in step * np.eye(arm.nv)
            ]
        )
        for sign in (-1.0, 1.0)
    )
    return back, forth


def check_gradients(world: World, q: Array, pairs: Sequence[int] | slice = slice(None)) -> int:
    """Check gradients at q; return for how many pairs the one-sided differences agree."""
    gradient = world.clearance(q).gradient[pairs]
    back, forth = (side[pairs] for side in one_sided_differences(world, q))
    central = 0.5 * (back + forth)
    wide = np.mean(one_sided_differences(world, q, 2 * STEP), axis=0)[pairs]
    kink = (np.abs(forth - back) > AGREE) | (np.abs(wide - central) > 5e-7)
    smooth = ~kink.any(axis=1)
    np.testing.assert_allclose(gradient[smooth], central[smooth], rtol=0, atol=1e-6)
    low, high = np.minimum(back, forth), np.maximum(back, forth)
    assert (gradient >= low - AGREE)[~smooth].all()
    assert (gradient <= high + AGREE)[~smooth].all()
    return int(smooth.sum())


def random_configuration(arm: Arm, random: np.random.Generator) -> Array:
    low = np.where(arm.continuous, -np.pi, arm.limits.lower)
    high = np.where(arm.continuous, np.pi, arm.limits.upper)
    return arm.configuration(random.uniform(low, high))


def obstacle_at(
    arm: Arm, kind: str, q: Array, shape: int, distance: float, random: np.random.Generator
) -> tuple[World, int]:
    """An obstacle at a given distance from one of the arm's shapes, and the index of that pair."""
    quaternion = random.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    geometry, data = arm.collision_model.createData(), arm.model.createData()
    pin.updateGeometryPlacements(arm.model, data, arm.collision_model, geometry, q)
    centre = geometry.oMg[shape].translation.copy()
    position = centre + 0.6 * quaternion[:3] / np.linalg.norm(quaternion[:3])
    obstacle = OBSTACLES[kind](position=position, orientation_xyzw=quaternion)
    world = World(arm, Scene([obstacle]))
    pair = world.pairs.index((arm.collision_model.geometryObjects[shape].name, "it"))
    geometry = world.geometry_model.createData()
    # Pushed in first, corners meet faces when they touch; corner on corner would be a kink.
    for goal in [-0.01] * 4 + [distance] * 4:
        excess = world.distances(q)[pair] - goal
        pin.computeDistances(arm.model, data, world.geometry_model, geometry, q)
        position = position - excess * np.array(geometry.distanceResults[pair].normal)
        world.move_obstacle("it", position)
    return world, pair


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("kind", OBSTACLES)
def test_gradients_against_central_differences(arm: Arm, kind: str, depth: str) -> None:
    random = np.random.default_rng(0)
    shapes = arm.collision_model.geometryObjects
    moving = [k for k, item in enumerate(shapes) if item.parentJoint > 0]
    smooth = 0
    for _ in range(8):
        q = random_configuration(arm, random)
        shape = int(random.choice(moving))
        world, pair = obstacle_at(arm, kind, q, shape, DEPTHS[depth], random)
        assert world.distances(q)[pair] == pytest.approx(DEPTHS[depth], abs=1e-7)
        smooth += check_gradients(world, q, [pair])
    assert smooth >= 5


def test_gradients_of_all_pairs(arm: Arm) -> None:
    """Self-collision pairs too, many of them in deep contact."""
    random = np.random.default_rng(1)
    world = World(arm, NAMED_OBSTACLES)
    total = sum(check_gradients(world, random_configuration(arm, random)) for _ in range(20))
    assert total > 0.95 * 20 * world.n_pairs


@pytest.mark.parametrize("height", [0.02, 0.0, -0.01])
def test_gradient_at_a_kink_lies_between_the_one_sided_ones(
    single_link: Callable[..., Arm], height: float
) -> None:
    arm = single_link('<box size="0.2 0.3 0.1"/>')
    table = Box(name="table", size=(1, 1, 0.2), position=(0.03, 0, -0.15 - height))
    world = World(arm, Scene([table]))
    q = np.zeros(1)
    sample = world.clearance(q)
    assert sample.distance[0] == pytest.approx(height, abs=1e-9)
    back, forth = one_sided_differences(world, q)
    np.testing.assert_allclose([back, forth], [[[0.1]], [[-0.1]]], atol=1e-4)
    assert -0.1 - 1e-9 <= sample.gradient[0, 0] <= 0.1 + 1e-9


POINT = st.tuples(*[st.floats(-0.8, 0.8)] * 3).map(np.array)


def ends_of_links(angles: Sequence[float]) -> Array:
    """Both ends of the two-link arm's links, whose length is 1 m (3, 3) [m]."""
    absolute = np.cumsum(angles)
    along = np.column_stack([np.sin(absolute), 0 * absolute, -np.cos(absolute)])
    return np.vstack([np.zeros(3), np.cumsum(along, axis=0)])


@settings(max_examples=40)
@given(point=POINT, angle=st.floats(-3.0, 3.0))
def test_capsule_and_sphere_in_closed_form(two_link: Arm, point: Array, angle: float) -> None:
    radius, ends = 0.1, ends_of_links([angle, 0.5])
    world = World(two_link, Scene([Sphere(name="ball", radius=radius, position=point)]))
    sample = world.clearance(two_link.configuration([angle, 0.5]))
    for k, (a, b) in enumerate(pairwise(ends)):
        along = np.clip((point - a) @ (b - a), 0.0, 1.0)
        expected = np.linalg.norm(point - a - along * (b - a)) - 0.05 - radius
        assert sample.distance[k] == pytest.approx(expected, abs=1e-8)


@settings(max_examples=40)
@given(point=POINT, axis=POINT.filter(lambda n: np.linalg.norm(n) > 0.01), angle=st.floats(-3, 3))
def test_half_space_in_closed_form(two_link: Arm, point: Array, axis: Array, angle: float) -> None:
    normal = axis / np.linalg.norm(axis)
    wall = HalfSpace(name="wall", normal=axis, offset=0.3, position=point)
    heights = ends_of_links([angle, 0.5]) @ normal - normal @ point - 0.3
    world = World(two_link, Scene([wall]))
    distance = world.distances(two_link.configuration([angle, 0.5]))
    expected = np.minimum(heights[:-1], heights[1:]) - 0.05  # the links' radius
    np.testing.assert_allclose(distance[:2], expected, rtol=0, atol=1e-9)


@settings(max_examples=40)
@given(point=POINT)
def test_box_and_sphere_in_closed_form(single_link: Callable[..., Arm], point: Array) -> None:
    half = np.array([0.1, 0.15, 0.05])
    outside = np.maximum(np.abs(point) - half, 0.0)
    arm = single_link('<box size="0.2 0.3 0.1"/>')
    world = World(arm, Scene([Sphere(name="ball", radius=0.02, position=point)]))
    depth = (np.abs(point) - half).max()
    expected = (np.linalg.norm(outside) if outside.any() else depth) - 0.02
    assert world.distances(np.zeros(1))[0] == pytest.approx(expected, abs=1e-8)


def test_one_joint(single_link: Callable[..., Arm]) -> None:
    arm = single_link('<sphere radius="0.1"/>', origin="0.5 0 0")
    world = World(arm, Scene([Sphere(name="ball", radius=0.1, position=(0, 0, 1))]))
    sample = world.clearance([0.3])
    point = 0.5 * np.array([np.cos(0.3), -np.sin(0.3)])
    gap = np.array([0.0, 1.0]) - point
    assert sample.distance[0] == pytest.approx(np.linalg.norm(gap) - 0.2, abs=1e-12)
    assert sample.gradient.shape == (1, 1)
    check_gradients(world, np.array([0.3]))


def test_pairs_are_named(two_link: Arm) -> None:
    world = World(two_link, Scene([Sphere(name="ball", radius=0.1)]))
    assert world.pairs == (("upper_link_0", "ball"), ("lower_link_0", "ball"))
    assert world.clearance([1, 0, 1, 0]).pairs == world.pairs


def test_obstacles_are_not_paired_with_what_stands_still(arm: Arm) -> None:
    world = World(arm, Scene([Sphere(name="ball", radius=0.1)]))
    shapes = arm.collision_model.geometryObjects
    against = {first for first, second in world.pairs if second == "ball"}
    assert against == {item.name for item in shapes if item.parentJoint > 0}


def test_obstacle_named_like_a_link(two_link: Arm) -> None:
    scene = Scene([Sphere(name="lower_link_0", radius=0.1)])
    with pytest.raises(InvalidValueError, match=r"'lower_link_0': must be other than.*'two_link'"):
        World(two_link, scene)


def test_no_obstacles(arm_named: Callable[[str], Arm]) -> None:
    panda = World(arm_named("panda"), Scene())
    assert panda.n_pairs == len(panda.arm.collision_model.collisionPairs)
    assert check_gradients(panda, panda.arm.postures["ready"]) > 0


def test_no_pairs(two_link: Arm) -> None:
    world = World(two_link, Scene())
    sample = world.clearance([1, 0, 1, 0])
    assert (sample.distance.shape, sample.gradient.shape, sample.pairs) == ((0,), (0, 2), ())
    assert world.distances(np.array([1.0, 0, 1, 0])).shape == (0,)


def test_many_obstacles(arm_named: Callable[[str], Arm]) -> None:
    random = np.random.default_rng(0)
    places = random.uniform(-1, 1, (500, 3))
    arm = arm_named("panda capsules")
    q = arm.postures["ready"]
    balls = [Sphere(name=f"ball{k}", radius=0.05, position=p) for k, p in enumerate(places)]
    world = World(arm, Scene(balls))
    sample = world.clearance(q)
    alone = World(arm, Scene([balls[321]])).clearance(q)
    columns = [k for k, pair in enumerate(world.pairs) if pair in alone.pairs]
    np.testing.assert_array_equal(sample.distance[columns], alone.distance)
    np.testing.assert_array_equal(sample.gradient[columns], alone.gradient)


def test_obstacles_stay_when_the_base_moves(arm_named: Callable[[str], Arm]) -> None:
    base = pin.SE3(pin.rpy.rpyToMatrix(0.2, 0.4, -1.0), np.array([0.3, 0.1, 0.5]))
    arm, placed = arm_named("panda"), load_arm("panda", base_placement=base)
    place = np.array([0.5, 0.2, 0.6])
    there = World(arm, Scene([Sphere(name="it", radius=0.1, position=base.actInv(place))]))
    here = World(placed, Scene([Sphere(name="it", radius=0.1, position=place)]))
    q = arm.postures["ready"]
    one, other = there.clearance(q), here.clearance(q)
    np.testing.assert_allclose(one.distance, other.distance, atol=1e-9)
    np.testing.assert_allclose(one.gradient, other.gradient, atol=1e-9)


def test_results_do_not_depend_on_what_was_asked_before(arm: Arm) -> None:
    random = np.random.default_rng(2)
    fresh, used = World(arm, NAMED_OBSTACLES), World(arm, NAMED_OBSTACLES)
    for _ in range(20):
        used.clearance(random_configuration(arm, random))
    q = random_configuration(arm, random)
    one, other = fresh.clearance(q), used.clearance(q)
    # coal's iterations start from what the last query left: the last digits differ.
    np.testing.assert_allclose(one.distance, other.distance, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.gradient, other.gradient, rtol=0, atol=1e-12)
    np.testing.assert_allclose(used.distances(q), one.distance, rtol=0, atol=1e-12)
    some = random.permutation(used.n_pairs)[: used.n_pairs // 2]
    used.clearance(random_configuration(arm, random))
    np.testing.assert_allclose(used.distances(q, some), one.distance[some], rtol=0, atol=1e-12)


def test_the_same_questions_get_the_same_answers(arm: Arm) -> None:
    runs = []
    for _ in range(2):
        random, world = np.random.default_rng(2), World(arm, NAMED_OBSTACLES)
        runs.append([world.clearance(random_configuration(arm, random)) for _ in range(20)])
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one.distance, other.distance)
        np.testing.assert_array_equal(one.gradient, other.gradient)


def test_samples_are_copies(two_link: Arm) -> None:
    world = World(two_link, Scene([Sphere(name="ball", radius=0.1, position=(1, 0, 0))]))
    sample, nearest = world.clearance([1, 0, 1, 0]), world.nearest(np.array([1.0, 0, 1, 0]))
    assert nearest is not None
    kept = sample.distance.copy(), sample.gradient.copy(), nearest.points.copy()
    world.clearance([0, 1, 1, 0])
    np.testing.assert_array_equal(sample.distance, kept[0])
    np.testing.assert_array_equal(sample.gradient, kept[1])
    np.testing.assert_array_equal(nearest.points, kept[2])


def test_nearest_is_the_pair_with_the_smallest_distance(arm: Arm) -> None:
    """Its points are as far apart as its distance says, along the normal of contact."""
    random, world = np.random.default_rng(4), World(arm, NAMED_OBSTACLES)
    signs = set()
    for _ in range(20):
        q = random_configuration(arm, random)
        sample, nearest = world.clearance(q), world.nearest(q)
        assert nearest is not None
        k = int(sample.distance.argmin())
        assert nearest.distance == pytest.approx(sample.distance[k], abs=1e-12)
        assert nearest.names == world.pairs[k]
        assert nearest.points.shape == (2, 3)
        gap = np.linalg.norm(nearest.points[1] - nearest.points[0])
        assert gap == pytest.approx(abs(nearest.distance), abs=1e-6)
        signs.add(np.sign(nearest.distance))
    assert len(signs) == 2 or arm.name == "two_link"


@settings(max_examples=40)
@given(point=POINT, angle=st.floats(-3.0, 3.0))
def test_nearest_points_of_capsule_and_sphere_in_closed_form(
    two_link: Arm, point: Array, angle: float
) -> None:
    ends = ends_of_links([angle, 0.5])
    world = World(two_link, Scene([Sphere(name="ball", radius=0.1, position=point)]))
    nearest = world.nearest(two_link.configuration([angle, 0.5]))
    assert nearest is not None
    k = 0 if nearest.names == ("upper_link_0", "ball") else 1
    a, b = ends[k : k + 2]
    on_axis = a + np.clip((point - a) @ (b - a), 0.0, 1.0) * (b - a)
    length = float(np.linalg.norm(point - on_axis))
    if length > 1e-3:
        normal = (point - on_axis) / length
        expected = [on_axis + 0.05 * normal, point - 0.1 * normal]
        np.testing.assert_allclose(nearest.points, expected, atol=1e-5)


def test_nothing_is_nearest_where_there_is_nothing(two_link: Arm) -> None:
    q, ball = two_link.configuration([0.3, 0.4]), Sphere(name="ball", radius=0.1)
    assert World(two_link, Scene()).nearest(q) is None
    world = World(two_link, Scene(), spare=[ball])
    assert world.nearest(q) is None
    world.add_obstacle(Sphere(name="it", radius=0.2, position=(0.0, 0.0, 3.0)))
    nearest = world.nearest(q)
    assert nearest is not None
    assert nearest.names[1] == "it"


def test_without_the_direct_view(arm: Arm, monkeypatch: pytest.MonkeyPatch) -> None:
    q = random_configuration(arm, np.random.default_rng(3))
    expected = World(arm, NAMED_OBSTACLES).clearance(q)
    monkeypatch.setattr(DistanceView, "_strided", lambda _: None)
    sample = World(arm, NAMED_OBSTACLES).clearance(q)
    np.testing.assert_array_equal(sample.distance, expected.distance)
    np.testing.assert_array_equal(sample.gradient, expected.gradient)


def test_wrong_configurations(two_link: Arm) -> None:
    world = World(two_link, Scene())
    with pytest.raises(InvalidValueError, match=r"configuration = .*\(4,\), got \(2,\)"):
        world.clearance([0.0, 0.0])
    with pytest.raises(InvalidValueError, match=r"configuration = .*finite"):
        world.clearance([1.0, 0.0, np.nan, 0.0])


def test_obstacles_in_the_base_are_told_as_they_come_and_go(
    arm_named: Callable[[str], Arm],
) -> None:
    arm = arm_named("panda")
    bottom = min(p[2] for p in arm.collision_model.geometryObjects[0].geometry.points())
    table = Box(name="table", size=(1, 1, 0.1), position=(0, 0, bottom - 0.05))
    world = World(arm, Scene([table]), spare=[Sphere(name="ball", radius=0.1)])
    assert world.base_overlaps() == ()  # it stands there
    world.move_obstacle("table", (0, 0, bottom - 0.05 + 0.01))
    assert world.base_overlaps() == ("'panda_link0_0' is in 'table' by 10 mm",)
    world.add_obstacle(Sphere(name="globe", radius=0.1))
    assert any(" is in 'globe' by " in phrase for phrase in world.base_overlaps())
    for name in ("table", "globe"):
        world.remove_obstacle(name)
    assert world.base_overlaps() == ()


def test_what_a_held_body_may_touch_is_no_pair() -> None:
    arm = load_arm("two_link")
    ball = Sphere(name="ball", radius=0.05)
    scene = Scene([Box(name=name, size=[1.0, 1.0, 0.1]) for name in ("table", "shelf")])
    held = Attachment(ball, arm.end_effector, touch_obstacles=["table"])
    pairs = World(arm.holding(held), scene).pairs
    assert ("ball", "table") not in pairs
    assert ("ball", "shelf") in pairs
    assert ("lower_link_0", "table") in pairs
    assert Attachment.from_json(held.to_json()) == held
