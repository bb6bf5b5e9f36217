"""The fixed-step loop: its time grid, the input it holds, how it ends, and what it refuses."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm, load_arm
from densarm.arms.free_body import free_body
from densarm.certificates.task import Input, Integrator, SimulationParameters
from densarm.control.regulation import DensityRegulation
from densarm.control.supervisor import Supervisor
from densarm.control.tracking import DensityTracking
from densarm.errors import InvalidValueError
from densarm.planning.motion import TimingParameters
from densarm.planning.plan import plan_motion, plan_path
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.plants import PinocchioPlant, SingleIntegrator
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World

Parameters = SimulationParameters


@pytest.fixture(scope="module")
def free() -> World:
    """The two-link arm, and nothing around it."""
    return World(load_arm("two_link"), Scene())


class Servo:
    """Inverse dynamics to a fixed configuration, noting when it is called."""

    def __init__(self, arm: Arm, goal: Array, rate: float = 10.0) -> None:
        self.arm, self.wanted, self.rate, self.calls = arm, goal, rate, list[float]()

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        self.calls.append(t)
        error = self.arm.difference(np.asarray(q), self.wanted)
        acceleration = self.rate**2 * error - 2 * self.rate * np.asarray(v)
        return self.arm.mass_matrix(q) @ acceleration + self.arm.nonlinear_effects(q, v)


class Constant:
    """One torque, velocity or whatever, at all times."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def torque(self, *_: Any) -> Any:
        return self.value

    velocity = torque


LIMP = Constant(np.zeros(2))


class Proportional:
    """Velocity in proportion to the error."""

    def __init__(self, arm: Arm, goal: Array) -> None:
        self.arm, self.goal = arm, goal

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:  # noqa: ARG002
        return 5.0 * self.arm.difference(np.asarray(q), self.goal)


# The time grid.


def test_time_grid_torque_and_divisor(free: World) -> None:
    arm, p = free.arm, Parameters(dt=0.002, control_divisor=5, time_limit=0.1)
    controller = Servo(arm, arm.configuration([0.5, 0.5]))
    start = arm.configuration([0.1, 0.0])
    run = simulate(free, controller, start, controller.wanted, parameters=p)
    assert run.outcome == Outcome.TIMED_OUT
    assert run.detail == "after 0.1 s"
    np.testing.assert_array_equal(run.time, 0.002 * np.arange(51))
    assert controller.calls == pytest.approx(0.01 * np.arange(10))
    np.testing.assert_array_equal(run.q[0], start)
    np.testing.assert_array_equal(run.v[0], 0.0)
    np.testing.assert_array_equal(np.ptp(run.tau[:-1].reshape(10, 5, 2), axis=1), 0.0)
    np.testing.assert_array_equal(run.tau[-1], run.tau[-2])
    plant = PinocchioPlant(arm, p.dt, p.integrator)
    for k in range(50):  # tau[k] is held on [t_k, t_k+1)
        q, v = plant.step(run.q[k], run.v[k], run.tau[k])
        np.testing.assert_array_equal(q, run.q[k + 1])
        np.testing.assert_array_equal(v, run.v[k + 1])


def test_ends_when_the_goal_is_reached_and_held(free: World) -> None:
    arm = free.arm
    goal = arm.configuration([0.4, -0.3])
    p = Parameters(hold_time=0.25)
    run = simulate(free, Servo(arm, goal), arm.postures["hanging"], goal, parameters=p)
    assert run.outcome == Outcome.REACHED
    held = run.time >= run.time[-1] - 0.249
    assert np.abs(arm.difference(goal, run.q[held])).max() <= 0.01
    assert np.abs(run.v[held]).max() <= 0.01


def test_passing_through_the_goal_is_not_reaching_it(free: World) -> None:
    arm, p = free.arm, Parameters(time_limit=2.0)
    hanging = arm.postures["hanging"]
    run = simulate(free, LIMP, arm.configuration([0.5, 0.0]), hanging, parameters=p)
    assert run.outcome == Outcome.TIMED_OUT


class Waiting(Constant):
    """Has a motion, of which the loop reads how long it takes."""

    class motion:  # noqa: N801
        duration = 1.0


def test_at_rest_away_from_the_goal_is_stuck_but_not_while_its_motion_lasts(free: World) -> None:
    arm, p = free.arm, Parameters(stall_time=0.3)
    hanging, goal = arm.postures["hanging"], arm.configuration([1, 0])
    run = simulate(free, LIMP, hanging, goal, parameters=p)
    assert (run.outcome, run.time[-1]) == (Outcome.STUCK, pytest.approx(0.3, abs=0.01))
    waiting = simulate(free, Waiting(np.zeros(2)), hanging, goal, parameters=p)
    assert waiting.outcome == Outcome.STUCK
    assert waiting.time[-1] == pytest.approx(1.3, abs=0.01)


