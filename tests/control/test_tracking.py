"""DensityTracking: its one kernel is the law of its parts, whichever pairs are queried."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.control.controller import Gains
from densarm.control.disturbance_observer import ActuationParameters
from densarm.control.inverse_dynamics import TRUSTED
from densarm.control.tracking import TRACKING_GAINS, DensityTracking
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import DensityParameters, Gauge, NavigationDensity
from densarm.density.unsafe_sets import (
    ClearanceSet,
    ImplicitSet,
    JointLimitSet,
    SensingParameters,
    UnsafeSet,
)
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.planning.plan import plan_motion
from densarm.scenarios.scenario import Scenario
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

State = tuple[float, Array, Array]
GAINS = Gains()


def states(arm: Arm, motion: Motion, off: float = 0.03, every: int = 1) -> Iterator[State]:
    """Times and states near the motion, near enough to obstacles that they are sensed."""
    random = np.random.default_rng(0)
    for k in range(0, len(motion.position), every):
        shift = off * random.normal(size=(2, arm.nv))
        q = arm.configuration(motion.position[k] + shift[0])
        yield k * motion.period, q, motion.velocity[k] + shift[1]


def anew(controller: DensityTracking, t: float, q: Array, v: Array) -> Array:
    """The torque at a state before which none is known, since time ran back."""
    controller.torque(t + 1.0, q, v)
    return controller.torque(t, q, v)


def tracked_density(world: World, motion: Motion) -> NavigationDensity:
    """The density that senses nothing on the motion, by the words of `DensityTracking`."""
    arm, sensing = world.arm, SensingParameters()
    on_the_way = arm.configurations(motion.position[::2])
    check = SweptCheck(world, motion.margin)
    least = np.min([check.distance_margin(q) for q in on_the_way], axis=0)
    angles, limits = arm.angles(on_the_way), arm.limits
    inside = np.minimum(angles - limits.lower, limits.upper - angles).min(axis=0)
    share = sensing.path_share
    unsafe: list[UnsafeSet] = [
        ClearanceSet(world, motion.margin, np.minimum(share * least, sensing.distance)),
        JointLimitSet(arm, np.minimum(share * inside, sensing.joint)),
    ]
    return NavigationDensity(arm, on_the_way[0], unsafe, TorusDistance(arm))


@pytest.mark.parametrize("actuation", [TRUSTED, ActuationParameters()], ids=["M", "M + D"])
def test_torque_is_that_of_its_parts(
    panda: Arm, panda_swing: Motion, among_spheres: World, actuation: ActuationParameters
) -> None:
    controller = DensityTracking(among_spheres, panda_swing, gains=GAINS, actuation=actuation)
    density, limits = tracked_density(among_spheres, panda_swing), panda.limits
    sensed = 0
    for t, q, v in states(panda, panda_swing):
        point = panda_swing.sample(t, lead=0.5 * panda_swing.period)
        density.set_goal(panda.configuration(point.position))
        pull = GAINS.position * density.evaluate(q).gradient(Gauge.RECIPROCAL)
        fastest = 0.25 * GAINS.velocity * limits.velocity
        feedback = np.clip(pull, -fastest, fastest) - GAINS.velocity * (v - point.velocity)
        mass = panda.mass_matrix(q)
        # D is less where a period is so long that K_v would make it unstable.
        lag = GAINS.velocity * panda_swing.period
        alone = 1.0 / np.linalg.inv(mass).diagonal()
        floor = np.minimum(actuation.inertia_floor, (0.6 / lag - 1.0) * alone)
        expected = mass @ (point.acceleration + feedback) + floor * feedback
        expected = np.clip(expected + panda.nonlinear_effects(q, v), -limits.effort, limits.effort)
        np.testing.assert_allclose(anew(controller, t, q, v), expected, rtol=1e-12, atol=1e-11)
        error = np.abs(panda.difference(density.goal, q)).max()
        assert controller.tracking_error == pytest.approx(error, rel=1e-9)
        sensed += density.log_psi < 0.0
    assert sensed > 10


def test_the_formula_of_the_architecture_is_the_one_that_runs(
    swing_up: Scenario, swing_up_motion: Motion
) -> None:
    page = (Path(__file__).parents[2] / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert "τ = H + M (q̈_d + K_p ∇(−1/ρ) − K_v ė)" in page
    arm, motion = load_arm("two_link", torque_rate=np.inf), swing_up_motion
    world = World(arm, swing_up.scene)
    controller = DensityTracking(world, motion, gains=GAINS, actuation=TRUSTED)
    density = tracked_density(world, motion)
    for t, q, v in states(arm, motion, off=3e-4, every=200):
        point = motion.sample(t, lead=0.5 * motion.period)
        density.set_goal(arm.configuration(point.position))

        def descent(x: Array, q: Array = q) -> float:
            """−1/ρ at q ⊕ x, by its value alone."""
            return -float(np.exp(-density.evaluate(arm.integrate(q, x)).log_value))

        slope = [(descent(x) - descent(-x)) / 2e-6 for x in 1e-6 * np.eye(arm.nv)]
        wanted = point.acceleration + GAINS.position * np.array(slope)
        wanted -= GAINS.velocity * (v - point.velocity)
        expected = arm.nonlinear_effects(q, v) + arm.mass_matrix(q) @ wanted
        assert (np.abs(expected) < arm.limits.effort).all()  # where nothing is cut off
        np.testing.assert_allclose(anew(controller, t, q, v), expected, rtol=1e-4, atol=1e-4)


def test_torque_is_that_of_all_pairs_to_the_last_bit(
    panda: Arm, panda_swing: Motion, among_spheres: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    update, awake, wakes = ActivePairs.update, list[int](), False

    def watched(pairs: ActivePairs, q: Array) -> None:
        if wakes:
            pairs.wake_all()
        update(pairs, q)
        awake.append(int(np.count_nonzero(pairs.state)))

    monkeypatch.setattr(ActivePairs, "update", watched)
    few, every = (DensityTracking(among_spheres, panda_swing, actuation=TRUSTED) for _ in range(2))
    for state in states(panda, panda_swing):
        wakes = False
        expected = few.torque(*state)
        assert awake[-1] < among_spheres.n_pairs
        wakes = True
        np.testing.assert_array_equal(every.torque(*state), expected)
        assert awake[-1] == among_spheres.n_pairs


class Own:
    """The torus distance, as somebody else's own function."""

    def __init__(self, arm: Arm, **parameters: Any) -> None:
        self._distance = TorusDistance(arm, **parameters)

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        return self._distance.evaluate(q, goal, out_gradient)


