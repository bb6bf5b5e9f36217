"""Timing: rest to rest, within every limit's share, or an error that says why not."""

import re
from functools import cache, partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.arms.catalogue import robot_names
from densarm.arms.description import RobotDescription
from densarm.arms.dynamics import JointTorques
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion, PlanningError, TimingParameters
from densarm.planning.smoothing import SmoothPath, smooth_path
from densarm.planning.timing import time_path
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from densarm.world.world import World

GANTRY = Path(__file__).parents[1] / "data" / "gantry.urdf"
PERIOD = 0.001  # [s]
EXCESS = 1.02  # limits hold at grid points; between them the excess is this small

Timed = tuple[Arm, SmoothPath, Motion]
Bend = tuple[Arm, SmoothPath, StoppingCheck]


def free_path(arm: Arm, corners: list[list[float]]) -> SmoothPath:
    path = smooth_path(World(arm, Scene()), 0.0, arm.configurations(np.array(corners)))
    assert path is not None
    return path


@pytest.fixture(scope="module", params=["two_link", "panda"])
def timed(request: pytest.FixtureRequest) -> Timed:
    arm = load_arm(request.param)
    corners = {
        "two_link": [[0.0, 0.0], [1.5, -1.0], [3.1, 0.0]],
        "panda": [[0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8], [1.0, 0.2, 0.3, -1.5, 0.4, 2.0, 0.0]],
    }[request.param]
    path = free_path(arm, corners)
    return arm, path, time_path(arm, path, 3.0, PERIOD, TimingParameters())


def test_from_rest_to_rest_along_the_path(timed: Timed) -> None:
    _, path, motion = timed
    np.testing.assert_allclose(motion.position[[0, -1]], path(np.array([0, 1])), atol=1e-12)
    np.testing.assert_array_equal(motion.velocity[[0, -1]], 0.0)
    dense = path(np.linspace(0.0, 1.0, 5001))
    for position in motion.position[::50]:
        assert np.linalg.norm(dense - position, axis=1).min() < 1e-3


def test_velocity_is_the_slope_of_position(timed: Timed) -> None:
    _, _, motion = timed
    slope = np.diff(motion.position, axis=0) / PERIOD
    mean = 0.5 * (motion.velocity[1:] + motion.velocity[:-1])
    np.testing.assert_allclose(slope, mean, atol=2e-3)


def test_limits_hold_at_every_sample(timed: Timed) -> None:
    arm, _, motion = timed
    shares, limits = TimingParameters(), arm.limits
    peak = np.zeros(3)
    for k in range(len(motion.position)):
        theta, v, a = motion.sample((k + 0.5) * PERIOD)
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


def test_an_arm_too_weak_to_hold_itself(timed: Timed) -> None:
    arm, path, _ = timed
    message = r"torque limits allow no motion .* joint '.*' needs .* and has "
    with pytest.raises(PlanningError, match=message) as raised:
        time_path(arm, path, 3.0, PERIOD, TimingParameters(torque_share=0.01))
    assert raised.value.outcome == Outcome.INFEASIBLE


def test_what_is_unlimited_may_be_heavy() -> None:
    """A slide that lifts five tons takes 49 kN, which the solver has no number for."""
    text = re.sub('effort="[0-9]*"', 'effort="0"', GANTRY.read_text())
    text = text.replace('<mass value="2"/>', '<mass value="5000"/>')
    arm = Arm(RobotDescription(name="crane", urdf=text))
    path = free_path(arm, [[0.0, 0.0, 0.1], [0.5, 0.2, 0.4]])
    motion = time_path(arm, path, 0.7, PERIOD, TimingParameters())
    peak = np.abs(np.diff(motion.velocity, axis=0)).max() / PERIOD / arm.limits.acceleration[0]
    assert 0.8 < peak <= TimingParameters().acceleration_share


def test_a_motion_where_topp_ra_fails(timed: Timed, monkeypatch: pytest.MonkeyPatch) -> None:
    arm, path, best = timed
    failed = lambda *_: (None, None, None)  # noqa: E731
    monkeypatch.setattr("toppra.algorithm.TOPPRA.compute_parameterization", failed)
    slower = time_path(arm, path, 3.0, PERIOD, TimingParameters())
    assert 0.9 * best.duration < slower.duration < 2.5 * best.duration
    with pytest.raises(PlanningError, match="torque limits allow no motion"):
        time_path(arm, path, 3.0, PERIOD, TimingParameters(torque_share=0.01))


