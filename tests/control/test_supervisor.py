"""Supervisor: invisible without faults; finite torque within limits whatever comes."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm, load_arm
from densarm.control.controller import Controller, Gains
from densarm.control.state_observer import Tolerances
from densarm.control.status import Fault
from densarm.control.supervisor import Supervisor
from densarm.control.tracking import DensityTracking
from densarm.errors import InvalidValueError
from densarm.planning.motion import Motion
from densarm.planning.plan import plan_motion
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.simulation.disturbances import Disturbances, Push
from densarm.simulation.plants import PinocchioPlant
from densarm.simulation.run import Run
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome

DT = 0.001  # [s]
USUAL = Tolerances()
ANYTHING = st.one_of(
    st.floats(), st.floats(-10.0, 10.0), st.sampled_from([0.0, 1.0, np.nan, np.inf, -np.inf, 1e300])
)

Seen = Callable[[Array, Array], tuple[Any, Any]]
Setting = tuple[Scenario, Controller]

known_arm = cache(load_arm)


class Constant:
    """A controller of one torque, or one that raises; it notes its times."""

    def __init__(self, tau: Any) -> None:
        self.tau, self.times = tau, list[float]()

    def torque(self, t: float, *_: Any) -> Any:
        self.times.append(t)
        if isinstance(self.tau, Exception):
            raise self.tau
        return self.tau


@pytest.fixture
def setting(swing_up: Scenario, make_controller: Callable[[str], Controller]) -> Setting:
    return swing_up, make_controller("tracking")


class Loop:
    """The swing-up under a supervisor, in a loop of one's own."""

    def __init__(self, setting: Setting, tolerances: Tolerances | None = USUAL) -> None:
        self.scenario, self.inner = setting
        self.arm = self.scenario.arm
        self.supervisor = Supervisor(self.arm, self.inner, DT, tolerances)
        self.data = self.arm.model.createData()
        self.k, self.q, self.v = 0, self.scenario.start, np.zeros(2)
        self.tau, self.push = np.zeros(2), np.zeros(2)

    def run(
        self,
        time: float,
        seen: Seen = lambda q, v: (q, v),
        t: Callable[[float], float] = lambda t: t,
    ) -> "Loop":
        """Go on for a time, the controller seeing what it is made to see."""
        for _ in range(round(time / DT)):
            self.tau = self.supervisor.torque(t(self.k * DT), *seen(self.q, self.v))
            assert is_allowed(self.arm, self.tau)
            self.pass_time(DT)
        return self

    def pass_time(self, time: float) -> None:
        for _ in range(round(time / DT)):
            a = pin.aba(self.arm.model, self.data, self.q, self.v, self.tau) + self.push
            self.v = self.v + DT * a
            self.q = pin.integrate(self.arm.model, self.q, DT * self.v)
            self.k += 1

    @property
    def fault(self) -> Fault:
        return self.supervisor.status.fault


def is_allowed(arm: Arm, tau: Array) -> bool:
    return bool(np.isfinite(tau).all() and (np.abs(tau) <= arm.limits.effort).all())


@pytest.mark.parametrize("tolerances", [USUAL, None], ids=["watching", "trusting"])
def test_without_a_fault_it_is_the_controller_bit_for_bit(
    setting: Setting, tolerances: Tolerances | None
) -> None:
    loop = Loop(setting, tolerances)
    for _ in range(2800):
        expected = loop.inner.torque(loop.k * DT, loop.q, loop.v)
        loop.run(DT)
        np.testing.assert_array_equal(loop.tau, expected)
    assert loop.fault == Fault.NONE
    assert loop.supervisor.status.sentence == "The controller acts."
    assert loop.supervisor.controller is loop.inner
    assert not loop.supervisor.is_at_rest
    assert loop.supervisor.trusts_state == (tolerances is not None)
    assert np.abs(loop.arm.difference(loop.q, loop.scenario.goal)).max() < 1e-3
    assert 0.0 < (loop.supervisor.tracking_error or 0.0) < 1e-3


