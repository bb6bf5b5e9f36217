"""Signed distances and their gradients, against differences, closed forms and each other."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import Arm, load_arm
from densarm.clearance import Clearance
from densarm.distance_view import DistanceView
from densarm.errors import InvalidValueError
from densarm.robot.robot_description import RobotDescription
from densarm.scene import Box, Capsule, Cylinder, HalfSpace, Scene, Sphere

DATA = Path(__file__).parent / "data"
STEP = 1e-6  # [rad or m]
AGREE = 1e-4  # one-sided differences farther apart than this are those of a kink
ARMS = {
    "two_link": lambda: load_arm("two_link"),
    "panda hulls": lambda: load_arm("panda"),
    "panda capsules": lambda: load_arm("panda", shapes="capsule"),
    "branching": lambda: load_arm(DATA / "branching.urdf"),
}
OBSTACLES = {
    "sphere": lambda **pose: Sphere(name="it", radius=0.07, **pose),
    "box": lambda **pose: Box(name="it", size=(0.2, 0.1, 0.15), **pose),
    "capsule": lambda **pose: Capsule(name="it", radius=0.05, length=0.2, **pose),
    "cylinder": lambda **pose: Cylinder(name="it", radius=0.06, length=0.2, **pose),
    "half-space": lambda **pose: HalfSpace(name="it", **pose),
}
DEPTHS = {"apart": 0.05, "touching": 1e-6, "sunk": -1e-6, "penetrating": -0.004}  # distance [m]


@pytest.fixture(scope="module", params=ARMS)
def arm(request) -> Arm:
    return ARMS[request.param]()


def one_sided_differences(clearance: Clearance, q: np.ndarray, step: float = STEP):
    """Backward and forward differences of every distance along every joint, each (K, nv)."""
    arm = clearance.arm
    here = clearance.distances(q)
    moves = step * np.eye(arm.nv)
    return tuple(
        np.column_stack(
            [sign * (clearance.distances(arm.integrate(q, sign * e)) - here) / step for e in moves]
        )
        for sign in (-1.0, 1.0)
    )


def check_gradients(clearance: Clearance, q: np.ndarray, pairs=slice(None)) -> int:
    """Check gradients at q; return for how many pairs the one-sided differences agree."""
    gradient = clearance.evaluate(q).gradient[pairs]
    back, forth = (side[pairs] for side in one_sided_differences(clearance, q))
    central = 0.5 * (back + forth)
    wide = np.mean(one_sided_differences(clearance, q, 2 * STEP), axis=0)[pairs]
    kink = (np.abs(forth - back) > AGREE) | (np.abs(wide - central) > 5e-7)
    smooth = ~kink.any(axis=1)
    np.testing.assert_allclose(gradient[smooth], central[smooth], rtol=0, atol=1e-6)
    low, high = np.minimum(back, forth), np.maximum(back, forth)
    assert (gradient >= low - AGREE)[~smooth].all()
    assert (gradient <= high + AGREE)[~smooth].all()
    return int(smooth.sum())


def random_configuration(arm: Arm, random: np.random.Generator) -> np.ndarray:
    low = np.where(arm.is_circle, -np.pi, arm.limits.lower)
    high = np.where(arm.is_circle, np.pi, arm.limits.upper)
    return arm.configuration(random.uniform(low, high))


def obstacle_at(arm: Arm, kind: str, q: np.ndarray, shape: int, distance: float, random):
    """An obstacle at a given distance from one of the arm's shapes, and the index of that pair."""
    quaternion = random.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    geometry = arm.collision_model.createData()
    pin.updateGeometryPlacements(
        arm.model, arm.model.createData(), arm.collision_model, geometry, q
    )
    centre = geometry.oMg[shape].translation.copy()
    position = centre + 0.6 * quaternion[:3] / np.linalg.norm(quaternion[:3])
    pose = {"position": position, "orientation_xyzw": quaternion}
    clearance = Clearance(arm, Scene([OBSTACLES[kind](**pose)]))
    pair = clearance.pairs.index((arm.collision_model.geometryObjects[shape].name, "it"))
    obstacle = clearance.geometry_model.geometryObjects[-1]
    # Pushed in first, corners meet faces when they touch; corner on corner would be a kink.
    for goal in [-0.01] * 4 + [distance] * 4:
        excess = clearance.distances(q)[pair] - goal
        normal = np.array(clearance.geometry_data.distanceResults[pair].normal)
        obstacle.placement = pin.SE3(
            obstacle.placement.rotation, obstacle.placement.translation - excess * normal
        )
    return clearance, pair


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("kind", OBSTACLES)
def test_gradients_against_central_differences(arm, kind, depth):
    random = np.random.default_rng(0)
    shapes = arm.collision_model.geometryObjects
    moving = [k for k, item in enumerate(shapes) if item.parentJoint > 0]
    smooth = 0
    for _ in range(8):
        q = random_configuration(arm, random)
        shape = int(random.choice(moving))
        clearance, pair = obstacle_at(arm, kind, q, shape, DEPTHS[depth], random)
        assert clearance.distances(q)[pair] == pytest.approx(DEPTHS[depth], abs=1e-7)
        smooth += check_gradients(clearance, q, [pair])
    assert smooth >= 5


