"""Swept checks: what collides is never proved clear, what is clear nearly always."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Box, Capsule, Cylinder, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck, SweptResult, SweptVerdict
from densarm.world.world import DISTANCE_TOLERANCE, Pairs, World

RADIUS = 0.05  # [m], of each link of the two-link arm
ORBIT, BALL = 0.5, 0.1  # [m], circle on which the ball of `orbiting` runs, and its radius
BETWEEN = 1e-3  # [m], by which the distance between samples may be smaller than at them
SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.2, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.5, -0.3, 0.2)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.4, 0.6)),
        Cylinder(name="post", radius=0.05, length=0.6, position=(-0.3, -0.5, 0.4)),
    ]
)
Nearest = Callable[[Array, Array], Array]


class AskedWorld(World):
    """A world that keeps what distances it was asked for."""

    def __init__(self, *args: Any) -> None:
        self.asked: list[int] = []
        """How many pairs, at each configuration."""
        super().__init__(*args)

    def distances(self, q: Array, pairs: Pairs | None = None) -> Array:
        self.asked.append(self.n_pairs if pairs is None else len(pairs))
        return super().distances(q, pairs)


# Segments


def passing(arm: Arm, nearest: Nearest, angles: Array, point: Array, gap: float) -> World | None:
    """A ball whose least distance from the two-link arm at samples (N, 2) is a given gap [m]."""
    radius = nearest(angles, point).min() - RADIUS - gap
    if radius < 0.01:
        return None
    return World(arm, Scene([Sphere(name="ball", radius=radius, position=point)]))


def verdicts(arm: Arm, nearest: Nearest, gaps: Array) -> list[bool]:
    """Whether random segments that pass a ball at a gap [m] are proved clear."""
    random = np.random.default_rng(len(gaps))
    proved: list[bool] = []
    while len(proved) < len(gaps):
        angles = np.cumsum(random.uniform(-1.5, 1.5, (2, 2)), axis=0)
        count = int(np.abs(angles[1] - angles[0]).max() / 1e-3)
        samples = np.linspace(angles[0], angles[1], count + 2)
        point = random.uniform([-2.2, -0.3, -2.2], [2.2, 0.3, 2.2])
        world = passing(arm, nearest, samples, point, gaps[len(proved)])
        if world is not None:
            proved.append(SweptCheck(world).segment_is_clear(*arm.configurations(angles)))
    return proved


@pytest.mark.slow
def test_no_colliding_segment_is_proved_clear(two_link: Arm, nearest_to_links: Nearest) -> None:
    gaps = -(10.0 ** np.random.default_rng(0).uniform(-9, -1, 200))
    assert not any(verdicts(two_link, nearest_to_links, gaps))


@pytest.mark.slow
def test_clear_segments_are_proved_clear(two_link: Arm, nearest_to_links: Nearest) -> None:
    gaps = 10.0 ** np.random.default_rng(1).uniform(-4, -1, 80)
    assert np.mean(verdicts(two_link, nearest_to_links, gaps)) >= 0.99


@pytest.mark.parametrize("name", ["panda", "branching, placed", "gantry"])
def test_segments_of_other_arms(
    arm_named: Callable[[str], Arm], within_limits: Callable[[Arm, Array], Array], name: str
) -> None:
    world = World(arm_named(name), SCENE)
    arm, check, random = world.arm, SweptCheck(world), np.random.default_rng(0)
    proved = 0
    for _ in range(40):
        a, b = within_limits(arm, random.uniform(0, 1, (2, 7)))
        b = a + 0.5 * (b - a) / np.abs(b - a).max()
        samples = arm.configurations(np.linspace(a, b, 101))
        least = min(world.distances(q).min() for q in samples)
        if check.segment_is_clear(samples[0], samples[-1]):
            assert least > 0.0
            proved += 1
        else:
            assert least < 1e-3
    assert 10 <= proved < 40


def test_segments_go_the_short_way_round(two_link: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(0, 0, 1.5))  # above, where the angle is pi
    check = SweptCheck(World(two_link, Scene([ball])))
    q = two_link.configurations(np.array([[2.5, 0.0], [-2.5, 0.0], [0.0, 0.0]]))
    assert not check.segment_is_clear(q[0], q[1])
    assert check.segment_is_clear(q[0], q[2])
    assert check.segment_is_clear(q[2], q[1])


def test_subdivision_is_proved_between_its_neighbours(
    two_link: Arm, nearest_to_links: Nearest
) -> None:
    angles = np.array([[0.0, 0.5], [1.5, -0.5]])
    samples, point = np.linspace(angles[0], angles[1], 10_000), np.array([1.9, 0.1, -0.9])
    world = passing(two_link, nearest_to_links, samples, point, 0.01)
    assert world is not None
    check = SweptCheck(world)
    q_a, q_b = two_link.configurations(angles)
    sizes = []
    for surplus in (1.0, 2.0):
        cuts = check.clear_subdivision(q_a, q_b, surplus)
        assert cuts is not None
        assert cuts[0] == 0.0
        assert cuts[-1] == 1.0
        assert (np.diff(cuts) > 0).all()
        at = two_link.configurations(angles[0] + cuts[:, None] * (angles[1] - angles[0]))
        margin = np.array([check.distance_margin(x) for x in at])
        motion = np.diff(cuts)[:, None] * world.motion_bound(angles[1] - angles[0])
        assert (margin[:-1] + margin[1:] > surplus * motion).all()
        sizes.append(len(cuts))
    assert sizes[1] > sizes[0] > 2
    assert SweptCheck(world, 0.02).clear_subdivision(q_a, q_b) is None
    assert SweptCheck(world, 0.005).segment_is_clear(q_a, q_b)


def test_a_segment_of_no_length(two_link: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(0, 0, -1.5))
    check = SweptCheck(World(two_link, Scene([ball])))
    clear, touching = np.array([[0.0, 1, 1, 0], [1, 0, 1, 0]])
    assert check.segment_is_clear(clear, clear)
    assert not check.segment_is_clear(touching, touching)


@settings(max_examples=50)
@given(
    angle=st.floats(-3.0, 3.0),
    turn=st.floats(-1.5, 1.5),
    gap=st.floats(-0.05, 0.2),
    margin=st.sampled_from([0.0, 0.03]),
)
def test_clear_means_apart_everywhere_and_contact_is_where_it_is_said_to_be(
    two_link: Arm,
    nearest_to_links: Nearest,
    angle: float,
    turn: float,
    gap: float,
    margin: float,
) -> None:
    angles = np.linspace([angle, 0.3], [angle + turn, 0.3 - turn], 5000)
    point = np.array([1.2, 0.1, -1.1])
    world = passing(two_link, nearest_to_links, angles, point, gap)
    if world is None:
        return
    check, q = SweptCheck(world, margin), two_link.configurations(angles[[0, -1]])
    result = check.check(q)
    assert check.segment_is_clear(*q) == (result.verdict == SweptVerdict.CLEAR)
    if result.verdict == SweptVerdict.CLEAR:
        assert gap > margin
        assert result.distance >= gap - BETWEEN
        assert result.pairs == ()
    else:
        assert gap < margin + BETWEEN
        assert result.pairs
        assert set(result.pairs) <= set(world.pairs)


def test_proved_pairs_are_not_asked_again(two_link: Arm) -> None:
    """Far balls are proved by the ends of the segment, and only the near one inside it."""
    balls = [
        Sphere(name=name, radius=0.1, position=place)
        for name, place in (("far", (0, 3, 0)), ("near", (0.0, 0.0, -2.2)), ("off", (0, -3, 0)))
    ]
    world = AskedWorld(two_link, Scene(balls))
    q = two_link.configurations(np.array([[-0.7, 0.0], [0.7, 0.0]]))
    world.asked.clear()
    assert SweptCheck(world).segment_is_clear(*q)
    assert world.asked[:2] == [6, 6]
    assert len(world.asked) > 4
    assert set(world.asked[2:]) == {1}


def test_what_cannot_be_proved_is_given_up_early(two_link: Arm) -> None:
    """A segment that comes within a hair of a ball: no more than a depth of halvings is asked."""
    gap = 0.5 * DISTANCE_TOLERANCE
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, -2.15 - gap))
    world = AskedWorld(two_link, Scene([ball]))
    check, q = SweptCheck(world), two_link.configurations(np.array([[-0.7, 0.0], [0.9, 0.0]]))
    world.asked.clear()
    assert check.check(q).verdict != SweptVerdict.CLEAR
    assert len(world.asked) < 60


def test_no_pairs(two_link: Arm) -> None:
    check = SweptCheck(World(two_link, Scene()))
    q = two_link.configurations(np.array([[0.0, 0.0], [3.0, 1.0]]))
    assert check.segment_is_clear(*q)
    assert check.configuration_is_clear(q[0])
    assert check.least_distance_margin(q) == np.inf
    assert check.clear_subdivision(*q) == pytest.approx([0.0, 1.0])
    assert check.check(q).verdict == SweptVerdict.CLEAR


def test_distance_margins_are_what_is_left_of_the_distances(two_link: Arm) -> None:
    world = World(two_link, Scene([Sphere(name="ball", radius=0.1, position=(0, 0, -2.5))]))
    check, q = SweptCheck(world, 0.02), two_link.configuration([0.2, 0.1])
    expected = world.distances(q) - 0.02 - DISTANCE_TOLERANCE
    np.testing.assert_allclose(check.distance_margin(q), expected, rtol=1e-12)
    np.testing.assert_allclose(check.distance_margin(q, np.array([1])), expected[1:], rtol=1e-12)
    nearer = two_link.configuration([0.0, 0.0])
    both = check.least_distance_margin(np.stack([q, nearer]))
    assert both == check.least_distance_margin(nearer[np.newaxis])
    assert both == pytest.approx(0.35 - 0.02 - DISTANCE_TOLERANCE, abs=1e-8)
    assert check.configuration_is_clear(nearer)
    assert not SweptCheck(world, 0.36).configuration_is_clear(nearer)


@pytest.mark.parametrize("margin", [-0.01, np.nan, np.inf])
def test_wrong_margin(two_link: Arm, margin: float) -> None:
    with pytest.raises(InvalidValueError, match="margin"):
        SweptCheck(World(two_link, Scene()), margin)


# Sampled motions


def smooth_motion(random: np.random.Generator, count: int) -> Array:
    """Angles (count, 2) of a random motion of about 2 rad."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    start, drift, size, phase = random.uniform(-np.pi, np.pi, (4, 2))
    return np.asarray(start + 0.3 * drift * t + 0.3 * size * np.sin(4 * t + phase))


