"""The speed law: the brake ends before the goal and before clearance can be used up."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arm import Arm, load_arm
from densarm.clearance import Clearance
from densarm.density.distance_bounds import ExactDistances
from densarm.errors import InvalidValueError
from densarm.fields import SpeedLaw, SpeedParameters
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Scene, Sphere

MARGIN = 0.01  # [m]
NV, PAIRS = 7, 3
POST = Sphere(name="post", radius=0.1, position=[0.6, 0.0, 0.4])
READY = load_arm("panda").postures["ready"]

directions = arrays(float, NV, elements=st.floats(-1, 1)).filter(lambda u: np.linalg.norm(u) > 0.1)
velocities = arrays(float, NV, elements=st.floats(-3, 3))
lengths = st.floats(0.0, 10.0)


@pytest.fixture(scope="module")
def bound():
    arm = load_arm("panda")
    return SweptBound(Clearance(arm, Scene([POST])), MARGIN)


@pytest.fixture(scope="module")
def law(bound):
    return SpeedLaw(bound, SpeedParameters(braking_share=1.0))


def distances(bound, fill):
    """Distances of all pairs, one of them small."""
    distance = np.full(bound.clearance.n_pairs, 0.5)
    distance[int(fill * 1e6) % len(distance)] = fill
    return distance


def brake(bound, v):
    """Summed joint motion |Δq| of the straight brake at the acceleration limits."""
    slowest = (np.abs(v) / bound.arm.limits.acceleration).max()
    return np.abs(v) * slowest / 2.0


@given(u=directions, near=st.floats(-0.05, 0.3), way=lengths)
def test_brake_at_full_speed_ends_in_the_free_space_and_before_the_goal(bound, law, u, near, way):
    u, distance = u / np.linalg.norm(u), distances(bound, near)
    v = law.speed(READY, u, ExactDistances(distance), way) * u
    assert (np.abs(v) <= bound.arm.limits.velocity * (1 + 1e-12)).all()
    used = bound.motion(brake(bound, v))
    assert (used <= np.maximum(distance - MARGIN, 0.0) * (1 + 1e-9) + 1e-15).all()
    assert np.linalg.norm(brake(bound, v)) <= way * (1 + 1e-9) + 1e-15


@given(u=directions, near=st.floats(-0.05, 0.3), more=st.floats(0, 0.2), way=lengths)
def test_speed_grows_with_room_and_way(bound, law, u, near, more, way):
    u, distance = u / np.linalg.norm(u), distances(bound, near)
    speed = law.speed(READY, u, ExactDistances(distance), way)
    assert law.speed(READY, u, ExactDistances(distance + more), way) >= 0.99 * speed
    assert law.speed(READY, u, ExactDistances(distance), way + more) >= 0.99 * speed
    careful = SpeedLaw(bound, SpeedParameters(braking_share=0.3))
    assert careful.speed(READY, u, ExactDistances(distance), way) <= 1.01 * speed


def test_a_weak_arm_goes_slower():
    strong = load_arm("two_link")
    urdf = strong.description.urdf.replace('effort="60"', 'effort="22"')
    weak = Arm(replace(strong.description, urdf=urdf))
    level, down = strong.configuration([1.5, 0.0]), np.array([-1.0, 0.0])
    speeds = [
        SpeedLaw(SweptBound(Clearance(arm, Scene())), SpeedParameters()).speed(
            level, down, ExactDistances(np.zeros(0)), 1.0
        )
        for arm in (strong, weak)
    ]
    assert 0.0 < speeds[1] < 0.8 * speeds[0]


@given(v=velocities, near=st.floats(-0.05, 0.3), moved=st.floats(0, 0.01))
def test_can_stop_exactly_where_the_brake_stays_in_the_free_space(bound, law, v, near, moved):
    distance, motion = distances(bound, near), np.full(NV, moved)
    duration = StraightBrake(bound.arm).duration(READY, v)
    used = bound.motion(motion + 0.5 * duration * np.abs(v))
    end, limits = bound.arm.angles(READY) + 0.5 * duration * v, bound.arm.limits
    inside = ((end <= limits.upper) & (end >= limits.lower)).all()
    room = distance - MARGIN
    free = ((used < room * (1 - 1e-9)) | (used == 0.0)).all()
    touches = ((used > room * (1 + 1e-9)) & (used > 0.0)).any()
    if inside and free:
        assert law.can_stop(READY, v, ExactDistances(distance), motion)
    if not inside or touches:
        assert not law.can_stop(READY, v, ExactDistances(distance), motion)


def test_no_speed_without_room_and_no_bound_without_pairs(bound, law):
    u = np.eye(NV)[0]
    assert law.speed(READY, u, ExactDistances(distances(bound, 0.0)), 1.0) == 0.0
    arm = load_arm("two_link")
    empty = SpeedLaw(SweptBound(Clearance(arm, Scene())), SpeedParameters())
    u, none = np.array([1.0, 0.0]), ExactDistances(np.zeros(0))
    assert empty.speed(arm.postures["hanging"], u, none, 1e9) == 6.0


@pytest.mark.parametrize("share", [0.0, -0.1, 1.1, np.nan])
def test_share_is_checked(share):
    with pytest.raises(InvalidValueError, match=r"^braking_share = "):
        SpeedParameters(braking_share=share)


def test_velocity_share(bound):
    far, all_the_way = ExactDistances(np.full(bound.clearance.n_pairs, 1e9)), 1e9
    direction = np.full(NV, NV**-0.5)
    full, half = (SpeedLaw(bound, SpeedParameters(velocity_share=share)) for share in (1.0, 0.5))
    assert half.speed(READY, direction, far, all_the_way) == pytest.approx(
        0.5 * full.speed(READY, direction, far, all_the_way)
    )