# Watching: whatever comes.


@pytest.mark.parametrize("name", ["two_link", "panda"])
@settings(max_examples=30)
@given(data=st.data())
def test_whatever_comes_the_torque_is_finite_and_within_limits(
    name: str, data: st.DataObject
) -> None:
    arm = known_arm(name)
    supervisor = Supervisor(arm, Constant(np.zeros(arm.nv)), DT)
    for _ in range(data.draw(st.integers(1, 5))):
        t = data.draw(ANYTHING)
        q = data.draw(arrays(float, arm.nq, elements=ANYTHING))
        if data.draw(st.booleans()):  # a configuration, near or far from the last
            q = arm.configurations(np.resize(np.clip(np.nan_to_num(q), -1e5, 1e5), arm.nv))
        v = data.draw(arrays(float, arm.nv, elements=ANYTHING))
        assert is_allowed(arm, supervisor.torque(t, q, v))
        if not (np.isfinite(t) and np.isfinite(q).all() and np.isfinite(v).all()):
            assert supervisor.status.fault != Fault.NONE
            assert supervisor.status.sentence.endswith(".")


@pytest.mark.parametrize(
    ("t", "q", "v", "fault"),
    [
        (None, [1, 0, 1, 0], [0, 0], Fault.CLOCK),
        ("soon", [1, 0, 1, 0], [0, 0], Fault.CLOCK),
        (0.0, None, [0, 0], Fault.NOT_A_STATE),
        (0.0, "state", [0, 0], Fault.NOT_A_STATE),
        (0.0, [1, 0, 1], [0, 0], Fault.NOT_A_STATE),
        (0.0, [1, 0, 1, 0], [[0, 0], [0]], Fault.NOT_A_STATE),
        (0.0, [1, 0, 1, 0], [0, 1j], Fault.NOT_A_STATE),
        (0.0, [2, 0, 1, 0], [0, 0], Fault.NOT_A_STATE),
        (0.0, [1, 0, 1, 0], [1e4, 0], Fault.NOT_A_STATE),
    ],
)
def test_what_is_no_state_is_a_fault_and_no_error(
    setting: Setting, t: Any, q: Any, v: Any, fault: Fault
) -> None:
    arm = setting[0].arm
    supervisor = Supervisor(arm, setting[1], DT)
    assert is_allowed(arm, supervisor.torque(t, q, v))
    assert supervisor.status.fault == fault


def jumped(q: Array, v: Array) -> tuple[Array, Array]:
    return known_arm("two_link").integrate(q, np.array([0.3, -0.2])), v


@pytest.mark.parametrize(
    ("seen", "fault"),
    [
        (lambda q, _: (q, [np.nan, 0.0]), Fault.NOT_A_STATE),
        (lambda q, v: (np.inf * q, v), Fault.NOT_A_STATE),
        (jumped, Fault.JUMPED),
        (lambda q, v: (q, v + 2.0), Fault.JUMPED),
    ],
)
@pytest.mark.parametrize("fault_time", [0.005, 0.8])
def test_a_wrong_state_stops_the_arm_where_it_was_going(
    setting: Setting, seen: Seen, fault: Fault, fault_time: float
) -> None:
    loop = Loop(setting).run(0.36)
    q, v = loop.q, loop.v
    loop.run(fault_time, seen).run(0.8)
    assert np.abs(v).max() > 0.5
    assert loop.fault == fault
    assert loop.supervisor.is_at_rest
    assert loop.supervisor.trusts_state
    assert np.abs(loop.v).max() < 0.01
    assert np.abs(loop.arm.difference(q, loop.q)).max() < 1.0
    straight = 0.5 * v * np.abs(v / loop.arm.limits.acceleration).max()
    np.testing.assert_allclose(loop.arm.difference(q, loop.q), straight, rtol=0.1, atol=0.1)