def test_progress_is_told(free: World) -> None:
    arm, p, told = free.arm, Parameters(time_limit=1.0), list[str]()
    start, hanging = arm.configuration([0.5, 0]), arm.postures["hanging"]
    simulate(free, LIMP, start, hanging, parameters=p, on_progress=told.append)
    assert told == [f"running, {t:.1f} s simulated" for t in (0.0, 0.2, 0.4, 0.6, 0.8)]


# How it ends, and what it says.


def test_a_controller_that_drives_through_an_obstacle_ends_as_collided(swing_up: Scenario) -> None:
    world, arm = swing_up.world, swing_up.arm
    blind = Servo(arm, arm.configuration([2.0, 0.0]), 5.0)
    run = simulate(world, blind, swing_up.start)
    assert run.outcome == Outcome.COLLIDED
    assert run.detail == f"lower_link_0 and right at t = {run.time[-1]:.3f} s"
    assert (run.clearance[:-1] > 0.0).all()
    assert run.clearance[-1] <= 0.0
    assert run.certified is False
    assert "swept" in [check.name for check in run.certificate.checks if not check.holds]
    np.testing.assert_array_equal(run.tau[-1], run.tau[-2])


def test_a_controller_without_a_goal_runs_until_the_time_is_up(swing_up: Scenario) -> None:
    limp = simulate(swing_up.world, LIMP, swing_up.start, parameters=Parameters(time_limit=3.0))
    assert (limp.outcome, limp.task.goal) == (Outcome.TIMED_OUT, None)
    assert limp.time[-1] == pytest.approx(3.0)
    assert np.isnan(limp.goal_error)
    assert limp.tracking_error is None
    assert [check.name for check in limp.certificate.checks if not check.holds] == ["goal"]


@pytest.mark.slow
def test_a_goal_is_the_controllers_own_unless_another_is_given(swing_up: Scenario) -> None:
    world, start = swing_up.world, swing_up.start
    controller = DensityTracking(world, plan_motion(world, start, swing_up.goal))
    own = simulate(world, controller, start)
    assert own.outcome == Outcome.REACHED
    assert own.task.goal_error(swing_up.goal) < 1e-9
    assert own.certified
    assert own.tracking_error is not None
    assert 0.0 < own.tracking_error < 0.005
    other = simulate(world, controller, start, swing_up.arm.configuration([2.0, 0.0]))
    assert other.outcome == Outcome.STUCK
    assert other.task.goal_error(own.q[-1]) == pytest.approx(np.pi - 2.0, abs=1e-2)


# A supervisor passes on what the controller tells of itself.


def assert_judged_alike(run: Run, supervised: Run) -> None:
    for name in ("outcome", "detail", "tracking_error"):
        assert getattr(supervised, name) == getattr(run, name)
    np.testing.assert_array_equal(supervised.tau, run.tau)
    if run.task.goal is None:
        assert supervised.task.goal is None
    else:
        np.testing.assert_array_equal(supervised.task.goal, run.task.goal)


@pytest.mark.slow
def test_a_supervised_run_is_judged_as_the_controllers_own(swing_up: Scenario) -> None:
    world, arm, start = swing_up.world, swing_up.arm, swing_up.start
    tracking = DensityTracking(world, plan_motion(world, start, swing_up.goal))
    run = simulate(world, tracking, start)
    assert run.outcome == Outcome.REACHED
    assert_judged_alike(run, simulate(world, Supervisor(arm, tracking), start))
    run, supervised = (
        simulate(world, controller, start, parameters=Parameters(dt=0.002))
        for controller in (
            DensityRegulation(world, swing_up.goal, period=0.002),
            Supervisor(arm, DensityRegulation(world, swing_up.goal, period=0.002), 0.002),
        )
    )
    assert run.outcome == Outcome.STUCK
    assert run.detail.startswith("maximum of the density")
    assert run.tracking_error is None
    assert_judged_alike(run, supervised)


def test_a_controller_that_tells_nothing_does_not_under_a_supervisor(free: World) -> None:
    hanging, p = free.arm.postures["hanging"], Parameters(time_limit=0.1)
    run = simulate(free, LIMP, hanging, parameters=p)
    assert_judged_alike(run, simulate(free, Supervisor(free.arm, LIMP), hanging, parameters=p))