def refined(angles: Array) -> Array:
    """The polyline through samples at steps of at most 1e-3 rad."""
    count = int(np.ceil(np.abs(np.diff(angles, axis=0)).max() / 1e-3))
    return np.linspace(angles[:-1], angles[1:], count + 1, axis=1).reshape(-1, 2)


def results(arm: Arm, nearest: Nearest, gaps: Array) -> Iterator[tuple[SweptResult, Array]]:
    """Swept checks of random motions past a ball, the least distance given [m]."""
    random = np.random.default_rng(len(gaps))
    for gap in gaps:
        radius = 0.0
        while radius < 0.01:
            angles = smooth_motion(random, 200)
            point = random.uniform([-2.2, -0.3, -2.2], [2.2, 0.3, 2.2])
            if nearest(angles, point).min() > RADIUS + gap + 0.01:
                radius = nearest(refined(angles), point).min() - RADIUS - gap
        ball = Sphere(name="ball", radius=radius, position=point)
        check = SweptCheck(World(arm, Scene([ball])))
        yield check.check(arm.configurations(angles)), nearest(angles, point) - RADIUS - radius


@pytest.mark.slow
def test_no_colliding_motion_is_certified(two_link: Arm, nearest_to_links: Nearest) -> None:
    gaps = -(10.0 ** np.random.default_rng(0).uniform(-9, -1, 200))
    for result, distance in results(two_link, nearest_to_links, gaps):
        assert result.verdict != SweptVerdict.CLEAR
        assert result.pairs
        # It reports a place near contact: within a chord of the sample.
        assert distance[result.index : result.index + 2].min() < 0.05