def test_a_frozen_state_is_noticed(setting: Setting) -> None:
    loop = Loop(setting).run(0.6)
    state = loop.q, loop.v
    loop.run(0.02, lambda *_: state)
    assert loop.fault == Fault.FROZEN
    assert not loop.supervisor.trusts_state
    loop.run(0.8, lambda *_: state)
    assert np.abs(loop.v).max() < 0.01


def test_a_state_frozen_at_the_start_is_noticed(setting: Setting) -> None:
    loop = Loop(setting)
    loop.run(0.1, lambda *_: (loop.scenario.start, np.zeros(2)))
    assert loop.fault == Fault.FROZEN


@pytest.mark.parametrize("gap", [0.02, 0.05])
def test_a_late_call_stops_the_arm(setting: Setting, gap: float) -> None:
    loop = Loop(setting).run(0.6)
    loop.pass_time(gap)
    loop.run(0.8)
    assert loop.fault == Fault.LATE
    assert loop.supervisor.is_at_rest


def test_a_longer_gap_is_allowed_by_its_tolerance(setting: Setting) -> None:
    loop = Loop(setting, Tolerances(gap=0.01, tracking=0.1)).run(0.6)
    loop.pass_time(0.008)
    loop.run(0.01)
    assert loop.fault == Fault.NONE


def test_a_delayed_state_stops_the_arm(setting: Setting) -> None:
    loop = Loop(setting).run(0.6)
    past = [(loop.q, loop.v)] * 50

    def seen(q: Array, v: Array) -> tuple[Array, Array]:
        past.append((q, v))
        return past[-51]

    loop.run(1.5, seen)
    assert loop.fault == Fault.FROZEN
    assert np.abs(loop.v).max() < 0.01


def test_brakes_are_asked_for_while_a_gentle_stop_still_ends(setting: Setting) -> None:
    """Which is how a stop ends that a wrong state has begun and a right one gone on with."""
    loop = Loop(setting).run(0.6)
    loop.run(0.003, jumped).run(0.01)
    for _ in range(1000):
        if loop.supervisor.needs_brakes:
            break
        assert np.abs(loop.v).max() > 0.009
        loop.run(DT, lambda q, v: (np.nan * q, v))
    assert np.abs(loop.v).max() <= 0.01
    assert not loop.supervisor.is_at_rest
    loop.run(0.5)
    assert loop.supervisor.is_at_rest
    assert not loop.supervisor.needs_brakes


@pytest.mark.parametrize("wrong", [lambda v: np.nan * v, lambda v: v + 2.0, lambda v: 1e300 + v])
def test_an_arm_whose_velocities_are_wrong_for_good_is_held_by_its_positions(
    setting: Setting, wrong: Callable[[Array], Array]
) -> None:
    loop = Loop(setting).run(0.6)
    loop.run(1.5, lambda q, v: (q, wrong(v)))
    assert loop.supervisor.is_at_rest
    assert loop.supervisor.trusts_state
    assert not loop.supervisor.needs_brakes
    q = loop.q
    loop.push = np.array([0.3, -0.3])  # [rad/s²], as of a load that is not told
    loop.run(2.0, lambda q, v: (q, wrong(v)))
    assert np.abs(loop.arm.difference(q, loop.q)).max() < 0.02
    assert not loop.supervisor.resume()
    loop.run(0.1)
    assert loop.supervisor.resume()


@pytest.mark.parametrize("wrong", [lambda q: 1e300 + q, lambda q: q[:1], lambda q: 0.0 * q])
def test_positions_that_are_none_or_stand_still_tell_no_velocity(
    setting: Setting, wrong: Callable[[Array], Array]
) -> None:
    loop = Loop(setting).run(0.6)
    loop.run(1.5, lambda q, v: (wrong(q), np.nan * v))
    assert not loop.supervisor.trusts_state
    assert loop.supervisor.needs_brakes


