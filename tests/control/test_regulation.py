"""Regulation: along ∇ρ, no faster than the speed law, zero where ρ has no slope."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm, load_arm
from densarm.certificates.task import SimulationParameters
from densarm.control.controller import Gains
from densarm.control.disturbance_observer import ActuationParameters
from densarm.control.inverse_dynamics import TRUSTED
from densarm.control.regulation import DensityRegulation, FieldRegulation
from densarm.control.speed_law import SpeedLaw, SpeedParameters
from densarm.density.goal_distance import InertiaDistance, TorusDistance
from densarm.density.navigation_density import DensityParameters, Gauge, density_towards
from densarm.density.sub_goals import GuidePath
from densarm.density.unsafe_sets import ImplicitSet
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.scenarios.scenario import Scenario
from densarm.scene.scene import Scene
from densarm.simulation.disturbances import Disturbances
from densarm.simulation.plants import SingleIntegrator
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.active_pairs import ExactDistances
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

ANGLES = st.tuples(*[st.floats(-3, 3)] * 2)
GOAL = (0.3, -0.2)
REST = np.zeros(2)


def regulation(scenario: Scenario, goal: Sequence[float] = GOAL, **changes: Any) -> Any:
    return DensityRegulation(scenario.world, scenario.arm.configuration(goal), **changes)


def goes_to(controller: DensityRegulation, arm: Arm, q: Array, steps: int = 700) -> Array:
    """Return where the planning system leads (nq,)."""
    for k in range(steps):
        q = arm.integrate(q, 0.01 * controller.velocity(0.01 * k, q, REST))
    return q


@pytest.fixture(scope="module")
def direct(swing_up: Scenario) -> DensityRegulation:
    controller: DensityRegulation = regulation(swing_up)
    return controller


@given(angles=ANGLES)
def test_direction_is_the_gradient_and_speed_within_the_law(
    swing_up: Scenario, direct: DensityRegulation, angles: tuple[float, float]
) -> None:
    q, world = swing_up.arm.configuration(angles), swing_up.world
    k = direct.velocity(0.0, q, REST)
    gradient = density_towards(world, direct.goal).evaluate(q).gradient(Gauge.RECIPROCAL)
    norm = np.linalg.norm(k)
    assert k @ gradient == pytest.approx(norm * np.linalg.norm(gradient))
    if norm > 0.0:
        way_left = float(np.linalg.norm(swing_up.arm.difference(q, direct.goal)))
        distances = ExactDistances(world.distances(q))
        fastest = SpeedLaw(world, 0.0).speed(q, k / norm, distances, way_left)
        assert norm <= fastest * (1 + 1e-9)


def test_near_the_goal_it_is_linear_at_the_rate_of_the_gains(swing_up: Scenario) -> None:
    near = swing_up.arm.configuration([0.3 + 1e-4, -0.2 - 2e-4])
    for gains in (Gains(), Gains(position=100.0, velocity=20.0)):
        k = regulation(swing_up, gains=gains).velocity(0.0, near, REST)
        np.testing.assert_allclose(k, gains.rate * np.array([-1e-4, 2e-4]), rtol=1e-3)


def test_a_saddle_is_left_along_its_unstable_direction_which_is_told(swing_up: Scenario) -> None:
    controller = DensityRegulation(swing_up.world, swing_up.goal)
    assert controller.remark == ""
    speed, across = controller.velocity(0.0, swing_up.start, REST)
    assert speed > 0.0 == across
    assert controller.describe_stall(swing_up.start).startswith("saddle of the density")
    assert controller.remark.startswith("left a critical point of the density at joint positions")


@pytest.mark.parametrize("gauge", Gauge)
def test_blend_is_linear_near_the_goal_in_every_gauge(swing_up: Scenario, gauge: Gauge) -> None:
    density = DensityParameters(gauge=gauge, blend_radius=0.05)
    controller = regulation(swing_up, density=density)
    q = swing_up.arm.configuration([0.301, -0.2])
    k = controller.velocity(0.0, q, REST)
    np.testing.assert_allclose(k, [-0.01, 0.0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("gauge", [Gauge.DENSITY, Gauge.LOG])
def test_a_gauge_that_is_singular_at_the_goal_needs_a_blend(
    swing_up: Scenario, gauge: Gauge
) -> None:
    with pytest.raises(InvalidValueError, match=r"^density.blend_radius = 0.0: must be above 0"):
        regulation(swing_up, density=DensityParameters(gauge=gauge))


# Along sub-goals.


def test_no_jump_where_the_next_sub_goal_comes_in_sight(
    swing_up: Scenario, swing_up_motion: Motion
) -> None:
    controller = DensityRegulation(swing_up.world, swing_up.goal, path=swing_up_motion.path)
    q, speeds, arm = swing_up.start, [], swing_up.arm
    for k in range(600):
        velocity = controller.velocity(0.002 * k, q, REST)
        speeds.append(np.linalg.norm(velocity))
        q = arm.integrate(q, 0.002 * velocity)
    assert np.abs(arm.difference(swing_up.start, q)).max() > 1.0  # sub-goals are 0.05 rad apart
    assert (np.diff(speeds) / speeds[1:]).max() < 0.1


@pytest.mark.parametrize("plain", [False, True])
def test_a_path_leads_where_the_goal_alone_does_not(
    swing_up: Scenario, swing_up_motion: Motion, plain: bool
) -> None:
    arm, ends = swing_up.arm, []
    for path in (None, swing_up_motion.path):
        controller = DensityRegulation(swing_up.world, swing_up.goal, path=path, plain=plain)
        np.testing.assert_array_equal(controller.goal, swing_up.goal)
        ends.append(goes_to(controller, arm, swing_up.start, steps=1000))
    off, near = (np.abs(arm.difference(swing_up.goal, end)).max() for end in ends)
    assert off > 1.5 > 0.5 > near


def test_a_path_that_claims_to_be_clear_and_is_not_is_refused(swing_up: Scenario) -> None:
    straight = GuidePath(np.stack([swing_up.start, swing_up.goal]), is_clear=True)
    with pytest.raises(InvalidValueError, match=r"^path = .*proved clear"):
        DensityRegulation(swing_up.world, swing_up.goal, path=straight)


def test_drives_the_arm_to_its_goal_within_limits_and_proved_clear(
    swing_up: Scenario, swing_up_motion: Motion
) -> None:
    world, arm = swing_up.world, swing_up.arm
    controller = DensityRegulation(world, swing_up.goal, path=swing_up_motion.path)
    run = simulate(
        world,
        controller,
        swing_up.start,
        plant=SingleIntegrator(arm, 0.01),
        parameters=SimulationParameters(dt=0.01),
    )
    assert run.outcome == Outcome.REACHED
    assert (np.abs(run.v) <= arm.limits.velocity * (1.0 + 1e-12)).all()
    assert SweptCheck(world).check(run.q).verdict == SweptVerdict.CLEAR


@pytest.mark.parametrize("act", ["velocity", "torque"])
def test_a_state_of_another_arm_is_refused(direct: DensityRegulation, act: str) -> None:
    with pytest.raises(InvalidValueError, match="configuration"):
        getattr(direct, act)(0.0, [0.0, 0.0], [0.0, 0.0])


# Torque.


def settled_acceleration(controller: Any, arm: Arm, q: Array) -> Array:
    """Return the acceleration at rest at q (nq,), once nothing holds the jerk back (nv,)."""
    for k in range(60):
        tau = controller.torque(0.001 * k, q, REST)
    return np.array(pin.aba(arm.model, arm.data, q, REST, tau))


@settings(max_examples=8)
@given(angles=st.tuples(*[st.floats(-0.01, 0.01)] * 2))
def test_torque_and_velocity_are_of_one_law(
    swing_up: Scenario, angles: tuple[float, float]
) -> None:
    """At rest q̈ = K_v k(q), where no limit binds."""
    arm, gains = swing_up.arm, Gains(position=100.0, velocity=20.0)
    controller = regulation(swing_up, gains=gains, actuation=TRUSTED)
    q = arm.configuration(np.array(GOAL) + angles)
    wanted = gains.velocity * controller.velocity(0.0, q, REST)
    acceleration = settled_acceleration(controller, arm, q)
    np.testing.assert_allclose(acceleration, wanted, rtol=0, atol=1e-9)


@settings(max_examples=8)
@given(angles=st.tuples(*[st.floats(-0.01, 0.01)] * 2))
def test_in_the_plain_form_the_torque_itself_points_along_the_gradient(
    swing_up: Scenario, angles: tuple[float, float]
) -> None:
    arm, world = swing_up.arm, swing_up.world
    controller = regulation(swing_up, plain=True, actuation=TRUSTED)
    q = arm.configuration(np.array(GOAL) + angles)
    acceleration = settled_acceleration(controller, arm, q)
    goal = controller.goal
    density = density_towards(world, goal, goal_distance=InertiaDistance(arm, goal))
    gradient = density.evaluate(q).gradient(Gauge.RECIPROCAL)
    torque = arm.mass_matrix(q) @ acceleration
    norms = float(np.linalg.norm(torque) * np.linalg.norm(gradient))
    assert torque @ gradient == pytest.approx(norms, rel=1e-6, abs=1e-12)
    straight = np.linalg.norm(arm.mass_matrix(q) @ arm.difference(q, goal))
    assert np.linalg.norm(torque) == pytest.approx(400.0 * straight, rel=0.1, abs=1e-6)


def test_each_call_is_held_back_by_the_jerk_after_a_pause_again(swing_up: Scenario) -> None:
    arm, controller = swing_up.arm, regulation(swing_up, actuation=TRUSTED)
    q = arm.configuration([0.5, 0.2])
    largest = arm.limits.acceleration * 0.001 * Gains().velocity

    def acceleration(t: float) -> Array:
        return np.array(pin.aba(arm.model, arm.data, q, REST, controller.torque(t, q, REST)))

    first, second = acceleration(0.0), acceleration(0.001)
    assert (np.abs(first) <= largest * (1.0 + 1e-6)).all()
    np.testing.assert_allclose(second, 2.0 * first, rtol=1e-6)
    np.testing.assert_allclose(acceleration(7.0), first, rtol=1e-6)


# Rotors that the model leaves out.

# Five times the inertia of a Panda's last link.
HEAVY_ROTORS = Disturbances(armature=0.1, viscous=1.0)


def wrist_turned(inertia_floor: float, disturbances: Disturbances = Disturbances()) -> Run:
    arm = load_arm("panda", shapes="capsule")
    world, start = World(arm, Scene()), arm.postures["ready"]
    goal = arm.integrate(start, np.array([0.0, 0.0, 0.0, 0.0, 0.5, 0.0, -0.5]))
    actuation = ActuationParameters(inertia_floor=inertia_floor)
    return simulate(
        world,
        DensityRegulation(world, goal, actuation=actuation),
        start,
        disturbances=disturbances,
        parameters=SimulationParameters(time_limit=1.5),
    )


@pytest.mark.slow
def test_an_observer_that_reckons_with_rotors_keeps_a_wrist_that_has_them_from_swinging() -> None:
    swings, steady = (wrist_turned(floor, HEAVY_ROTORS) for floor in (0.0, 0.03))
    for run, reversals in ((swings, True), (steady, False)):
        fast = run.v[np.abs(run.v[:, 6]) > 0.02, 6]
        assert bool((fast > 0.0).any()) == reversals
        assert (run.outcome == Outcome.REACHED) != reversals


@pytest.mark.slow
def test_an_arm_without_rotors_moves_as_if_none_were_reckoned_with() -> None:
    without, with_floor = wrist_turned(0.0), wrist_turned(0.03)
    np.testing.assert_allclose(with_floor.q, without.q, rtol=0, atol=1e-5)
    assert with_floor.certified


# What is given.


def test_weights_of_the_goal_distance_bend_the_way(swing_up: Scenario) -> None:
    q = swing_up.arm.configuration([0.301, -0.201])
    weighted = regulation(swing_up, goal_distance=TorusDistance(swing_up.arm, [1.0, 3.0]))
    k = weighted.velocity(0.0, q, REST)
    np.testing.assert_allclose(k, [-0.01, 0.03], rtol=1e-3)


def test_a_margin_is_kept_and_a_speed_share_slows_down(swing_up: Scenario) -> None:
    q = swing_up.arm.configuration([0.8, 0.6])
    usual, wide, slow = (
        np.linalg.norm(regulation(swing_up, **changes).velocity(0.0, q, REST))
        for changes in ({}, {"margin": 0.1}, {"speed": SpeedParameters(braking_share=0.1)})
    )
    assert wide < usual
    assert slow < usual


def test_an_own_unsafe_set_is_not_entered(swing_up: Scenario) -> None:
    """A disc in joint positions on the straight way to the goal."""
    arm = swing_up.arm
    middle = np.array([0.3, 0.5])

    def disc(radius: float) -> Any:
        def function(q: Array) -> tuple[float, Array]:
            off = arm.angles(q) - middle
            return float(off @ off - radius**2), 2.0 * off

        return function

    fence = ImplicitSet(disc(0.15), disc(0.3))
    start = arm.configuration([0.35, 1.1])
    free, fenced = regulation(swing_up), regulation(swing_up, unsafe_sets=[fence])
    for controller, enters in ((free, True), (fenced, False)):
        q, least = start, np.inf
        for k in range(600):
            q = arm.integrate(q, 0.01 * controller.velocity(0.01 * k, q, REST))
            least = min(least, fence.h(q)[0])
        assert (least < 0.0) == enters
        assert np.abs(arm.difference(controller.goal, q)).max() < 1e-3


def test_set_goal_leads_on(swing_up: Scenario) -> None:
    arm, controller = swing_up.arm, regulation(swing_up)
    first = goes_to(controller, arm, swing_up.start)
    assert np.abs(arm.difference(first, arm.configuration(GOAL))).max() < 1e-3
    controller.set_goal(arm.configuration([-0.4, 0.1]).tolist())
    np.testing.assert_allclose(arm.angles(controller.goal), [-0.4, 0.1])
    second = goes_to(controller, arm, first)
    np.testing.assert_allclose(arm.angles(second), [-0.4, 0.1], atol=1e-3)


def test_set_goal_leaves_a_path_behind(swing_up: Scenario, swing_up_motion: Motion) -> None:
    controller = DensityRegulation(swing_up.world, swing_up.goal, path=swing_up_motion.path)
    goes_to(controller, swing_up.arm, swing_up.start, 50)
    controller.set_goal(swing_up.arm.configuration(GOAL))
    q = swing_up.arm.configuration([0.31, -0.2])
    expected = regulation(swing_up).velocity(0.0, q, REST)
    np.testing.assert_array_equal(controller.velocity(0.0, q, REST), expected)


REFUSED = {
    "contact": (
        "swing_up",
        [1.25, 0.0],
        r"^goal = .*held, and clear \(goal: lower_link_0 and right",
    ),
    "limits": ("panda", [0, -0.8, 0, 0.5, 0, 1.6, 0.8], r"\(goal: joint 'panda_joint4' at 0.5 is"),
    "length": ("swing_up", None, r"^goal = .*\(4,\), got \(2,\)"),
    "nan": ("panda", [np.nan] * 7, r"^goal = .*finite"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_goal_that_is_none_is_refused_in_one_line_and_the_old_one_kept(
    request: pytest.FixtureRequest, swing_up: Scenario, name: str
) -> None:
    robot, angles, message = REFUSED[name]
    world: World = request.getfixturevalue("among_spheres") if robot == "panda" else swing_up.world
    arm = world.arm
    kept = arm.postures["ready"] if robot == "panda" else arm.configuration(GOAL)
    wrong: Any = [0.0, 0.0]
    if angles is not None:
        wrong = angles if robot == "panda" else arm.configuration(angles)
    controller = DensityRegulation(world, kept)
    q, rest = arm.integrate(kept, np.full(arm.nv, 0.01)), np.zeros(arm.nv)
    before = controller.velocity(0.0, q, rest)
    for refuse in (controller.set_goal, lambda goal: DensityRegulation(world, goal)):
        with pytest.raises(InvalidValueError, match=message) as raised:
            refuse(wrong)
        assert "\n" not in str(raised.value)
    np.testing.assert_array_equal(controller.goal, kept)
    np.testing.assert_array_equal(controller.velocity(0.0, q, rest), before)


def test_obstacles_that_moved_act_where_they_are(swing_up: Scenario) -> None:
    world = World(swing_up.arm, swing_up.scene)
    controller = DensityRegulation(world, swing_up.arm.configuration(GOAL))
    q = swing_up.arm.configuration([0.5, 0.0])
    before = controller.velocity(0.0, q, REST)
    world.move_obstacle("right", position=(0.9, 0.0, -1.6))
    assert np.isfinite(controller.torque(0.0, q, REST)).all()
    assert np.linalg.norm(controller.velocity(0.0, q, REST)) < np.linalg.norm(before)


class Spring:
    """A field of one's own: straight to a configuration."""

    def __init__(self, world: World, goal: Array) -> None:
        self._world, self._goal, self.metrics = world, goal, list[Any]()
        self.distances = ExactDistances(np.zeros(0))

    def velocity(self, q: Array, metric: Array | None) -> tuple[Array, float]:
        self.distances = ExactDistances(self._world.distances(q))
        self.metrics.append(metric)
        step = self._world.arm.difference(q, self._goal)
        return 10.0 * step, float(np.linalg.norm(step))