@pytest.mark.parametrize("kappa", [1.0, np.inf])
@pytest.mark.parametrize("name", ["panda", "two_link"])
def test_an_own_goal_distance_of_the_same_values_gives_the_same_torque(
    request: pytest.FixtureRequest, name: str, kappa: float
) -> None:
    if name == "panda":
        world, motion = (request.getfixturevalue(f) for f in ("among_spheres", "panda_swing"))
    else:
        world = request.getfixturevalue("swing_up").world
        motion = request.getfixturevalue("swing_up_motion")
    arm, every = world.arm, len(motion.position) // 50
    weights = np.linspace(0.5, 2.0, arm.nv)
    own, built_in = (
        DensityTracking(
            world,
            motion,
            goal_distance=kind(arm, weights=weights, kappa=kappa),
            actuation=TRUSTED,
        )
        for kind in (Own, TorusDistance)
    )
    for state in states(arm, motion, 0.1, every):
        expected = built_in.torque(*state)
        np.testing.assert_allclose(own.torque(*state), expected, rtol=1e-10, atol=1e-10)
        assert own.tracking_error == pytest.approx(built_in.tracking_error, rel=1e-9)


@pytest.mark.parametrize("name", ["kinova", "panda"])
def test_inertia_of_gears_makes_no_feedback_faster_than_its_lag_bears(name: str) -> None:
    """M may be nearly singular where no joint has little inertia by itself."""
    arm, random, period = load_arm(name, torque_rate=np.inf), np.random.default_rng(0), 0.001
    world, low, high = World(arm, Scene()), arm.limits.lower, arm.limits.upper
    for _ in range(10):
        angles = random.uniform(np.clip(low, -3.0, 3.0), np.clip(high, -3.0, 3.0))
        q, still = arm.configuration(angles), np.zeros((3, arm.nv))
        controller = DensityTracking(world, Motion(period, still + angles, still))
        speed = 1e-4
        taus = [anew(controller, 0.0, q, v) for v in speed * np.vstack([np.eye(arm.nv), still[0]])]
        damping = (taus[-1] - np.array(taus[:-1])).T / speed  # K_v (M + D)
        rates = np.linalg.eigvals(np.linalg.solve(arm.mass_matrix(q), damping)).real
        assert rates.min() > 0.9 * TRACKING_GAINS.velocity
        assert period * rates.max() < 1.5  # a damping that is held for a period bears 2