@pytest.mark.slow
def test_clear_motions_are_certified(two_link: Arm, nearest_to_links: Nearest) -> None:
    gaps = 10.0 ** np.random.default_rng(1).uniform(-4, -1, 80)
    found = list(results(two_link, nearest_to_links, gaps))
    clear = [pair for pair in found if pair[0].verdict == SweptVerdict.CLEAR]
    assert len(clear) >= 0.99 * len(found)
    for result, distance in clear:
        assert result.pairs == ()
        # A smallest distance that was met, near the sample that it names.
        assert distance.min() - 0.05 < result.distance
        assert abs(distance[result.index] - result.distance) < 0.05


def test_arcs_of_many_samples_are_proved_at_once(two_link: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 1.5))
    check = SweptCheck(World(two_link, Scene([ball])))
    angles = np.column_stack([np.linspace(-0.5, 0.5, 5000), np.zeros(5000)])
    result = check.check(two_link.configurations(angles))
    assert result.verdict == SweptVerdict.CLEAR
    assert len(result.evaluated) < 20


@pytest.fixture(scope="module")
def orbiting(single_link: Callable[..., Arm]) -> Arm:
    """One joint that takes a ball round in a circle."""
    return single_link(f'<sphere radius="{BALL}"/>', axis="0 0 1", origin=f"{ORBIT} 0 0")


