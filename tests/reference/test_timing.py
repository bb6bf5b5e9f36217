"""Timing: rest to rest, within every limit's share, or an error that says why not."""

import numpy as np
import pinocchio as pin
import pytest

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.errors import InvalidValueError
from densarm.proof.stopping_check import StoppingCheck
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound
from densarm.reference import InfeasibleTimingError, TimingParameters
from densarm.reference.smooth_path import smooth_path
from densarm.reference.timing import time_path
from densarm.scene import Scene, Sphere

PERIOD = 0.001  # [s]
EXCESS = 1.02  # limits hold at grid points; between them the excess is this small


@pytest.fixture(scope="module", params=["two_link", "panda"])
def timed(request):
    arm = load_arm(request.param)
    bound = SweptBound(Clearance(arm, Scene()))
    corners = {
        "two_link": [[0.0, 0.0], [1.5, -1.0], [3.1, 0.0]],
        "panda": [[0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8], [1.0, 0.2, 0.3, -1.5, 0.4, 2.0, 0.0]],
    }[request.param]
    path = smooth_path(bound, np.stack([arm.configuration(corner) for corner in corners]))
    return arm, path, time_path(arm, path, 3.0, PERIOD, TimingParameters())


def test_from_rest_to_rest_along_the_path(timed):
    _, path, reference = timed
    np.testing.assert_allclose(reference.position[[0, -1]], path(np.array([0, 1])), atol=1e-12)
    np.testing.assert_array_equal(reference.velocity[[0, -1]], 0.0)
    dense = path(np.linspace(0.0, 1.0, 5001))
    for position in reference.position[::50]:
        assert np.linalg.norm(dense - position, axis=1).min() < 1e-3


def test_velocity_is_the_slope_of_position(timed):
    _, _, reference = timed
    slope = np.diff(reference.position, axis=0) / PERIOD
    mean = 0.5 * (reference.velocity[1:] + reference.velocity[:-1])
    np.testing.assert_allclose(slope, mean, atol=2e-3)


def test_limits_hold_at_every_sample(timed):
    arm, _, reference = timed
    shares, limits = TimingParameters(), arm.limits
    peak = np.zeros(3)
    for k in range(len(reference.position)):
        theta, v, a = reference.sample((k + 0.5) * PERIOD)
        tau = pin.rnea(arm.model, arm.data, arm.configuration(theta), v, a)
        ratios = (
            np.abs(v) / limits.velocity,
            np.abs(a) / limits.acceleration,
            abs(tau) / limits.effort,
        )
        peak = np.maximum(peak, [ratio.max() for ratio in ratios])
    allowed = [shares.velocity_share, shares.acceleration_share, shares.torque_share]
    assert (peak <= EXCESS * np.array(allowed)).all()
    assert (peak / allowed).max() > 0.95  # no slower than it must be


def test_an_arm_too_weak_to_hold_itself(timed):
    arm, path, _ = timed
    message = r"torque limits allow no motion .* joint '.*' needs .* and has "
    with pytest.raises(InfeasibleTimingError, match=message):
        time_path(arm, path, 3.0, PERIOD, TimingParameters(torque_share=0.01))


@pytest.fixture(scope="module")
def bend():
    """A path around a bend, and a ball that it misses but the brakes of a fast motion do not."""
    arm = load_arm("two_link")
    corners = np.stack([arm.configuration(c) for c in ([0.0, 0.0], [2.4, 0.0], [2.4, -2.4])])
    ball = Scene([Sphere(name="ball", radius=0.1, position=[1.487, 0.0, 1.337])])
    bound = SweptBound(Clearance(arm, ball))
    path = smooth_path(SweptBound(Clearance(arm, Scene())), corners)
    return arm, path, StoppingCheck(bound, StraightBrake(arm))


def test_slows_down_where_it_could_not_stop_and_only_there(bend):
    arm, path, stopping = bend
    fast, safe = (
        time_path(arm, path, 4.8, PERIOD, TimingParameters(), check) for check in (None, stopping)
    )

    def failing(reference):
        q = arm.configurations(reference.position)
        return stopping.check(q, reference.velocity).failing

    assert failing(fast).size > 0
    assert failing(safe).size == 0
    assert fast.duration < safe.duration < 1.3 * fast.duration
    np.testing.assert_allclose(safe.velocity[:300], fast.velocity[:300], atol=0.05)


def test_no_speed_to_stop_from_where_the_path_touches(bend):
    arm, path, _ = bend
    tip = Scene([Sphere(name="ball", radius=0.1, position=[2.0, 0.0, 0.0])])
    stopping = StoppingCheck(SweptBound(Clearance(arm, tip)), StraightBrake(arm))
    with pytest.raises(InfeasibleTimingError, match=r"could stop .* at joint positions \(\d"):
        time_path(arm, path, 4.8, PERIOD, TimingParameters(), stopping)


@pytest.mark.parametrize("key", ["velocity_share", "acceleration_share", "torque_share"])
@pytest.mark.parametrize("value", [0.0, 1.1, np.nan])
def test_shares_are_checked(key, value):
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        TimingParameters(**{key: value})