def test_gradients_of_all_pairs(arm):
    """Self-collision pairs too, many of them in deep contact."""
    random = np.random.default_rng(1)
    scene = Scene([make(name=kind) for kind, make in named_obstacles().items()])
    clearance = Clearance(arm, scene)
    total = sum(check_gradients(clearance, random_configuration(arm, random)) for _ in range(20))
    assert total > 0.95 * 20 * clearance.n_pairs


def named_obstacles():
    return {
        "sphere": lambda name: Sphere(name=name, radius=0.1, position=(0.5, 0.1, 0.4)),
        "box": lambda name: Box(name=name, size=(0.5, 0.4, 0.1), position=(-0.3, 0.5, 0.2)),
        "capsule": lambda name: Capsule(name=name, radius=0.1, length=0.5, position=(0, -0.6, 0.5)),
        "cylinder": lambda name: Cylinder(
            name=name, radius=0.1, length=0.4, position=(0.4, 0.4, 0)
        ),
    }


INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def single_link(shape: str, axis: str = "0 1 0", kind: str = "revolute", origin: str = "0 0 0"):
    urdf = f"""<robot name="single"><link name="base"/><link name="link">
      {INERTIAL}<collision><origin xyz="{origin}"/><geometry>{shape}</geometry></collision></link>
      <joint name="joint" type="{kind}"><parent link="base"/><child link="link"/>
      <axis xyz="{axis}"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""
    return Arm(RobotDescription(name="single", urdf=urdf))


@pytest.mark.parametrize("height", [0.02, 0.0, -0.01])
def test_gradient_at_a_kink_lies_between_the_one_sided_ones(height):
    arm = single_link('<box size="0.2 0.3 0.1"/>')
    table = Box(name="table", size=(1, 1, 0.2), position=(0.03, 0, -0.15 - height))
    clearance = Clearance(arm, Scene([table]))
    q = np.zeros(1)
    sample = clearance.evaluate(q)
    assert sample.distance[0] == pytest.approx(height, abs=1e-9)
    back, forth = one_sided_differences(clearance, q)
    np.testing.assert_allclose([back, forth], [[[0.1]], [[-0.1]]], atol=1e-4)
    assert -0.1 - 1e-9 <= sample.gradient[0, 0] <= 0.1 + 1e-9


POINT = st.tuples(*[st.floats(-0.8, 0.8)] * 3).map(np.array)


@pytest.fixture(scope="module")
def two_link() -> Arm:
    return load_arm("two_link")


@given(point=POINT, angle=st.floats(-3.0, 3.0))
def test_capsule_and_sphere_in_closed_form(two_link, point, angle):
    arm = two_link
    radius, angles = 0.1, np.array([angle, 0.5])
    absolute = np.cumsum(angles)
    ends = np.cumsum(np.column_stack([np.sin(absolute), 0 * absolute, -np.cos(absolute)]), axis=0)
    clearance = Clearance(arm, Scene([Sphere(name="ball", radius=radius, position=point)]))
    sample = clearance.evaluate(arm.configuration(angles))
    for k, (a, b) in enumerate(((np.zeros(3), ends[0]), (ends[0], ends[1]))):
        along = np.clip((point - a) @ (b - a), 0.0, 1.0)  # the links are 1 m long
        expected = np.linalg.norm(point - a - along * (b - a)) - 0.05 - radius
        assert sample.distance[k] == pytest.approx(expected, abs=1e-8)


@given(point=POINT, axis=POINT.filter(lambda n: np.linalg.norm(n) > 0.01), angle=st.floats(-3, 3))
def test_half_space_in_closed_form(two_link, point, axis, angle):
    normal = axis / np.linalg.norm(axis)
    wall = HalfSpace(name="wall", normal=axis, offset=0.3, position=point)
    absolute = np.array([angle, angle + 0.5])
    ends = np.cumsum(np.column_stack([np.sin(absolute), 0 * absolute, -np.cos(absolute)]), axis=0)
    heights = np.vstack([np.zeros(3), ends]) @ normal - normal @ point - 0.3
    clearance = Clearance(two_link, Scene([wall]))
    distance = clearance.distances(two_link.configuration([angle, 0.5]))
    expected = np.minimum(heights[:-1], heights[1:]) - 0.05  # the links' radius
    np.testing.assert_allclose(distance[:2], expected, rtol=0, atol=1e-9)


@given(data=st.data())
def test_box_and_sphere_in_closed_form(data):
    half = np.array([0.1, 0.15, 0.05])
    point = data.draw(POINT)
    outside = np.maximum(np.abs(point) - half, 0.0)
    arm = single_link('<box size="0.2 0.3 0.1"/>')
    clearance = Clearance(arm, Scene([Sphere(name="ball", radius=0.02, position=point)]))
    depth = (np.abs(point) - half).max()
    expected = (np.linalg.norm(outside) if outside.any() else depth) - 0.02
    assert clearance.distances(np.zeros(1))[0] == pytest.approx(expected, abs=1e-8)


def test_one_joint():
    arm = single_link('<sphere radius="0.1"/>', origin="0.5 0 0")
    clearance = Clearance(arm, Scene([Sphere(name="ball", radius=0.1, position=(0, 0, 1))]))
    sample = clearance.evaluate([0.3])
    point = 0.5 * np.array([np.cos(0.3), -np.sin(0.3)])
    gap = np.array([0.0, 1.0]) - point
    assert sample.distance[0] == pytest.approx(np.linalg.norm(gap) - 0.2, abs=1e-12)
    assert sample.gradient.shape == (1, 1)
    check_gradients(clearance, np.array([0.3]))


def test_pairs_are_named():
    clearance = Clearance(load_arm("two_link"), Scene([Sphere(name="ball", radius=0.1)]))
    assert clearance.pairs == (("upper_link_0", "ball"), ("lower_link_0", "ball"))
    assert clearance.evaluate([1, 0, 1, 0]).pairs == clearance.pairs


def test_obstacles_are_not_paired_with_what_stands_still(arm):
    clearance = Clearance(arm, Scene([Sphere(name="ball", radius=0.1)]))
    shapes = arm.collision_model.geometryObjects
    against = {first for first, second in clearance.pairs if second == "ball"}
    assert against == {item.name for item in shapes if item.parentJoint > 0}


def test_obstacle_named_like_a_link():
    scene = Scene([Sphere(name="lower_link_0", radius=0.1)])
    with pytest.raises(InvalidValueError, match=r"'lower_link_0': must be other than.*'two_link'"):
        Clearance(load_arm("two_link"), scene)


def test_no_obstacles():
    panda = Clearance(load_arm("panda"), Scene())
    assert panda.n_pairs == len(load_arm("panda").collision_model.collisionPairs)
    assert check_gradients(panda, panda.arm.postures["ready"]) > 0


def test_no_pairs():
    clearance = Clearance(load_arm("two_link"), Scene())
    sample = clearance.evaluate([1, 0, 1, 0])
    assert (sample.distance.shape, sample.gradient.shape, sample.pairs) == ((0,), (0, 2), ())
    assert clearance.distances(np.array([1.0, 0, 1, 0])).shape == (0,)


def test_many_obstacles():
    random = np.random.default_rng(0)
    places = random.uniform(-1, 1, (500, 3))
    arm = load_arm("panda", shapes="capsule")
    q = arm.postures["ready"]
    balls = [Sphere(name=f"ball{k}", radius=0.05, position=p) for k, p in enumerate(places)]
    clearance = Clearance(arm, Scene(balls))
    sample = clearance.evaluate(q)
    alone = Clearance(arm, Scene([balls[321]])).evaluate(q)
    columns = [k for k, pair in enumerate(clearance.pairs) if pair in alone.pairs]
    np.testing.assert_array_equal(sample.distance[columns], alone.distance)
    np.testing.assert_array_equal(sample.gradient[columns], alone.gradient)


def test_obstacles_stay_when_the_base_moves():
    base = pin.SE3(pin.rpy.rpyToMatrix(0.2, 0.4, -1.0), np.array([0.3, 0.1, 0.5]))
    arm, placed = load_arm("panda"), load_arm("panda", base_placement=base)
    place = np.array([0.5, 0.2, 0.6])
    there = Clearance(arm, Scene([Sphere(name="it", radius=0.1, position=base.actInv(place))]))
    here = Clearance(placed, Scene([Sphere(name="it", radius=0.1, position=place)]))
    q = arm.postures["ready"]
    for name in ("distance", "gradient"):
        values = [getattr(clearance.evaluate(q), name) for clearance in (there, here)]
        np.testing.assert_allclose(*values, atol=1e-9)


def test_results_do_not_depend_on_what_was_asked_before(arm):
    random = np.random.default_rng(2)
    scene = Scene([make(name=kind) for kind, make in named_obstacles().items()])
    fresh, used = Clearance(arm, scene), Clearance(arm, scene)
    for _ in range(20):
        used.update(random_configuration(arm, random))
    q = random_configuration(arm, random)
    one, other = fresh.evaluate(q), used.evaluate(q)
    # coal's iterations start from what the last query left: the last digits differ.
    np.testing.assert_allclose(one.distance, other.distance, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.gradient, other.gradient, rtol=0, atol=1e-12)
    np.testing.assert_allclose(used.distances(q), one.distance, rtol=0, atol=1e-12)
    some = random.permutation(used.n_pairs)[: used.n_pairs // 2]
    used.update(random_configuration(arm, random))
    np.testing.assert_allclose(used.distances(q, some), one.distance[some], rtol=0, atol=1e-12)


def test_the_same_questions_get_the_same_answers(arm):
    scene = Scene([make(name=kind) for kind, make in named_obstacles().items()])
    runs = []
    for _ in range(2):
        random, clearance = np.random.default_rng(2), Clearance(arm, scene)
        runs.append([clearance.evaluate(random_configuration(arm, random)) for _ in range(20)])
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one.distance, other.distance)
        np.testing.assert_array_equal(one.gradient, other.gradient)


def test_samples_are_copies():
    arm = load_arm("two_link")
    clearance = Clearance(arm, Scene([Sphere(name="ball", radius=0.1, position=(1, 0, 0))]))
    sample = clearance.evaluate([1, 0, 1, 0])
    kept = sample.distance.copy(), sample.gradient.copy()
    clearance.evaluate([0, 1, 1, 0])
    np.testing.assert_array_equal(sample.distance, kept[0])
    np.testing.assert_array_equal(sample.gradient, kept[1])


def test_without_the_direct_view(arm, monkeypatch):
    scene = Scene([make(name=kind) for kind, make in named_obstacles().items()])
    q = random_configuration(arm, np.random.default_rng(3))
    expected = Clearance(arm, scene).evaluate(q)
    monkeypatch.setattr(DistanceView, "_strided", lambda _: None)
    sample = Clearance(arm, scene).evaluate(q)
    np.testing.assert_array_equal(sample.distance, expected.distance)
    np.testing.assert_array_equal(sample.gradient, expected.gradient)


def test_wrong_configurations():
    clearance = Clearance(load_arm("two_link"), Scene())
    with pytest.raises(InvalidValueError, match=r"configuration = .*\(4,\), got \(2,\)"):
        clearance.evaluate([0.0, 0.0])
    with pytest.raises(InvalidValueError, match=r"configuration = .*finite"):
        clearance.evaluate([1.0, 0.0, np.nan, 0.0])