def check_at_constant_distance(arm: Arm, gap: float, margin: float = 0.0) -> SweptCheck:
    centre = Sphere(name="centre", radius=ORBIT - BALL - gap)
    return SweptCheck(World(arm, Scene([centre])), margin)


MOTION = np.linspace(0.0, 0.05, 6)[:, None]  # [rad]


@pytest.mark.parametrize(
    ("gap", "verdict"),
    [
        (1e-4, SweptVerdict.CLEAR),
        (1e-5, SweptVerdict.CLEAR),
        (DISTANCE_TOLERANCE + 1e-7, SweptVerdict.UNDECIDED),
        (0.5 * DISTANCE_TOLERANCE, SweptVerdict.CONTACT),
        (-1e-3, SweptVerdict.CONTACT),
    ],
)
@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_verdicts_near_contact(
    orbiting: Arm, gap: float, verdict: SweptVerdict, margin: float
) -> None:
    check = check_at_constant_distance(orbiting, gap + margin, margin)
    result = check.check(MOTION)
    assert result.verdict == verdict
    assert result.pairs == (() if verdict == SweptVerdict.CLEAR else (("link_0", "centre"),))


def test_the_departure_from_chords_counts(orbiting: Arm) -> None:
    check = check_at_constant_distance(orbiting, 0.01)
    enough = 0.01 / (ORBIT + BALL)  # moves the ball's far side by the distance left
    for share, verdict in ((0.0, "clear"), (0.9, "clear"), (1.1, "undecided")):
        departure = np.full((len(MOTION) - 1, 1), share * enough)
        assert check.check(MOTION, departure).verdict == verdict
    only_one = np.zeros((len(MOTION) - 1, 1))
    only_one[3] = 1.1 * enough
    result = check.check(MOTION, only_one)
    assert (result.verdict, result.index) == (SweptVerdict.UNDECIDED, 3)


@pytest.mark.slow
def test_a_curved_motion_between_clear_chords_is_caught(
    two_link: Arm, nearest_to_links: Nearest
) -> None:
    """Samples of a motion too far apart to see the contact: their chords are clear."""
    t = np.linspace(0.0, 1.0, 6)

    def motion(s: Array) -> Array:
        return np.column_stack([2.0 * s, 1.5 * s**2])

    dense = motion(np.linspace(0.0, 1.0, 20_000))
    departure = np.tile([0.0, 3.0 * (t[1] - t[0]) ** 2 / 8.0], (5, 1))
    chords = refined(motion(t))
    places = np.random.default_rng(0).uniform([-2.2, 0, -2.2], [2.2, 0, 2.2], (100, 3))
    caught = 0
    for point in places:
        true, straight = (nearest_to_links(angles, point).min() for angles in (dense, chords))
        radius = 0.5 * (true + straight) - RADIUS
        if straight - true < 1e-3 or radius < 0.01:
            continue
        ball = Sphere(name="ball", radius=radius, position=point)
        check = SweptCheck(World(two_link, Scene([ball])))
        q = two_link.configurations(motion(t))
        assert check.check(q).verdict == SweptVerdict.CLEAR
        assert check.check(q, departure).verdict != SweptVerdict.CLEAR
        caught += 1
    assert caught >= 5


@pytest.mark.parametrize("gap", [0.01, -0.01])
def test_a_single_sample(orbiting: Arm, gap: float) -> None:
    result = check_at_constant_distance(orbiting, gap).check(MOTION[:1])
    assert result.verdict == (SweptVerdict.CLEAR if gap > 0 else SweptVerdict.CONTACT)
    assert len(result.evaluated) == 1


def test_standing_still(orbiting: Arm) -> None:
    still = np.zeros((50, 1))
    assert check_at_constant_distance(orbiting, 1e-6).check(still).verdict == SweptVerdict.CLEAR
