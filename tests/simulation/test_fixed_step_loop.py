"""The loop: its time grid, the torque it holds, and how it ends."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.configuration_space import EuclideanSpace
from densarm.control.saturated_velocity import SaturatedVelocity
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.implicit_function import UnsafeRegion
from densarm.density.implicit_shapes import Ball
from densarm.errors import InvalidValueError
from densarm.simulation import (
    FixedStepLoop,
    Integrator,
    LoopEnd,
    PinocchioPlant,
    SimulationParameters,
    SingleIntegrator,
)
from densarm.simulation.point_runs import run_points


@pytest.fixture(scope="module")
def arm():
    return load_arm("two_link")


def loop(arm, p):
    return FixedStepLoop(arm, PinocchioPlant(arm, p.dt, p.integrator), p)


class Servo:
    """Inverse dynamics to a fixed configuration, noting when it is called."""

    def __init__(self, arm, goal, rate=10.0):
        self.arm, self.goal, self.rate, self.calls = arm, goal, rate, []

    def torque(self, t, q, v):
        self.calls.append(t)
        error = self.arm.difference(q, self.goal)
        acceleration = self.rate**2 * error - 2 * self.rate * v
        return self.arm.mass_matrix(q) @ acceleration + self.arm.nonlinear_effects(q, v)


class Limp:
    def torque(self, t, q, v):  # noqa: ARG002
        return np.zeros(2)


class Proportional:
    """Velocity in proportion to the error."""

    def __init__(self, arm, goal):
        self.arm, self.goal = arm, goal

    def velocity(self, t, q, v):  # noqa: ARG002
        return 5.0 * self.arm.difference(q, self.goal)


def test_time_grid_torque_and_divisor(arm):
    p = SimulationParameters(dt=0.002, control_divisor=5, time_limit=0.1)
    controller = Servo(arm, arm.configuration([0.5, 0.5]))
    start = arm.configuration([0.1, 0.0])
    run = loop(arm, p).run(controller, start, controller.goal)
    assert run.end == LoopEnd.TIMED_OUT
    np.testing.assert_array_equal(run.time, 0.002 * np.arange(51))
    assert controller.calls == pytest.approx(0.01 * np.arange(10))
    np.testing.assert_array_equal(run.q[0], start)
    np.testing.assert_array_equal(run.v[0], 0.0)
    np.testing.assert_array_equal(np.ptp(run.u[:-1].reshape(10, 5, 2), axis=1), 0.0)
    np.testing.assert_array_equal(run.u[-1], run.u[-2])
    plant = PinocchioPlant(arm, p.dt, p.integrator)
    for k in range(50):  # tau[k] is held on [t_k, t_k+1)
        q, v = plant.step(run.q[k], run.v[k], run.u[k])
        np.testing.assert_array_equal(q, run.q[k + 1])
        np.testing.assert_array_equal(v, run.v[k + 1])


def test_ends_when_the_goal_is_reached_and_held(arm):
    p = SimulationParameters(hold_time=0.25)
    goal = arm.configuration([0.4, -0.3])
    run = loop(arm, p).run(Servo(arm, goal), arm.configuration([0, 0]), goal)
    assert run.end == LoopEnd.REACHED
    held = run.q[run.time >= run.time[-1] - 0.249], run.v[run.time >= run.time[-1] - 0.249]
    assert np.abs(arm.difference(goal, held[0])).max() <= 0.01
    assert np.abs(held[1]).max() <= 0.01


def test_passing_through_the_goal_is_not_reaching_it(arm):
    p = SimulationParameters(time_limit=2.0)
    run = loop(arm, p).run(Limp(), arm.configuration([0.5, 0.0]), arm.configuration([0, 0]))
    assert run.end == LoopEnd.TIMED_OUT


def test_at_rest_away_from_the_goal_is_a_stall_but_not_while_waiting(arm):
    hanging, goal = arm.configuration([0, 0]), arm.configuration([1, 0])
    p = SimulationParameters(stall_time=0.3)
    assert loop(arm, p).run(Limp(), hanging, goal).time[-1] == pytest.approx(0.3, abs=0.01)
    waiting = loop(arm, p).run(Limp(), hanging, goal, not_before=1.0)
    assert waiting.end == LoopEnd.STALLED
    assert waiting.time[-1] == pytest.approx(1.3, abs=0.01)


def test_progress_is_told(arm):
    told = []
    p = SimulationParameters(time_limit=1.0)
    start = arm.configuration([0.5, 0])
    loop(arm, p).run(Limp(), start, arm.configuration([0, 0]), on_progress=told.append)
    assert told == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.8])


def test_a_velocity_controller_drives_the_single_integrator(arm):
    p = SimulationParameters(dt=0.01, control_divisor=2)
    goal = arm.configuration([-3.0, 0.5])  # by way of the circle's cut
    run = FixedStepLoop(arm, SingleIntegrator(arm, p.dt), p).run(
        Proportional(arm, goal), arm.configuration([3.0, 0.0]), goal
    )
    assert run.end == LoopEnd.REACHED
    np.testing.assert_array_equal(run.v[1:], run.u[:-1])
    steps = arm.difference(run.q[:-1], run.q[1:])
    np.testing.assert_allclose(steps, 0.01 * run.u[:-1], rtol=0, atol=1e-12)
    assert (steps[:, 0] >= 0.0).all()  # the short way


def test_runs_on_euclidean_space_as_run_points_does():
    goal, start = np.array([3.0, 0.0]), np.array([-3.0, 0.5])
    density = EuclideanDensity([UnsafeRegion(Ball(1.0), Ball(2.0))], goal)
    p = SimulationParameters(dt=0.02)
    plane = EuclideanSpace(2)
    plant = SingleIntegrator(plane, p.dt)
    run = FixedStepLoop(plane, plant, p).run(SaturatedVelocity(density, 0.5), start, goal)
    assert run.end == LoopEnd.REACHED
    points = run_points(density, plant, start[np.newaxis], 0.5, 60.0, 0.1)
    np.testing.assert_array_equal(points.x[:, 0], run.q[: len(points.time)])


def test_a_plant_with_another_time_step_is_refused(arm):
    with pytest.raises(InvalidValueError, match="dt of the plant"):
        FixedStepLoop(arm, SingleIntegrator(arm, 0.01), SimulationParameters(dt=0.001))


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
def test_parameters_are_checked(key, value):
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        SimulationParameters(**{key: value})


def test_integrator_by_name():
    assert SimulationParameters(integrator="rk4").integrator is Integrator.RK4