def test_another_goal_distance_gives_another_torque(
    panda: Arm, panda_swing: Motion, among_spheres: World
) -> None:
    """V = Σ w_i e_i²/2 pulls in proportion to its weights."""
    stiff, soft = (
        DensityTracking(
            among_spheres,
            panda_swing,
            goal_distance=TorusDistance(panda, weights=np.full(7, weight), kappa=np.inf),
        )
        for weight in (2.0, 1.0)
    )
    q = panda.integrate(panda.configuration(panda_swing.position[0]), np.full(7, 0.01))
    mass, rest = panda.mass_matrix(q), np.zeros(7)
    held = panda.nonlinear_effects(q, rest)
    start = panda_swing.sample(0.0, lead=0.5 * panda_swing.period).acceleration
    parts = [
        np.linalg.solve(mass, law.torque(0.0, q, rest) - held) - start for law in (stiff, soft)
    ]
    np.testing.assert_allclose(parts[0], 2.0 * parts[1], rtol=1e-6)


def test_an_own_unsafe_set_acts_where_it_is_sensed(
    panda: Arm, panda_swing: Motion, among_spheres: World
) -> None:
    """Joint 4 is not to open beyond its largest position on the way by more than 0.02 rad."""
    top = float(panda_swing.position[:, 3].max())
    fence = ImplicitSet(
        lambda q: (top + 0.02 - q[3], -np.eye(7)[3]), lambda q: (top + 0.005 - q[3], -np.eye(7)[3])
    )
    plain = DensityTracking(among_spheres, panda_swing)
    fenced = DensityTracking(among_spheres, panda_swing, unsafe_sets=[fence])
    at = int(panda_swing.position[:, 3].argmax())
    t, rest = at * panda_swing.period, np.zeros(7)
    on_the_way = panda.configuration(panda_swing.position[at])
    beyond = panda.integrate(on_the_way, 0.015 * np.eye(7)[3])
    np.testing.assert_array_equal(
        anew(fenced, t, on_the_way, rest), anew(plain, t, on_the_way, rest)
    )
    pushed = anew(fenced, t, beyond, rest) - anew(plain, t, beyond, rest)
    acceleration = np.linalg.solve(panda.mass_matrix(beyond), pushed)
    assert acceleration[3] < -0.1


@pytest.mark.parametrize(
    ("density", "message"),
    [
        (DensityParameters(blend_radius=0.05), r"^density.blend_radius = 0.05: must be 0 in track"),
        (DensityParameters(gauge=Gauge.LOG), r"^control.form = 'tracking': must be 'regulation'"),
        (DensityParameters(alpha=2.0), r"with alpha = 2, whose gradient is singular or flat"),
        (DensityParameters(gauge=Gauge.LOG, blend_radius=0.1), r"^density.blend_radius = 0.1"),
    ],
)
def test_what_tracking_cannot_read_is_refused(
    swing_up: Scenario, swing_up_motion: Motion, density: DensityParameters, message: str
) -> None:
    with pytest.raises(InvalidValueError, match=message):
        DensityTracking(swing_up.world, swing_up_motion, density=density)


def test_it_knows_its_motion_goal_and_error(swing_up: Scenario, swing_up_motion: Motion) -> None:
    controller = DensityTracking(swing_up.world, swing_up_motion)
    assert controller.motion is swing_up_motion
    assert controller.tracking_error == 0.0
    assert np.abs(swing_up.arm.difference(controller.goal, swing_up.goal)).max() < 1e-9
    controller.torque(0.0, swing_up.arm.integrate(swing_up.start, np.array([0.1, -0.2])), [0, 0])
    assert controller.tracking_error == pytest.approx(0.2)