@pytest.mark.slow
@pytest.mark.parametrize("has_metric", [False, True])
def test_a_field_of_ones_own_stops_before_what_it_does_not_see(
    swing_up: Scenario, has_metric: bool
) -> None:
    world, arm = swing_up.world, swing_up.arm
    field = Spring(world, arm.configuration([1.6, 0.0]))
    inertia_at = swing_up.start if has_metric else None
    controller = FieldRegulation(arm, field, SpeedLaw(world, 0.0), inertia_at=inertia_at)
    p = SimulationParameters(time_limit=6.0)
    run = simulate(world, controller, swing_up.start, arm.configuration([1.6, 0.0]), parameters=p)
    assert run.outcome == Outcome.STUCK
    assert 0.0 < run.clearance.min() < 0.03
    assert arm.angles(run.q[-1])[0] > 0.8
    assert all((metric is not None) == has_metric for metric in field.metrics)
    checks = {check.name: check.holds for check in run.certificate.checks}
    assert [name for name, holds in checks.items() if not holds] == ["goal"]


class Following:
    """A regulation whose goal moves at a constant velocity, and is set so often [s]."""

    def __init__(self, world: World, start: Array, velocity: Array, every: float) -> None:
        self.arm, self.start, self.moves, self.every = world.arm, start, velocity, every
        self.regulation, self.next = DensityRegulation(world, start), 0.0

    def goal(self, t: float) -> Array:
        return self.arm.integrate(self.start, t * self.moves)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        if t >= self.next:
            self.regulation.set_goal(self.goal(t), self.moves)
            self.next += self.every
        return self.regulation.torque(t, q, v)