known_arm = cache(partial(load_arm, shapes="capsule"))


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    name=st.sampled_from(robot_names()),
    exponent=st.floats(-7.0, -1.0),
    direction=st.lists(st.sampled_from([-1.0, -0.3, 0.0, 0.0, 1.0]), min_size=9, max_size=9),
)
def test_the_shortest_ways_are_timed_within_the_limits(
    name: str, exponent: float, direction: list[float]
) -> None:
    arm = known_arm(name)
    middle = arm.angles(arm.postures["ready"])
    step = 10.0**exponent * (np.array(direction[: arm.nv]) + np.eye(arm.nv)[0] * 0.1)
    path = SmoothPath(
        np.repeat([0.0, 1.0], 4), middle + np.linspace(0.0, 1.0, 4)[:, np.newaxis] * step
    )
    motion = time_path(arm, path, float(np.linalg.norm(step)), PERIOD, TimingParameters())
    np.testing.assert_allclose(motion.position[[0, -1]], [middle, middle + step], atol=1e-15)
    acceleration = np.abs(np.diff(motion.velocity, axis=0)).max(axis=0) / PERIOD
    assert (acceleration <= arm.limits.acceleration).all()
    assert (np.abs(motion.velocity) <= arm.limits.velocity).all()
    least = 2.0 * np.sqrt(np.abs(step) / arm.limits.acceleration).max()
    smooth = np.cbrt(32.0 * np.abs(step) / arm.limits.jerk).max()
    if np.isinf(arm.limits.torque_rate).all():
        assert motion.duration <= 3.0 * max(least, smooth) + 3.0 * PERIOD


def rates_used(arm: Arm, motion: Motion, lead: float) -> tuple[Array, Array]:
    """Return the largest jerk and torque rate, but for gravity's, from sample to sample (nv,)."""
    before = [motion.sample(-1.0)]
    after = [motion.sample(motion.duration + 1.0)]
    times = motion.samples(motion.period).time[:-1]
    samples = before + [motion.sample(t, lead) for t in times] + after
    q, v, a = np.stack(samples, axis=1)
    torques, q = JointTorques(arm), arm.configurations(q)
    torque = torques(q, v, a) - torques(q, 0.0 * v, 0.0 * a)
    jerk, rate = (np.abs(np.diff(rows, axis=0)).max(axis=0) for rows in (a, torque))
    return jerk / motion.period, rate / motion.period


def require_rates(arm: Arm, motion: Motion, parameters: TimingParameters) -> None:
    for lead in (0.0, 0.5 * motion.period):
        jerk, rate = rates_used(arm, motion, lead)
        assert (jerk <= 1.001 * np.minimum(arm.limits.jerk, parameters.jerk or np.inf)).all()
        assert (rate <= 1.005 * parameters.torque_rate_share * arm.limits.torque_rate).all()


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    spread=st.floats(0.05, 1.5),
    corners=st.integers(2, 6),
    jerk=st.sampled_from([None, 500.0, 50.0]),
    period=st.sampled_from([0.001, 0.004]),
)
def test_jerk_and_torque_rate_hold_on_any_path(
    seed: int, spread: float, corners: int, jerk: float | None, period: float
) -> None:
    arm, rng = known_arm("panda"), np.random.default_rng(seed)
    steps = spread * rng.uniform(-1.0, 1.0, (corners, arm.nv))
    control = arm.angles(arm.postures["ready"]) + np.repeat(steps, rng.integers(2, 4), axis=0)
    knots = np.pad(np.linspace(0.0, 1.0, len(control) - 2), 3, mode="edge")
    path, shares = SmoothPath(knots, control), TimingParameters(jerk=jerk)
    length = float(np.linalg.norm(np.diff(control, axis=0), axis=1).sum())
    motion = time_path(arm, path, length, period, shares)
    require_rates(arm, motion, shares)
    limits, v = arm.limits, motion.velocity
    a = np.diff(v, axis=0) / period
    tau = JointTorques(arm)(motion.position[:-1], v[:-1], a)
    assert (np.abs(v) <= shares.velocity_share * limits.velocity).all()
    assert (np.abs(a) <= shares.acceleration_share * limits.acceleration).all()
    assert (np.abs(tau) <= shares.torque_share * limits.effort).all()
    np.testing.assert_array_equal(v[[0, -1]], 0.0)
    np.testing.assert_allclose(motion.position[[0, -1]], control[[0, -1]], atol=1e-12)
    dense = path(np.linspace(0.0, 1.0, 20001))
    off = [np.linalg.norm(dense - row, axis=1).min() for row in motion.position[::37]]
    assert max(off) <= np.linalg.norm(np.diff(dense, axis=0), axis=1).max()


def test_rates_cost_little_time(timed: Timed) -> None:
    arm, path, motion = timed
    free = time_path(arm, path, 3.0, PERIOD, TimingParameters(), has_rates=False)
    assert free.duration <= motion.duration <= 1.06 * free.duration
    if arm.name == "panda":
        require_rates(arm, motion, TimingParameters())
        assert rates_used(arm, free, 0.0)[1].max() > 3.0 * arm.limits.torque_rate[0]


def test_without_limits_of_rates_nothing_changes() -> None:
    arm = load_arm("panda", torque_rate=np.inf, jerk=np.inf, shapes="capsule")
    path = free_path(arm, [[0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8], [1.0, 0.2, 0.3, -1.5, 0.4, 2, 0]])
    motion = time_path(arm, path, 3.0, PERIOD, TimingParameters())
    free = time_path(known_arm("panda"), path, 3.0, PERIOD, TimingParameters(), has_rates=False)
    np.testing.assert_array_equal(motion.knots, free.knots)