def test_a_supervised_arm_is_waited_for_while_its_motion_lasts(free: World) -> None:
    hanging, goal = free.arm.postures["hanging"], free.arm.configuration([1, 0])
    supervisor = Supervisor(free.arm, Waiting(np.zeros(2)))
    run = simulate(free, supervisor, hanging, goal, parameters=Parameters(stall_time=0.3))
    assert run.outcome == Outcome.STUCK
    assert run.time[-1] == pytest.approx(1.3, abs=0.01)


def test_where_a_supervisor_stopped_its_status_is_the_verdict(free: World) -> None:
    supervisor = Supervisor(free.arm, Constant(np.array([1e3, 0.0])))
    run = simulate(free, supervisor, free.arm.postures["hanging"], free.arm.configuration([1, 0]))
    assert run.outcome == Outcome.STUCK
    assert run.detail == supervisor.status.sentence
    assert run.detail.startswith("At t = 0.0 s the controller gave [1000. 0.], and the limits are ")


@pytest.mark.slow
def test_where_it_rests_is_told_by_the_controller_or_by_what_is_near(swing_up: Scenario) -> None:
    world, arm = swing_up.world, swing_up.arm
    start, goal = arm.configuration([0.8, 0.0]), arm.configuration([2.0, 0.0])
    plant, p = SingleIntegrator(arm, 0.02), Parameters(dt=0.02)
    controller = DensityRegulation(world, goal)
    own = simulate(world, controller, start, plant=plant, parameters=p)
    assert own.outcome == Outcome.STUCK
    assert "the density" in own.detail
    assert own.detail == controller.describe_stall(own.q[-1])
    silent = simulate(world, Servo(arm, start), start, goal)
    assert silent.outcome == Outcome.STUCK
    assert silent.detail.startswith("at rest at joint positions (0.8, ")
    assert "; nearest there: lower_link_0 and right (" in silent.detail
    assert silent.detail.count(" mm)") == 3
    alone = World(arm, Scene())
    assert simulate(alone, Servo(arm, start), start, goal).detail.endswith("there: no pair")


def test_a_start_in_contact_or_outside_limits_is_infeasible_and_nothing_moves(
    swing_up: Scenario,
) -> None:
    arm = swing_up.arm
    limp = simulate(swing_up.world, LIMP, arm.configuration([1.25, 0.0]))
    assert limp.outcome == Outcome.INFEASIBLE
    assert limp.detail.startswith("start: lower_link_0 and right overlap by ")
    assert len(limp.q) == len(limp.time) == len(limp.tau) == 1
    assert not limp.certified
    body = free_body(Sphere(name="disc", radius=0.1), "plane", [(-1.0, 1.0)] * 2)
    outside = simulate(World(body, Scene()), LIMP, [1.5, 0.0])
    assert outside.outcome == Outcome.INFEASIBLE
    assert outside.detail == "start: joint 'x' at 1.5 is outside [-1, 1]"


@pytest.mark.parametrize(
    ("torque", "message"),
    [
        ([np.nan, 0.0], r"^torque of the controller at t = 0.000 s = \[nan, 0.0\]: .*finite"),
        (np.array([0.0, np.inf]), r"^torque of the controller at t = 0.000 s = .*finite"),
        (np.zeros(3), r"^torque of the controller .*of shape \(2,\), got \(3,\)"),
        (np.zeros((1, 2)), r"^torque of the controller .*of shape \(2,\), got \(1, 2\)"),
        (0.0, r"^torque of the controller .*of shape \(2,\), got \(\)"),
        (None, r"^torque of the controller at t = 0.000 s = None: must be 2 numbers"),
        (["a", "b"], r"^torque of the controller .*must be 2 numbers"),
        ([[0.0], [0.0, 1.0]], r"^torque of the controller .*must be 2 numbers"),
    ],
)
def test_a_torque_that_is_none_is_refused(swing_up: Scenario, torque: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=message) as raised:
        simulate(swing_up.world, Constant(torque), swing_up.start)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "value", [[1, 2], (1.0, 2.0), np.array([1, 2]), np.array([1, 2], np.float32)]
)
def test_a_torque_of_any_numbers_is_taken(free: World, value: Any) -> None:
    p = Parameters(time_limit=0.01)
    run = simulate(free, Constant(value), free.arm.postures["hanging"], parameters=p)
    assert run.tau.dtype == np.float64
    np.testing.assert_array_equal(run.tau, np.tile([1.0, 2.0], (11, 1)))