@pytest.mark.slow
@pytest.mark.parametrize("every", [0.001, 1.0 / 30.0])
def test_a_goal_that_moves_is_followed_without_a_lag(every: float) -> None:
    world = World(load_arm("ur5", shapes="capsule"), Scene())
    arm, start = world.arm, world.arm.postures["ready"]
    controller = Following(world, start, np.array([0.4, -0.1, 0.2, 0.0, 0.0, 0.3]), every)
    limit = SimulationParameters(time_limit=1.2)
    run = simulate(world, controller, start, controller.goal(9.0), parameters=limit)
    goals = np.array([controller.goal(t) for t in run.time])
    assert np.abs(arm.difference(run.q, goals))[800:].max() < 1e-5
    held = np.array([arm.nonlinear_effects(q, np.zeros(6)) for q in run.q])
    assert (np.abs(np.diff(run.tau - held, axis=0)) <= 1e-3 * arm.limits.torque_rate + 1e-6).all()
    np.testing.assert_allclose(controller.regulation.goal, controller.goal(run.time[-2]), atol=1e-9)


def test_a_goal_that_is_not_set_again_comes_to_rest(swing_up: Scenario) -> None:
    arm, controller = swing_up.arm, regulation(swing_up)
    controller.set_goal(arm.configuration([-0.4, 0.1]), [0.5, -0.2])
    q = goes_to(controller, arm, swing_up.start)
    np.testing.assert_allclose(arm.angles(controller.goal), [-0.35, 0.08], atol=1e-12)
    np.testing.assert_allclose(arm.angles(q), [-0.35, 0.08], atol=1e-3)


@pytest.mark.parametrize("velocity", [[0.1], [np.nan, 0.0], "fast"])
def test_a_goal_of_a_wrong_velocity_is_refused_and_the_old_one_kept(
    swing_up: Scenario, velocity: Any
) -> None:
    controller = regulation(swing_up)
    with pytest.raises(InvalidValueError, match=r"^velocity = "):
        controller.set_goal(swing_up.arm.configuration([-0.4, 0.1]), velocity)
    np.testing.assert_array_equal(controller.goal, swing_up.arm.configuration(GOAL))