def test_rates_of_one_joint_alone() -> None:
    arm = load_arm("two_link", torque_rate=[200.0, 1e9])
    path = free_path(arm, [[0.0, 0.0], [1.5, -1.0], [3.1, 0.0]])
    motion = time_path(arm, path, 3.0, PERIOD, TimingParameters())
    require_rates(arm, motion, TimingParameters())
    assert rates_used(arm, motion, 0.0)[1][0] > 0.7 * 200.0


def test_a_jerk_that_takes_forever_is_refused(timed: Timed) -> None:
    arm, path, _ = timed
    with pytest.raises(PlanningError, match=r"more than 1000000 periods .* raise the limits of"):
        time_path(arm, path, 3.0, PERIOD, TimingParameters(jerk=1e-9))
    slow = TimingParameters(jerk=20.0)
    require_rates(arm, time_path(arm, path, 3.0, PERIOD, slow), slow)


@pytest.mark.parametrize(
    ("scale", "limit", "message"),
    [
        (1e-6, 60.0, r"takes .*e\+05 s, more than time_limit = 60 s: .* joint '.*', which alone"),
        (1e-6, np.inf, "more than 1000000 periods of 0.001 s"),
        (1.0, 0.5, "more than time_limit = 0.5 s"),
    ],
)
def test_a_motion_too_long_is_refused_before_it_is_made(
    timed: Timed, scale: float, limit: float, message: str
) -> None:
    arm, path, _ = timed
    slow = TimingParameters(velocity_share=scale)
    with pytest.raises(PlanningError, match=message) as raised:
        time_path(arm, path, 3.0, PERIOD, slow, time_limit=limit)
    assert raised.value.outcome == Outcome.TIMED_OUT


@pytest.fixture(scope="module")
def bend() -> Bend:
    """A path around a bend, and a ball that it misses but stopping from a fast motion does not."""
    arm = load_arm("two_link", jerk=np.inf)
    ball = Scene([Sphere(name="ball", radius=0.1, position=(1.487, 0.0, 1.337))])
    path = free_path(arm, [[0.0, 0.0], [2.4, 0.0], [2.4, -2.4]])
    return arm, path, StoppingCheck(World(arm, ball), StoppingTrajectory(arm))


def test_slows_down_where_it_could_not_stop_and_only_there(bend: Bend) -> None:
    arm, path, stopping = bend
    fast, safe = (
        time_path(arm, path, 4.8, PERIOD, TimingParameters(), check) for check in (None, stopping)
    )

    def failing(motion: Motion) -> int:
        return stopping.check(arm.configurations(motion.position), motion.velocity).failing.size

    assert failing(fast) > 0
    assert failing(safe) == 0
    assert fast.duration < safe.duration < 1.3 * fast.duration
    np.testing.assert_allclose(safe.velocity[:300], fast.velocity[:300], atol=0.05)


def test_slow_enough_to_stop_and_smooth(bend: Bend) -> None:
    arm, path, stopping = bend
    smooth = TimingParameters(jerk=300.0)
    motion = time_path(arm, path, 4.8, PERIOD, smooth, stopping)
    require_rates(arm, motion, smooth)
    q = arm.configurations(motion.position)
    assert stopping.check(q[::4], motion.velocity[::4]).failing.size == 0


def test_no_speed_to_stop_from_where_the_path_touches(bend: Bend) -> None:
    arm, path, _ = bend
    tip = Scene([Sphere(name="ball", radius=0.1, position=(2.0, 0.0, 0.0))])
    stopping = StoppingCheck(World(arm, tip), StoppingTrajectory(arm))
    with pytest.raises(PlanningError, match=r"could stop .* at joint positions \(\d") as raised:
        time_path(arm, path, 4.8, PERIOD, TimingParameters(), stopping)
    assert raised.value.outcome == Outcome.INFEASIBLE


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_jerk_is_checked(value: float) -> None:
    with pytest.raises(InvalidValueError, match=r"^jerk = .*: must be a finite number > 0"):
        TimingParameters(jerk=value)


@pytest.mark.parametrize(
    "key", ["velocity_share", "acceleration_share", "torque_share", "torque_rate_share"]
)
@pytest.mark.parametrize("value", [0.0, 1.1, np.nan])
def test_shares_are_checked(key: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        TimingParameters(**{key: value})


def test_a_motion_towards_a_position_limit_keeps_the_velocity_limits_as_they_fall() -> None:
    arm = load_arm("fr3")
    start = [0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8]
    path = free_path(arm, [start, [2.6, 1.6, -2.8, -0.3, 2.7, 4.3, -2.9]])
    motion = time_path(arm, path, 8.0, PERIOD, TimingParameters())
    fastest = arm.limits.fastest(motion.position, motion.velocity)
    assert (np.abs(motion.velocity) <= 0.95 * fastest * 1.001).all()
    assert (fastest < arm.limits.velocity).any()
