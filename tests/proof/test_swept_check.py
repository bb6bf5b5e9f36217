"""Sampled motions: what collides is never certified, what is clear nearly always."""

import numpy as np
import pytest

from densarm.arm import Arm, load_arm
from densarm.clearance import DISTANCE_TOLERANCE, Clearance
from densarm.proof.swept_bound import SweptBound
from densarm.proof.swept_check import SweptCheck, SweptVerdict
from densarm.robot.robot_description import RobotDescription
from densarm.scene import Scene, Sphere

LENGTH, RADIUS = 1.0, 0.05  # [m], of each link of the two-link arm
ORBIT, BALL = 0.5, 0.1  # [m], circle on which the ball of `orbiting` runs, and its radius


def smooth_motion(random: np.random.Generator, count: int) -> np.ndarray:
    """Angles (count, 2) of a random motion of about 2 rad."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    start, drift, size, phase = random.uniform(-np.pi, np.pi, (4, 2))
    return start + 0.3 * drift * t + 0.3 * size * np.sin(4 * t + phase)


def nearest(angles: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Distance of a point from the centre lines of the two links (N,)."""
    start, distances = np.zeros((len(angles), 3)), []
    for absolute in np.cumsum(angles, axis=1).T:
        along = np.column_stack([np.sin(absolute), 0 * absolute, -np.cos(absolute)])
        offset = np.clip(((point - start) * along).sum(axis=1), 0.0, LENGTH)
        distances.append(np.linalg.norm(point - start - offset[:, None] * along, axis=1))
        start = start + LENGTH * along
    return np.min(distances, axis=0)


def refined(angles: np.ndarray) -> np.ndarray:
    """The polyline through samples at steps of at most 1e-4 rad."""
    count = int(np.ceil(np.abs(np.diff(angles, axis=0)).max() / 1e-4))
    return np.linspace(angles[:-1], angles[1:], count + 1, axis=1).reshape(-1, 2)


def results(gaps: np.ndarray):
    """Swept checks of random motions past a ball, the least distance given [m]."""
    random, arm = np.random.default_rng(len(gaps)), load_arm("two_link")
    for gap in gaps:
        radius = 0.0
        while radius < 0.01:
            angles = smooth_motion(random, 200)
            point = random.uniform([-2.2, -0.3, -2.2], [2.2, 0.3, 2.2])
            if nearest(angles, point).min() > RADIUS + gap + 0.01:
                radius = nearest(refined(angles), point).min() - RADIUS - gap
        ball = Sphere(name="ball", radius=radius, position=point)
        check = SweptCheck(SweptBound(Clearance(arm, Scene([ball]))))
        yield check.check(arm.configurations(angles)), nearest(angles, point) - RADIUS - radius


def test_no_colliding_motion_is_certified():
    gaps = -(10.0 ** np.random.default_rng(0).uniform(-9, -1, 200))
    for result, distance in results(gaps):
        assert result.verdict != SweptVerdict.CLEAR
        assert result.pairs
        # It reports a place near contact: within a chord of the sample.
        assert distance[result.index : result.index + 2].min() < 0.05


def test_clear_motions_are_certified():
    gaps = 10.0 ** np.random.default_rng(1).uniform(-4, -1, 150)
    found = list(results(gaps))
    clear = [pair for pair in found if pair[0].verdict == SweptVerdict.CLEAR]
    assert len(clear) >= 0.99 * len(found)
    for result, distance in clear:
        assert result.pairs == ()
        # A smallest distance that was met, near the sample that it names.
        assert distance.min() - 0.05 < result.distance
        assert abs(distance[result.index] - result.distance) < 0.05


def test_arcs_of_many_samples_are_proved_at_once():
    arm = load_arm("two_link")
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 1.5))
    check = SweptCheck(SweptBound(Clearance(arm, Scene([ball]))))
    angles = np.column_stack([np.linspace(-0.5, 0.5, 5000), np.zeros(5000)])
    result = check.check(arm.configurations(angles))
    assert result.verdict == SweptVerdict.CLEAR
    assert result.evaluations < 20


INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


@pytest.fixture(scope="module")
def orbiting() -> Arm:
    """One joint that takes a ball round in a circle."""
    urdf = f"""<robot name="orbiting"><link name="base"/><link name="link">
      {INERTIAL}<collision><origin xyz="{ORBIT} 0 0"/><geometry><sphere radius="{BALL}"/></geometry>
      </collision></link><joint name="joint" type="revolute"><parent link="base"/>
      <child link="link"/><axis xyz="0 0 1"/>
      <limit lower="-9" upper="9" effort="1" velocity="1"/></joint></robot>"""
    return Arm(RobotDescription(name="orbiting", urdf=urdf))


def check_at_constant_distance(arm: Arm, gap: float, margin: float = 0.0) -> SweptCheck:
    centre = Sphere(name="centre", radius=ORBIT - BALL - gap)
    return SweptCheck(SweptBound(Clearance(arm, Scene([centre])), margin))


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
def test_verdicts_near_contact(orbiting, gap, verdict, margin):
    check = check_at_constant_distance(orbiting, gap + margin, margin)
    result = check.check(MOTION)
    assert result.verdict == verdict
    assert result.pairs == (() if verdict == SweptVerdict.CLEAR else (("link_0", "centre"),))


def test_the_departure_from_chords_counts(orbiting):
    check = check_at_constant_distance(orbiting, 0.01)
    enough = 0.01 / (ORBIT + BALL)  # moves the ball's far side by the distance left
    for share, verdict in ((0.0, "clear"), (0.9, "clear"), (1.1, "undecided")):
        departure = np.full((len(MOTION) - 1, 1), share * enough)
        assert check.check(MOTION, departure).verdict == verdict
    only_one = np.zeros((len(MOTION) - 1, 1))
    only_one[3] = 1.1 * enough
    result = check.check(MOTION, only_one)
    assert (result.verdict, result.index) == (SweptVerdict.UNDECIDED, 3)


def test_a_curved_motion_between_clear_chords_is_caught():
    """Samples of a motion too far apart to see the contact: their chords are clear."""
    arm = load_arm("two_link")
    t = np.linspace(0.0, 1.0, 6)

    def motion(s):
        return np.column_stack([2.0 * s, 1.5 * s**2])

    dense = motion(np.linspace(0.0, 1.0, 20_000))
    departure = np.tile([0.0, 3.0 * (t[1] - t[0]) ** 2 / 8.0], (5, 1))
    chords = refined(motion(t))
    places = np.random.default_rng(0).uniform([-2.2, 0, -2.2], [2.2, 0, 2.2], (100, 3))
    caught = 0
    for point in places:
        true, straight = nearest(dense, point).min(), nearest(chords, point).min()
        radius = 0.5 * (true + straight) - RADIUS
        if straight - true < 1e-3 or radius < 0.01:
            continue
        ball = Sphere(name="ball", radius=radius, position=point)
        check = SweptCheck(SweptBound(Clearance(arm, Scene([ball]))))
        q = arm.configurations(motion(t))
        assert check.check(q).verdict == SweptVerdict.CLEAR
        assert check.check(q, departure).verdict != SweptVerdict.CLEAR
        caught += 1
    assert caught >= 5


@pytest.mark.parametrize("gap", [0.01, -0.01])
def test_a_single_sample(orbiting, gap):
    result = check_at_constant_distance(orbiting, gap).check(MOTION[:1])
    assert result.verdict == (SweptVerdict.CLEAR if gap > 0 else SweptVerdict.CONTACT)
    assert result.evaluations == 1


def test_standing_still(orbiting):
    still = np.zeros((50, 1))
    assert check_at_constant_distance(orbiting, 1e-6).check(still).verdict == SweptVerdict.CLEAR


def test_no_pairs(orbiting):
    check = SweptCheck(SweptBound(Clearance(orbiting, Scene())))
    assert check.check(MOTION).verdict == SweptVerdict.CLEAR