def test_a_controller_may_return_one_array_time_after_time(free: World) -> None:
    """What is recorded is a copy."""

    class Reused:
        def __init__(self) -> None:
            self.tau = np.zeros(2)

        def torque(self, t: float, *_: Any) -> Array:
            self.tau[:] = t
            return self.tau

    p = Parameters(time_limit=0.01)
    run = simulate(free, Reused(), free.arm.postures["hanging"], parameters=p)
    np.testing.assert_allclose(run.tau[:-1, 0], run.time[:-1])


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("value", [[0.0, 0.0], [2, 0, 1, 0], [1, 0, 1, np.nan], "upright"])
def test_ends_that_are_no_configuration_are_refused(
    swing_up: Scenario, end: str, value: Any
) -> None:
    ends: Any = {"start": swing_up.start, "goal": swing_up.goal} | {end: value}
    with pytest.raises(InvalidValueError, match=f"^{end}"):
        simulate(swing_up.world, LIMP, **ends)


# Plants.


def test_a_plant_with_another_time_step_is_refused(free: World) -> None:
    start = free.arm.postures["hanging"]
    for plant in (SingleIntegrator(free.arm, 0.01), PinocchioPlant(free.arm, 0.01)):
        with pytest.raises(InvalidValueError, match=r"^dt of the plant = 0.01: must be the loop's"):
            simulate(free, LIMP, start, plant=plant, parameters=Parameters(dt=0.001))


@pytest.mark.parametrize("told", ["force", "", None, 1])
def test_a_plant_of_an_unknown_input_is_refused(free: World, told: Any) -> None:
    plant = InPlace()
    plant.input = told
    message = r"^input of the plant = .*: must be one of position, torque, velocity"
    with pytest.raises(InvalidValueError, match=message):
        simulate(
            free, LIMP, free.arm.postures["hanging"], plant=plant, parameters=Parameters(dt=0.01)
        )


def test_a_controller_without_the_method_that_the_plant_needs_is_refused(free: World) -> None:
    hanging = free.arm.postures["hanging"]
    needs = r"^controller = '{}': must be one with a method {}\(t, q, v\), which this plant needs"
    with pytest.raises(InvalidValueError, match=needs.format("Proportional", "torque")):
        simulate(free, Proportional(free.arm, hanging), hanging)
    servo, plant = Servo(free.arm, hanging), SingleIntegrator(free.arm, 0.001)
    with pytest.raises(InvalidValueError, match=needs.format("Servo", "velocity")):
        simulate(free, servo, hanging, plant=plant)
    idle: Any = type("Idle", (), {"torque": None})()
    with pytest.raises(InvalidValueError, match=needs.format("Idle", "torque")):
        simulate(free, idle, hanging)


class Rubbing(PinocchioPlant):
    """A plant of one's own, with viscous friction that no model tells of."""

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        return super().step(q, v, u - 2.0 * v)


def test_an_own_plant_with_friction_is_driven_and_told_from_the_model(swing_up: Scenario) -> None:
    world, arm, start = swing_up.world, swing_up.arm, swing_up.start
    timing = TimingParameters(acceleration_share=0.5, torque_share=0.7)
    controller = DensityTracking(world, plan_motion(world, start, swing_up.goal, timing=timing))
    p = Parameters(time_limit=5.0)
    run, usual = (
        simulate(world, controller, start, plant=plant, parameters=p)
        for plant in (Rubbing(arm), None)
    )
    assert run.outcome == Outcome.REACHED
    assert run.tracking_error is not None
    assert usual.tracking_error is not None
    assert run.tracking_error > 1.5 * usual.tracking_error
    assert [check.name for check in run.certificate.checks if not check.holds] == ["replay"]


class InPlace:
    """A plant that moves the state that it is given."""

    input, dt = "velocity", 0.01

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        v[:] = u
        q += self.dt * v
        return q, v


