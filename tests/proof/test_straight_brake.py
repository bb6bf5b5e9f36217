"""The straight brake: inside the limits all along, on a line, no longer than it must be."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arm import Arm, load_arm
from densarm.proof.straight_brake import HELD_SHARE, StraightBrake

BETWEEN = 1.05  # by which torques may exceed their limits between the instants that are checked


def weak_arm():
    """A two-link arm that can hold itself everywhere, and little more."""
    description = load_arm("two_link").description
    urdf = description.urdf.replace('effort="60"', 'effort="24"').replace(
        'effort="30"', 'effort="6.5"'
    )
    return Arm(replace(description, urdf=urdf))


ARMS = {"panda": lambda: load_arm("panda"), "weak": weak_arm}


@pytest.fixture(scope="module", params=ARMS)
def arm(request):
    return ARMS[request.param]()


def torques(arm, q, v, duration, shares):
    angles = arm.angles(q)
    for x in shares:
        ahead = arm.configuration(angles + (x - 0.5 * x**2) * duration * v)
        yield pin.rnea(arm.model, arm.data, ahead, (1.0 - x) * v, -v / duration)


@given(
    angles=arrays(float, 7, elements=st.floats(-1.5, 1.5)),
    v=arrays(float, 7, elements=st.floats(-3.0, 3.0)),
)
def test_limits_hold_all_along(arm, angles, v):
    q, v = arm.configuration(angles[: arm.nv]), v[: arm.nv]
    duration = StraightBrake(arm).duration(q, v)
    if not np.isfinite(duration) or not v.any():
        return
    held = HELD_SHARE * arm.limits.acceleration * (1 + 1e-9)
    assert (np.abs(v) <= held * duration).all()
    checked = np.array(list(torques(arm, q, v, duration, np.linspace(0, 1, 5))))
    assert (np.abs(checked) <= arm.limits.effort * (1 + 1e-6)).all()
    if duration < 0.3:  # five instants say little of a long brake
        every = np.array(list(torques(arm, q, v, duration, np.linspace(0, 1, 41))))
        assert (np.abs(every) <= BETWEEN * arm.limits.effort).all()


def test_torque_limits_lengthen_the_brake():
    strong, weak = load_arm("two_link"), weak_arm()
    q, v = strong.configuration([1.5, 0.0]), np.array([-2.0, 0.5])
    fast, slow = (StraightBrake(arm).duration(q, v) for arm in (strong, weak))
    assert fast == pytest.approx((np.abs(v) / (HELD_SHARE * strong.limits.acceleration)).max())
    assert slow > 1.5 * fast
    # Hardly shorter, and a torque exceeds its limit.
    shorter = np.array(list(torques(weak, q, v, 0.97 * slow, np.linspace(0, 1, 5))))
    assert (np.abs(shorter) > weak.limits.effort).any()


def test_none_where_the_arm_cannot_hold_itself():
    description = load_arm("two_link").description
    arm = Arm(replace(description, urdf=description.urdf.replace('effort="60"', 'effort="5"')))
    v = np.array([0.1, 0.0])
    assert StraightBrake(arm).duration(arm.configuration([1.5, 0.0]), v) == np.inf
    assert np.isfinite(StraightBrake(arm).duration(arm.configuration([0.0, 0.0]), v))


def test_many_states_at_once_are_each_their_own(arm):
    rng = np.random.default_rng(0)
    q = arm.configurations(rng.uniform(-1, 1, (20, arm.nv)))
    v = rng.uniform(-3, 3, (20, arm.nv))
    v[3] = 0.0
    brake = StraightBrake(arm)
    durations = brake.durations(q, v)
    assert durations[3] == 0.0
    np.testing.assert_array_equal(
        durations, [brake.duration(*state) for state in zip(q, v, strict=True)]
    )


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_no_brake_from_what_is_no_state(arm, value):
    v = np.full(arm.nv, value)
    assert not np.isfinite(StraightBrake(arm).duration(arm.configuration(np.zeros(arm.nv)), v))