@pytest.mark.parametrize("clock", [lambda _: np.nan, lambda t: t - 0.1])
def test_a_wrong_clock_stops_the_arm(setting: Setting, clock: Callable[[float], float]) -> None:
    loop = Loop(setting).run(0.6)
    loop.run(0.02, t=clock).run(0.8)
    assert loop.fault == Fault.CLOCK
    assert loop.supervisor.is_at_rest


@pytest.mark.parametrize(
    "tau",
    [np.full(2, np.nan), np.array([1e3, 0.0]), np.zeros(3), None, InvalidValueError("a", 1, "b")],
)
def test_a_controller_that_fails_stops_the_arm(setting: Setting, tau: Any) -> None:
    loop = Loop(setting).run(0.6)
    loop.supervisor.resume(Constant(tau))
    loop.run(0.8)
    assert loop.fault == Fault.NO_TORQUE
    assert loop.supervisor.is_at_rest


def test_an_arm_that_strays_from_its_motion_is_stopped(setting: Setting) -> None:
    loop = Loop(setting, Tolerances(position=0.5, velocity=5.0, tracking=0.003))
    loop.push = np.array([20.0, 0.0])  # [rad/s²], more than torque can answer at once
    loop.run(0.3)
    assert loop.fault == Fault.OFF_COURSE
    assert "reference" in loop.supervisor.status.sentence
    assert loop.supervisor.tracking_error == 0.0
    loop.push = np.zeros(2)
    loop.run(1.2)
    assert loop.supervisor.is_at_rest
    assert loop.supervisor.trusts_state


def test_another_scene_needs_another_plan(setting: Setting) -> None:
    loop = Loop(setting).run(0.6)
    loop.supervisor.scene_changed("A box has come.")
    loop.run(0.8)
    assert loop.fault == Fault.SCENE_CHANGED
    assert loop.supervisor.status.sentence == "A box has come."
    assert loop.supervisor.is_at_rest
    assert not loop.supervisor.resume()
    assert loop.supervisor.resume(Constant(np.zeros(2)))
    loop.supervisor.stop()
    loop.run(0.8)
    assert loop.supervisor.resume()


def test_stops_when_asked_and_resumes_when_asked(setting: Setting) -> None:
    loop = Loop(setting).run(0.6)
    loop.supervisor.stop("A box has come.")
    assert loop.supervisor.status.sentence == "A box has come."
    assert not loop.supervisor.resume()
    loop.run(0.8)
    assert loop.fault == Fault.STOPPED
    assert loop.supervisor.resume(Constant(np.zeros(2)))
    loop.run(0.05)
    assert loop.supervisor.status.fault == Fault.NONE
    np.testing.assert_array_equal(loop.tau, 0.0)


def test_the_first_fault_is_told_until_it_resumes(setting: Setting) -> None:
    loop = Loop(setting).run(0.6)
    loop.supervisor.stop("First.")
    loop.supervisor.stop("Second.")
    loop.run(0.01, lambda q, v: (np.nan * q, v))
    assert (loop.fault, loop.supervisor.status.sentence) == (Fault.STOPPED, "First.")
    loop.run(0.9)
    assert loop.supervisor.resume()
    assert loop.fault == Fault.NONE


def test_goes_on_along_a_new_plan_by_its_own_time(setting: Setting) -> None:
    loop = Loop(setting).run(0.6).run(0.01, lambda q, v: (np.nan * q, v)).run(0.8)
    world, goal = loop.scenario.world, loop.scenario.goal
    motion = plan_motion(world, loop.q, goal)
    assert loop.supervisor.resume(DensityTracking(world, motion))
    loop.run(motion.duration + 0.3)
    assert loop.fault == Fault.NONE
    assert np.abs(loop.arm.difference(loop.q, goal)).max() < 1e-3


def test_does_not_resume_while_the_state_is_wrong(setting: Setting) -> None:
    loop = Loop(setting).run(0.6).run(0.8, lambda q, v: (np.nan * q, v))
    assert loop.supervisor.is_at_rest
    assert not loop.supervisor.resume()