def test_what_is_recorded_is_a_copy() -> None:
    arm = free_body(Sphere(name="disc", radius=0.1), "plane", [(-2.0, 2.0)] * 2)
    start, p = np.array([-1.0, 0.0]), Parameters(dt=0.01, time_limit=1.0)
    world, velocity = World(arm, Scene()), Constant(np.array([1.0, 0.5]))
    own, ours = (
        simulate(world, velocity, start, plant=plant, parameters=p)
        for plant in (InPlace(), SingleIntegrator(arm, 0.01))
    )
    np.testing.assert_array_equal(start, [-1.0, 0.0])
    np.testing.assert_allclose(own.q, ours.q, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(own.v, ours.v)


def test_a_plant_that_is_none_of_ours_needs_dt_and_step_alone(free: World) -> None:
    class Fixed:
        dt = 0.001

        def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:  # noqa: ARG002
            return q, v

    hanging = free.arm.postures["hanging"]
    run = simulate(free, LIMP, hanging, hanging, plant=Fixed())
    assert (run.outcome, run.task.input) == (Outcome.REACHED, Input.TORQUE)


def test_a_velocity_controller_drives_the_single_integrator(free: World) -> None:
    arm, p = free.arm, Parameters(dt=0.01, control_divisor=2)
    goal = arm.configuration([-3.0, 0.5])  # by way of the cut of its angles
    start = arm.configuration([3.0, 0.0])
    plant = SingleIntegrator(arm, p.dt)
    run = simulate(free, Proportional(arm, goal), start, plant=plant, parameters=p)
    assert run.outcome == Outcome.REACHED
    assert run.task.input == Input.VELOCITY
    np.testing.assert_array_equal(run.tau, 0.0)
    steps = arm.difference(run.q[:-1], run.q[1:])
    np.testing.assert_allclose(steps, 0.01 * run.v[1:], rtol=0, atol=1e-12)
    assert (steps[:, 0] >= 0.0).all()  # the short way
    held = run.v[1:][: 2 * ((len(run.v) - 1) // 2)].reshape(-1, 2, 2)
    np.testing.assert_array_equal(np.ptp(held, axis=1), 0.0)


def velocity_run(scenario: Scenario, **changes: Any) -> Run:
    world, start, goal = scenario.world, scenario.start, scenario.goal
    controller = DensityRegulation(world, goal, path=plan_path(world, start, goal, "path").path)
    plant, p = SingleIntegrator(scenario.arm, 0.02, **changes), Parameters(dt=0.02, time_limit=10)
    return simulate(world, controller, start, plant=plant, parameters=p)


def test_the_planning_system_drives_the_single_integrator_to_the_goal(swing_up: Scenario) -> None:
    run = velocity_run(swing_up)
    assert run.outcome == Outcome.REACHED
    holds = {check.name: check.holds for check in run.certificate.checks}
    assert holds["swept"]
    assert holds["replay"]
    assert holds["goal"]
    assert (run.clearance > 0.0).all()


@pytest.mark.slow
def test_under_noise_nothing_counts_as_reached_and_the_record_is_its_own_replay(
    swing_up: Scenario,
) -> None:
    run = velocity_run(swing_up, noise=1e-2, seed=1)
    assert run.outcome == Outcome.TIMED_OUT
    assert run.goal_error < 0.3
    checks = {check.name: check.holds for check in run.certificate.checks}
    assert checks["replay"]
    assert checks["swept"]
    np.testing.assert_array_equal(run.q, velocity_run(swing_up, noise=1e-2, seed=1).q)


@pytest.mark.parametrize("velocity", [[np.nan, 0.0], np.zeros(3), None])
def test_a_velocity_that_is_none_is_refused(swing_up: Scenario, velocity: Any) -> None:
    plant = SingleIntegrator(swing_up.arm)
    with pytest.raises(InvalidValueError, match=r"^velocity of the controller at t = 0.000 s"):
        simulate(swing_up.world, Constant(velocity), swing_up.start, plant=plant)


def test_a_run_through_an_obstacle_between_samples_is_not_proved_clear() -> None:
    """Each step jumps over the wall."""
    arm = free_body(Sphere(name="disc", radius=0.01), "plane", [(-2.0, 2.0)] * 2, name="disc")
    world = World(arm, Scene([Box(name="wall", size=(0.02, 1.0, 1.0))]))
    goal = np.array([1.1, 0.0])
    run = simulate(
        world,
        Constant(np.array([1.0, 0.0])),
        np.array([-0.9, 0.0]),
        goal,
        plant=SingleIntegrator(arm, 0.2),
        parameters=Parameters(dt=0.2, time_limit=2.0),
    )
    assert (run.clearance > 0.05).all()
    swept = run.certificate.checks[0]
    assert (swept.name, swept.holds) == ("swept", False)
    assert swept.detail.startswith("contact at t = ")
    assert swept.detail.endswith("disc_0-wall")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("dt", 0.0),
        ("dt", np.nan),
        ("dt", "fast"),
        ("time_limit", -1.0),
        ("time_limit", 1e-6),
        ("time_limit", 1e9),
        ("hold_time", np.inf),
        ("stall_time", 0),
        ("control_divisor", 0),
        ("control_divisor", 1.5),
        ("integrator", "leapfrog"),
    ],
)
def test_parameters_are_checked(key: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        SimulationParameters(**{key: value})


def test_integrator_by_name_and_control_period() -> None:
    by_name: Any = "rk4"
    p = SimulationParameters(dt=0.002, integrator=by_name, control_divisor=3)
    assert p.integrator is Integrator.RK4
    assert p.control_period == pytest.approx(0.006)
