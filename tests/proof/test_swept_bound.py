"""The bound on how far bodies move is never exceeded, and segments are proved by it."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import Arm, load_arm
from densarm.attachment import Attachment
from densarm.clearance import Clearance
from densarm.errors import InvalidValueError
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Box, Capsule, Cylinder, Scene, Sphere
from densarm.shapes import extreme_points

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
BASE = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.7, 2.0), np.array([0.4, -0.2, 0.9]))
SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.2, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.5, -0.3, 0.2)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.4, 0.6)),
        Cylinder(name="post", radius=0.05, length=0.6, position=(-0.3, -0.5, 0.4)),
    ]
)
STICK = Attachment(Box(name="stick", size=(0.5, 0.02, 0.02), position=(0, 0, 0.1)), "panda_hand")
ARMS = {
    "two_link": lambda: load_arm("two_link"),
    "panda": lambda: load_arm("panda"),
    "panda capsules": lambda: load_arm("panda", shapes="capsule"),
    "panda with a stick": lambda: load_arm("panda").holding(STICK),
    "branching": lambda: load_arm(BRANCHING),
    "branching, placed": lambda: load_arm(BRANCHING, base_placement=BASE),
}
PART = st.floats(0.0, 1.0)
TWO_LINK_LENGTH, TWO_LINK_RADIUS = 1.0, 0.05  # [m]


@pytest.fixture(scope="module", params=ARMS)
def bound(request) -> SweptBound:
    return SweptBound(Clearance(ARMS[request.param](), SCENE))


def within_limits(arm: Arm, parts) -> np.ndarray:
    low = np.where(arm.is_circle, -np.pi, arm.limits.lower)
    high = np.where(arm.is_circle, np.pi, arm.limits.upper)
    return low + np.array(parts)[: arm.nv] * (high - low)


def points_in_world(bound: SweptBound, q: np.ndarray) -> list[np.ndarray]:
    """Points of every shape, and one on its surface for each of them."""
    clearance, model = bound.clearance, bound.arm.model
    data = clearance.geometry_model.createData()
    pin.updateGeometryPlacements(model, model.createData(), clearance.geometry_model, data, q)
    random = np.random.default_rng(0)
    result = []
    for item, pose in zip(clearance.geometry_model.geometryObjects, data.oMg, strict=True):
        points, radius = extreme_points(item.geometry)
        outward = random.normal(size=points.shape)
        outward *= radius / np.linalg.norm(outward, axis=1, keepdims=True)
        result.append((points + outward) @ pose.rotation.T + pose.translation)
    return result


@given(parts=st.tuples(*[PART] * 7), others=st.tuples(*[PART] * 7))
def test_no_point_moves_farther_than_the_bound(bound, parts, others):
    arm, clearance = bound.arm, bound.clearance
    angles, target = within_limits(arm, parts), within_limits(arm, others)
    q, q_target = arm.configuration(angles), arm.configuration(target)
    motion = bound.motion(target - angles)
    moved = [
        np.linalg.norm(b - a, axis=1).max()
        for a, b in zip(points_in_world(bound, q), points_in_world(bound, q_target), strict=True)
    ]
    names = [item.name for item in clearance.geometry_model.geometryObjects]
    obstacles = {obstacle.name for obstacle in SCENE}
    for k, (name, other) in enumerate(clearance.pairs):
        if other in obstacles:
            assert moved[names.index(name)] <= motion[k] + 1e-12
    change = np.abs(clearance.distances(q_target) - clearance.distances(q))
    assert (change <= motion + 1e-9).all()


@given(parts=st.tuples(*[PART] * 7))
def test_gradients_stay_below_the_levers(bound, parts):
    """A distance changes no faster than the levers allow, for self-collision pairs too."""
    arm = bound.arm
    sample = bound.clearance.evaluate(arm.configuration(within_limits(arm, parts)))
    assert (np.abs(sample.gradient) <= bound.lever + 1e-9).all()


def test_levers_of_the_two_link_arm():
    bound = SweptBound(Clearance(load_arm("two_link"), Scene([Sphere(name="ball", radius=0.1)])))
    np.testing.assert_allclose(bound.lever, [[1.05, 0.0], [2.05, 1.05]], rtol=1e-12)
    np.testing.assert_allclose(bound.motion(np.array([-0.1, 0.2])), [0.105, 0.415], rtol=1e-12)


def test_sliding_joints_lengthen_the_levers_above_them():
    longer = BRANCHING.read_text().replace('upper="0.3"', 'upper="1.3"')
    file = BRANCHING.with_name("temporary_longer.urdf")
    file.write_text(longer)
    try:
        arms = [load_arm(BRANCHING), load_arm(file)]
    finally:
        file.unlink()
    short, long = (SweptBound(Clearance(arm, SCENE)).lever for arm in arms)
    pairs = Clearance(arms[0], SCENE).pairs
    slide = arms[0].joint_names.index("slide")
    against_ball = [k for k, pair in enumerate(pairs) if pair == ("blade_0", "ball")]
    np.testing.assert_allclose((long - short)[against_ball], [[1.0, 0, 0, 0, 0]], atol=1e-12)
    assert set(short[:, slide]) == {0.0, 1.0}


def two_link_bound(angles: np.ndarray, point: np.ndarray, gap: float) -> SweptBound | None:
    """A ball whose least distance from the arm at samples (N, 2) is a given gap [m]."""
    nearest = np.inf
    start = np.zeros((len(angles), 3))
    for absolute in np.cumsum(angles, axis=1).T:
        along = np.column_stack([np.sin(absolute), 0 * absolute, -np.cos(absolute)])
        offset = np.clip(((point - start) * along).sum(axis=1), 0.0, TWO_LINK_LENGTH)
        distance = np.linalg.norm(point - start - offset[:, None] * along, axis=1)
        nearest = min(nearest, distance.min())
        start = start + TWO_LINK_LENGTH * along
    radius = nearest - TWO_LINK_RADIUS - gap
    if radius < 0.01:
        return None
    ball = Sphere(name="ball", radius=radius, position=point)
    return SweptBound(Clearance(load_arm("two_link"), Scene([ball])))


def verdicts(gaps: np.ndarray) -> list[bool]:
    """Whether random segments that pass a ball at a gap [m] are proved clear."""
    random = np.random.default_rng(len(gaps))
    proved = []
    while len(proved) < len(gaps):
        angles = np.cumsum(random.uniform(-1.5, 1.5, (2, 2)), axis=0)
        count = int(np.abs(angles[1] - angles[0]).max() / 1e-4)
        samples = np.linspace(*angles, count + 2)
        point = random.uniform([-2.2, -0.3, -2.2], [2.2, 0.3, 2.2])
        bound = two_link_bound(samples, point, gaps[len(proved)])
        if bound is not None:
            ends = bound.arm.configurations(angles)
            proved.append(bound.segment_is_clear(*ends))
    return proved


def test_no_colliding_segment_is_proved_clear():
    gaps = -(10.0 ** np.random.default_rng(0).uniform(-9, -1, 200))
    assert not any(verdicts(gaps))


def test_clear_segments_are_proved_clear():
    gaps = 10.0 ** np.random.default_rng(1).uniform(-4, -1, 150)
    assert np.mean(verdicts(gaps)) >= 0.99


@pytest.mark.parametrize("name", ["panda", "branching, placed"])
def test_segments_of_other_arms(name):
    bound = SweptBound(Clearance(ARMS[name](), SCENE))
    arm, random = bound.arm, np.random.default_rng(0)
    proved = 0
    for _ in range(40):
        a, b = (within_limits(arm, random.uniform(0, 1, 7)) for _ in range(2))
        b = a + 0.5 * (b - a) / np.abs(b - a).max()
        samples = arm.configurations(np.linspace(a, b, 101))
        least = min(bound.clearance.distances(q).min() for q in samples)
        if bound.segment_is_clear(samples[0], samples[-1]):
            assert least > 0.0
            proved += 1
        else:
            assert least < 1e-3
    assert 10 <= proved < 40


def test_segments_go_the_short_way_round():
    arm = load_arm("two_link")
    ball = Sphere(name="ball", radius=0.1, position=(0, 0, 1.5))  # above, where the angle is pi
    bound = SweptBound(Clearance(arm, Scene([ball])))
    q = arm.configurations(np.array([[2.5, 0.0], [-2.5, 0.0], [0.0, 0.0]]))
    assert not bound.segment_is_clear(q[0], q[1])
    assert bound.segment_is_clear(q[0], q[2])
    assert bound.segment_is_clear(q[2], q[1])


def test_subdivision_is_proved_between_its_neighbours():
    angles = np.array([[0.0, 0.5], [1.5, -0.5]])
    bound = two_link_bound(np.linspace(*angles, 10_000), np.array([1.9, 0.1, -0.9]), 0.01)
    q = bound.arm.configurations(angles)
    sizes = []
    for surplus in (1.0, 2.0):
        cuts = bound.clear_subdivision(*q, surplus)
        assert cuts[0] == 0.0
        assert cuts[-1] == 1.0
        assert (np.diff(cuts) > 0).all()
        at = bound.arm.configurations(angles[0] + cuts[:, None] * (angles[1] - angles[0]))
        slack = np.array([bound.slack(x) for x in at])
        motion = np.diff(cuts)[:, None] * bound.motion(angles[1] - angles[0])
        assert (slack[:-1] + slack[1:] > surplus * motion).all()
        sizes.append(len(cuts))
    assert sizes[1] > sizes[0] > 2
    assert bound.with_margin(0.02).clear_subdivision(*q) is None
    assert bound.with_margin(0.005).segment_is_clear(*q)
    assert bound.margin == 0.0


def test_a_segment_of_no_length():
    ball = Sphere(name="ball", radius=0.1, position=(0, 0, -1.5))
    bound = SweptBound(Clearance(load_arm("two_link"), Scene([ball])))
    clear, touching = np.array([[0.0, 1, 1, 0], [1, 0, 1, 0]])
    assert bound.segment_is_clear(clear, clear)
    assert not bound.segment_is_clear(touching, touching)


def test_no_pairs():
    bound = SweptBound(Clearance(load_arm("two_link"), Scene()))
    q = bound.arm.configurations(np.array([[0.0, 0.0], [3.0, 1.0]]))
    assert bound.segment_is_clear(*q)
    assert bound.configuration_is_clear(q[0])


@pytest.mark.parametrize("margin", [-0.01, np.nan, np.inf])
def test_wrong_margin(margin):
    clearance = Clearance(load_arm("two_link"), Scene())
    with pytest.raises(InvalidValueError, match="margin"):
        SweptBound(clearance, margin)
    with pytest.raises(InvalidValueError, match="margin"):
        SweptBound(clearance).with_margin(margin)