def test_before_the_first_state_there_is_no_torque(setting: Setting) -> None:
    supervisor = Supervisor(setting[0].arm, setting[1], DT)
    np.testing.assert_array_equal(supervisor.torque(0.0, np.full(4, np.nan), np.zeros(2)), 0.0)


@pytest.mark.parametrize("key", ["position", "velocity", "memory", "tracking", "gap", "delay"])
@pytest.mark.parametrize("value", [0.0, np.nan, "long"])
def test_tolerances_are_checked(key: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        Tolerances(**{key: value})


@pytest.mark.parametrize("tolerances", [USUAL, None])
def test_the_period_is_checked(setting: Setting, tolerances: Tolerances | None) -> None:
    with pytest.raises(InvalidValueError, match=r"^period = "):
        Supervisor(setting[0].arm, setting[1], 0.0, tolerances)


# Trusting: it passes on, and stops when told to.


def test_trusting_it_lets_everything_through(setting: Setting) -> None:
    arm = setting[0].arm
    error, wild = RuntimeError("no battery"), np.array([1e9, np.nan])
    supervisor = Supervisor(arm, Constant(wild), DT, None)
    assert supervisor.torque(5.0, setting[0].start, [9e9, 0.0]) is wild
    assert supervisor.torque(0.0, setting[0].start, [0.0, 0.0]) is wild  # a clock that runs back
    assert supervisor.status.fault == Fault.NONE
    supervisor = Supervisor(arm, Constant(error), DT, None)
    with pytest.raises(RuntimeError, match="no battery"):
        supervisor.torque(0.0, setting[0].start, np.zeros(2))
    supervisor = Supervisor(arm, setting[1], DT, None)
    with pytest.raises(InvalidValueError, match="velocity"):
        supervisor.torque(0.0, setting[0].start, [np.nan, 0.0])


def test_trusting_it_stops_holds_and_resumes_with_a_time_that_begins_at_zero(
    setting: Setting,
) -> None:
    loop = Loop(setting, None).run(0.6)
    q, v = loop.q, loop.v
    loop.supervisor.stop()
    assert (loop.fault, loop.supervisor.is_at_rest) == (Fault.STOPPED, False)
    assert not loop.supervisor.resume()
    loop.run(0.8)
    assert loop.supervisor.is_at_rest
    assert loop.supervisor.trusts_state
    straight = 0.5 * v * np.abs(v / loop.arm.limits.acceleration).max()
    np.testing.assert_allclose(loop.arm.difference(q, loop.q), straight, rtol=0.1, atol=0.1)
    held = loop.arm.nonlinear_effects(loop.q, np.zeros(2))
    np.testing.assert_allclose(loop.tau, held, atol=0.01)
    rest = loop.q
    loop.run(0.5)
    assert np.abs(loop.arm.difference(rest, loop.q)).max() < 1e-3
    second = Constant(held)
    assert loop.supervisor.resume(second)
    assert loop.supervisor.controller is second
    loop.run(0.003)
    np.testing.assert_allclose(second.times, [0.0, DT, 2 * DT], atol=1e-12)
    np.testing.assert_array_equal(loop.tau, held)


def test_trusting_it_refuses_a_state_that_is_none_while_it_stops(setting: Setting) -> None:
    loop = Loop(setting, None).run(0.6)
    loop.supervisor.stop()
    with pytest.raises(InvalidValueError, match="configuration"):
        loop.supervisor.torque(loop.k * DT, np.full(4, np.nan), loop.v)


def test_the_first_controller_keeps_the_callers_time_and_again_after_a_stop(
    setting: Setting,
) -> None:
    first = Constant(np.zeros(2))
    supervisor = Supervisor(setting[0].arm, first, DT, None)
    state = setting[0].start, np.zeros(2)
    supervisor.torque(3.0, *state)
    supervisor.stop()
    supervisor.torque(3.1, *state)
    assert supervisor.is_at_rest
    assert supervisor.resume()
    supervisor.torque(3.2, *state)
    assert first.times == [3.0, 3.2]


class Recorded:
    """Replays the torque of a run."""

    def __init__(self, run: Run) -> None:
        self.run = run

    def torque(self, t: float, *_: Any) -> Array:
        return np.asarray(self.run.tau[round(t / DT)])


@pytest.fixture(scope="module", params=["swing_up", "panda_table", "panda_shelf"])
def recorded(request: pytest.FixtureRequest, catalogue_run: Callable[[str], Run]) -> Run:
    return catalogue_run(request.param)


def stopped(recorded: Run, begin: int) -> tuple[Array, Array, Array]:
    """States after a stop at a sample of a run, and their torques."""
    arm, simulation = recorded.task.arm, recorded.task.simulation
    plant = PinocchioPlant(arm, simulation.dt, simulation.integrator)
    supervisor = Supervisor(
        arm, Recorded(recorded), simulation.control_period, tolerances=None, gains=Gains()
    )
    q, v, states, torques = recorded.q[begin], recorded.v[begin], [], []
    torque = supervisor.torque(recorded.time[begin], q, v)
    assert supervisor.status.fault == Fault.NONE
    np.testing.assert_array_equal(torque, recorded.tau[begin])
    supervisor.stop()
    for k in range(700):
        tau = supervisor.torque(recorded.time[begin] + k * simulation.dt, q, v)
        states.append((q, v))
        torques.append(tau)
        q, v = plant.step(q, v, tau)
    return np.array([s[0] for s in states]), np.array([s[1] for s in states]), np.array(torques)


@pytest.mark.slow
def test_stop_at_any_time(recorded: Run) -> None:
    """No contact, limits held, a straight line, and then rest."""
    arm, dt = recorded.task.arm, recorded.task.simulation.dt
    world = Scenario.of_task(recorded.task).world
    for begin in np.linspace(0, len(recorded.q) - 2, 8).astype(int):
        q, v, tau = stopped(recorded, begin)
        assert min(world.distances(x).min() for x in q[::20]) > 0.0
        assert (np.abs(v) <= arm.limits.velocity).all()
        assert (np.abs(np.diff(v, axis=0)) / dt <= arm.limits.acceleration * (1 + 1e-9)).all()
        assert (np.abs(tau) <= arm.limits.effort).all()
        assert np.abs(v[-1]).max() < 5e-5
        path, direction = arm.difference(q[:1], q), v[0] / max(np.linalg.norm(v[0]), 1e-9)
        off = path - np.outer(path @ direction, direction)
        assert np.abs(off).max() < 1e-3
        assert np.abs(arm.difference(q[-100], q[-1])).max() < 1e-5


# In the tube of a motion.


class Panda:
    """The Panda on its way out of the shelf, under a supervisor, in a disturbed plant."""

    def __init__(self, scenario: Scenario, motion: Motion, **keywords: Any) -> None:
        world = scenario.world
        self.tracking = DensityTracking(world, motion)
        self.supervisor = Supervisor(scenario.arm, self.tracking, DT, **keywords)
        self.motion, self.scenario = motion, scenario
        self.faults: list[Fault] = []
        self.goal, self.is_moving = scenario.goal, True
        self.stop_at, self.at_once = math.inf, False
        self.seen: Callable[[float, Any], Any] = lambda _, q: q
        self.off: list[Array] = []

    def torque(self, t: float, q: Any, v: Any) -> Array:
        if t >= self.stop_at:
            self.supervisor.stop(at_once=self.at_once)
            self.stop_at = math.inf
        tau = self.supervisor.torque(t, self.seen(t, q), v)
        if not self.faults or self.faults[-1] != self.supervisor.status.fault:
            self.faults.append(self.supervisor.status.fault)
        self.off.append(self.scenario.arm.angles(q) - self.tracking.reference)
        return tau

    def run(self, time: float, **disturbances: Any) -> Run:
        parameters = replace(self.scenario.simulation, time_limit=time, stall_time=time)
        told, start = Disturbances(**disturbances), self.scenario.start
        world = self.scenario.world
        return simulate(world, self, start, disturbances=told, parameters=parameters)

    @property
    def share(self) -> float:
        """Of the tube, that was used."""
        assert self.motion.tube is not None
        return float((np.abs(self.off) / self.motion.tube).max())


@pytest.fixture(scope="module")
def shelf() -> tuple[Scenario, Motion]:
    scenario = load_scenario("panda_shelf")
    return scenario, plan_motion(scenario.world, scenario.start, scenario.goal)


@pytest.mark.slow
@pytest.mark.parametrize(
    "told",
    [
        {"mass_scale": 1.1},
        {"payload": 1.0},
        {"coulomb": 0.5},
        {"pushes": (Push(0.5, "panda_joint1", 0.2, 0.02),)},
    ],
)
def test_nothing_inside_the_tube_is_a_fault(
    shelf: tuple[Scenario, Motion], told: dict[str, Any]
) -> None:
    panda = Panda(*shelf)
    assert panda.run(3.0, **told).outcome == Outcome.REACHED
    assert panda.faults == [Fault.NONE]
    assert panda.share < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("payload", [0.0, 1.0])
def test_stops_on_the_motion_and_goes_on(shelf: tuple[Scenario, Motion], payload: float) -> None:
    panda = Panda(*shelf)
    panda.stop_at = 0.5
    told = {"payload": payload} if payload else {}
    run = panda.run(1.4, **told)
    arm = run.task.arm
    assert panda.faults == [Fault.NONE, Fault.STOPPED]
    assert panda.supervisor.is_at_rest
    assert panda.tracking.is_paused
    assert 0.5 < panda.tracking.reference_time < 0.7
    assert panda.share < 0.9
    gravity = [pin.computeGeneralizedGravity(arm.model, arm.data, q).copy() for q in run.q]
    rate = np.abs(np.diff(run.tau - gravity, axis=0))[:-1]
    assert rate.max() <= 1.0 + 1e-6
    assert (np.abs(np.diff(run.v, axis=0)) / DT <= arm.limits.acceleration).all()
    assert panda.supervisor.resume()
    q, v = run.q[-1], run.v[-1]
    panda.supervisor.torque(run.time[-1], q, v)
    assert panda.tracking.reference_time < 0.7


@pytest.mark.slow
@pytest.mark.parametrize("payload", [1.0, 3.0])
def test_an_unknown_payload_does_not_sag_when_another_takes_over(
    shelf: tuple[Scenario, Motion], payload: float
) -> None:
    panda = Panda(*shelf)
    panda.stop_at, panda.at_once = 0.02, True
    run = panda.run(1.0, payload=payload)
    sag = run.task.arm.angles(run.q[25:]) - run.task.arm.angles(run.q[25])
    assert np.abs(sag).max() < 0.02
    still = run.task.arm.angles(run.q[500:]) - run.task.arm.angles(run.q[-1])
    assert np.abs(still).max() < 1e-3


@pytest.mark.slow
def test_resumes_by_itself_on_its_motion(shelf: tuple[Scenario, Motion]) -> None:
    """A late call at 0.2 s, before the arm is fast, is braked; then it goes on where it is."""
    panda = Panda(*shelf, patience=0.1)
    lost = np.full(7, np.nan)
    panda.seen = lambda t, q: lost if 0.2 <= t < 0.203 else q
    run = panda.run(6.0)
    assert run.outcome == Outcome.REACHED
    assert panda.faults == [Fault.NONE, Fault.NOT_A_STATE, Fault.NONE]


def test_the_patience_is_checked(setting: Setting) -> None:
    with pytest.raises(InvalidValueError, match="patience"):
        Supervisor(setting[0].arm, setting[1], patience=0.0)