@pytest.mark.parametrize("within", [np.inf, 0.05, [0.05, np.inf]])
def test_it_goes_on_from_the_nearest_place_on_its_motion(
    swing_up: Scenario, swing_up_motion: Motion, within: float | list[float]
) -> None:
    controller, arm = DensityTracking(swing_up.world, swing_up_motion), swing_up.arm
    k = len(swing_up_motion.position) // 2
    q = arm.configuration(swing_up_motion.position[k] + 1e-4)
    controller.pause()
    assert controller.resume(q, np.array(within))
    controller.torque(7.0, q, np.zeros(arm.nv))
    assert controller.reference_time == pytest.approx(k * swing_up_motion.period, abs=2e-3)
    assert not controller.resume(arm.configuration(swing_up_motion.position[k] + 1.0), 0.05)


# Following another motion.


@pytest.mark.parametrize("at", [0.3, 0.6])
def test_another_motion_is_joined_by_a_moving_arm_without_a_step_in_torque(
    swing_up: Scenario, swing_up_motion: Motion, at: float
) -> None:
    arm, period = swing_up.arm, swing_up_motion.period
    controller, plant = (
        DensityTracking(swing_up.world, swing_up_motion),
        PinocchioPlant(arm, period),
    )
    q, v, torques = swing_up.start, np.zeros(arm.nv), []
    for k in range(4000):
        if k == round(at / period):
            back = plan_motion(swing_up.world, q, swing_up.start)
            assert np.abs(v).max() > 1.0
            controller.follow(back, q)
            np.testing.assert_allclose(controller.goal, swing_up.start, atol=1e-12)
        torques.append(controller.torque(k * period, q, v))
        q, v = plant.step(q, v, torques[-1])
    rate = np.abs(np.diff(torques, axis=0)) / period
    assert (rate <= arm.limits.torque_rate * (1.0 + 1e-9)).all()
    assert np.abs(arm.difference(q, swing_up.start)).max() < 1e-3


def test_a_motion_of_another_period_or_margin_is_not_followed(
    swing_up: Scenario, swing_up_motion: Motion
) -> None:
    controller = DensityTracking(swing_up.world, swing_up_motion)
    slower, wider = replace(swing_up_motion, period=0.002), replace(swing_up_motion, margin=0.01)
    for other, name, value in ((slower, "period", 0.002), (wider, "margin", 0.01)):
        with pytest.raises(InvalidValueError, match=rf"{name} of the motion = {value}"):
            controller.follow(other, swing_up.start)
        assert controller.motion is swing_up_motion


# Told as velocities.


@pytest.fixture(scope="module")
def swing_up_tracking(swing_up: Scenario, swing_up_motion: Motion) -> DensityTracking:
    return DensityTracking(swing_up.world, swing_up_motion)


@given(
    t=st.floats(-0.1, 3.0),
    off=st.lists(st.floats(-0.3, 0.3), min_size=2, max_size=2),
    shares=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=2),
)
def test_commanded_velocity_keeps_the_limits_wherever_the_arm_is(
    swing_up: Scenario,
    swing_up_tracking: DensityTracking,
    t: float,
    off: list[float],
    shares: list[float],
) -> None:
    arm, motion = swing_up.arm, swing_up_tracking.motion
    v = np.array(shares) * arm.limits.velocity
    q = arm.integrate(arm.configuration(motion.sample(t).position), np.array(off))
    told = swing_up_tracking.velocity(t, q, v)
    assert (np.abs(told) <= arm.limits.velocity).all()
    assert (np.abs(told - v) <= motion.period * arm.limits.acceleration).all()


def test_commanded_velocity_follows_the_motion_and_comes_back_to_it(
    swing_up: Scenario, swing_up_tracking: DensityTracking
) -> None:
    """With a law of ė = -(K_p/K_v) e near it, an error falls to a hundredth in half a second."""
    arm, controller, motion = swing_up.arm, swing_up_tracking, swing_up_tracking.motion
    for off, bound in ((0.0, 1e-12), (0.01, 1.1e-4)):
        q, v = arm.integrate(arm.configuration(motion.position[0]), np.full(2, off)), np.zeros(2)
        for k in range(500):
            v = controller.velocity(k * motion.period, q, v)
            q = arm.integrate(q, motion.period * v)
        error = arm.difference(arm.configuration(motion.position[500]), q)
        assert np.abs(error).max() <= bound
