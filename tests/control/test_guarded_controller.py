"""GuardedController: invisible without faults; finite torque within limits whatever comes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.closed_loop import make_controller
from densarm.control.guard_status import GuardWord
from densarm.control.guard_tolerances import GuardTolerances
from densarm.control.guarded_controller import GuardedController
from densarm.errors import InvalidValueError
from densarm.motion_plan import plan_motion
from densarm.scenario import GuideKind, load_scenario

DT = 0.001  # [s]
ANYTHING = st.one_of(
    st.floats(), st.floats(-10.0, 10.0), st.sampled_from([0.0, 1.0, np.nan, np.inf, -np.inf, 1e300])
)


known_arm = cache(load_arm)


class Constant:
    """A controller of one torque, or one that raises."""

    def __init__(self, tau):
        self.tau = tau

    def torque(self, *_):
        if isinstance(self.tau, Exception):
            raise self.tau
        return self.tau


@pytest.fixture(scope="module")
def setting():
    scenario = load_scenario("swing_up")
    clearance = Clearance(scenario.arm, scenario.scene)
    return scenario, make_controller(scenario, plan_motion(scenario, clearance, GuideKind.PATH))


class Loop:
    """The swing-up under a guard, in a loop of one's own."""

    def __init__(self, setting):
        self.scenario, self.inner = setting
        self.arm = self.scenario.arm
        self.guarded = GuardedController(self.arm, self.inner, DT)
        self.data = self.arm.model.createData()
        self.k, self.q, self.v = 0, self.scenario.start, np.zeros(2)
        self.tau, self.push = np.zeros(2), np.zeros(2)

    def run(self, time, seen=lambda q, v: (q, v), t=lambda t: t):
        """Go on for a time, the controller seeing what it is made to see."""
        for _ in range(round(time / DT)):
            self.tau = self.guarded.torque(t(self.k * DT), *seen(self.q, self.v))
            assert is_allowed(self.arm, self.tau)
            self.pass_time(DT)
        return self

    def pass_time(self, time):
        for _ in range(round(time / DT)):
            a = pin.aba(self.arm.model, self.data, self.q, self.v, self.tau) + self.push
            self.v = self.v + DT * a
            self.q = pin.integrate(self.arm.model, self.q, DT * self.v)
            self.k += 1


def is_allowed(arm, tau):
    return np.isfinite(tau).all() and (np.abs(tau) <= arm.limits.effort).all()


def test_without_a_fault_it_is_the_controller(setting):
    loop = Loop(setting)
    for _ in range(2500):
        expected = loop.inner.torque(loop.k * DT, loop.q, loop.v)
        loop.run(DT)
        np.testing.assert_array_equal(loop.tau, expected)
    assert loop.guarded.status.word == GuardWord.ACTING
    assert loop.guarded.trusts_state
    assert not loop.guarded.is_at_rest
    assert np.abs(loop.arm.difference(loop.q, loop.scenario.goal)).max() < 1e-3


@pytest.mark.parametrize("name", ["two_link", "panda"])
@settings(max_examples=60)
@given(data=st.data())
def test_whatever_comes_the_torque_is_finite_and_within_limits(name, data):
    arm = known_arm(name)
    guarded = GuardedController(arm, Constant(np.zeros(arm.nv)), DT)
    for _ in range(data.draw(st.integers(1, 5))):
        t = data.draw(ANYTHING)
        q = data.draw(arrays(float, arm.nq, elements=ANYTHING))
        if data.draw(st.booleans()):  # a configuration, near or far from the last
            q = arm.configurations(np.resize(np.clip(np.nan_to_num(q), -1e5, 1e5), arm.nv))
        v = data.draw(arrays(float, arm.nv, elements=ANYTHING))
        assert is_allowed(arm, guarded.torque(t, q, v))
        if not (np.isfinite(t) and np.isfinite(q).all() and np.isfinite(v).all()):
            assert guarded.status.word != GuardWord.ACTING
            assert guarded.status.sentence.endswith(".")


@pytest.mark.parametrize(
    ("t", "q", "v"),
    [
        (None, [1, 0, 1, 0], [0, 0]),
        (0.0, None, [0, 0]),
        (0.0, "state", [0, 0]),
        (0.0, [1, 0, 1], [0, 0]),
        (0.0, [1, 0, 1, 0], [[0, 0], [0]]),
        (0.0, [1, 0, 1, 0], [0, 1j]),
        (0.0, [2, 0, 1, 0], [0, 0]),
        (0.0, [1, 0, 1, 0], [1e4, 0]),
    ],
)
def test_what_is_no_state_is_a_fault_and_no_error(setting, t, q, v):
    arm = setting[0].arm
    guarded = GuardedController(arm, setting[1], DT)
    assert is_allowed(arm, guarded.torque(t, q, v))
    assert guarded.status.word in {GuardWord.NOT_A_STATE, GuardWord.CLOCK}


def jumped(q, v):
    return known_arm("two_link").integrate(q, np.array([0.3, -0.2])), v


@pytest.mark.parametrize(
    ("seen", "word"),
    [
        (lambda q, _: (q, [np.nan, 0.0]), GuardWord.NOT_A_STATE),
        (lambda q, v: (np.inf * q, v), GuardWord.NOT_A_STATE),
        (jumped, GuardWord.JUMPED),
        (lambda q, v: (q, v + 2.0), GuardWord.JUMPED),
    ],
)
@pytest.mark.parametrize("fault_time", [0.005, 0.8])
def test_a_wrong_state_stops_the_arm_where_it_was_going(setting, seen, word, fault_time):
    loop = Loop(setting).run(0.4)
    q, v = loop.q, loop.v
    loop.run(fault_time, seen).run(0.8)
    assert np.abs(v).max() > 0.5
    assert loop.guarded.status.word == word
    assert loop.guarded.is_at_rest
    assert loop.guarded.trusts_state
    assert np.abs(loop.v).max() < 0.01
    assert np.abs(loop.arm.difference(q, loop.q)).max() < 1.0
    straight = 0.5 * v * np.abs(v / loop.arm.limits.acceleration).max()
    np.testing.assert_allclose(loop.arm.difference(q, loop.q), straight, rtol=0.1, atol=0.1)


def test_a_frozen_state_is_noticed(setting):
    loop = Loop(setting).run(0.6)
    state = loop.q, loop.v
    loop.run(0.02, lambda *_: state)
    assert loop.guarded.status.word == GuardWord.FROZEN
    assert not loop.guarded.trusts_state
    loop.run(0.8, lambda *_: state)
    assert np.abs(loop.v).max() < 0.01


def test_a_state_frozen_at_the_start_is_noticed(setting):
    loop = Loop(setting)
    loop.run(0.1, lambda *_: (loop.scenario.start, np.zeros(2)))
    assert loop.guarded.status.word == GuardWord.FROZEN


@pytest.mark.parametrize("gap", [0.02, 0.05])
def test_a_late_call_stops_the_arm(setting, gap):
    loop = Loop(setting).run(0.6)
    loop.pass_time(gap)
    loop.run(0.8)
    assert loop.guarded.status.word == GuardWord.LATE
    assert loop.guarded.is_at_rest


def test_a_delayed_state_stops_the_arm(setting):
    loop = Loop(setting).run(0.6)
    past = [(loop.q, loop.v)] * 50

    def seen(q, v):
        past.append((q, v))
        return past[-51]

    loop.run(1.5, seen)
    assert loop.guarded.status.word in {GuardWord.FROZEN, GuardWord.JUMPED}
    assert np.abs(loop.v).max() < 0.01


@pytest.mark.parametrize("clock", [lambda _: np.nan, lambda t: t - 0.1])
def test_a_wrong_clock_stops_the_arm(setting, clock):
    loop = Loop(setting).run(0.6)
    loop.run(0.02, t=clock).run(0.8)
    assert loop.guarded.status.word == GuardWord.CLOCK
    assert loop.guarded.is_at_rest


@pytest.mark.parametrize(
    "tau",
    [np.full(2, np.nan), np.array([1e3, 0.0]), np.zeros(3), None, InvalidValueError("a", 1, "b")],
)
def test_a_controller_that_fails_stops_the_arm(setting, tau):
    loop = Loop(setting).run(0.6)
    loop.guarded.resume(Constant(tau))
    loop.run(0.8)
    assert loop.guarded.status.word == GuardWord.NO_TORQUE
    assert loop.guarded.is_at_rest


def test_an_arm_that_strays_from_its_reference_is_stopped(setting):
    loop = Loop(setting)
    loop.guarded = GuardedController(loop.arm, loop.inner, DT, GuardTolerances(tracking=0.003))
    loop.push = np.array([3.0, 0.0])  # [rad/s²], which the observer takes for normal
    loop.run(0.8)
    assert loop.guarded.status.word == GuardWord.OFF_COURSE
    assert "reference" in loop.guarded.status.sentence
    loop.push = np.zeros(2)
    loop.run(0.8)
    assert loop.guarded.is_at_rest
    assert loop.guarded.trusts_state


def test_another_scene_needs_another_plan(setting):
    loop = Loop(setting).run(0.6)
    loop.guarded.scene_changed("A box has come.")
    loop.run(0.8)
    assert loop.guarded.status.word == GuardWord.SCENE_CHANGED
    assert loop.guarded.status.sentence == "A box has come."
    assert loop.guarded.is_at_rest
    assert not loop.guarded.resume()
    assert loop.guarded.resume(Constant(np.zeros(2)))
    loop.guarded.stop()
    loop.run(0.8)
    assert loop.guarded.resume()


def test_stops_when_asked_and_resumes_when_asked(setting):
    loop = Loop(setting).run(0.6)
    loop.guarded.stop("A box has come.")
    assert loop.guarded.status.sentence == "A box has come."
    assert not loop.guarded.resume()
    loop.run(0.8)
    assert loop.guarded.status.word == GuardWord.STOPPED
    assert loop.guarded.resume(Constant(np.zeros(2)))
    loop.run(0.05)
    assert loop.guarded.status.word == GuardWord.ACTING
    np.testing.assert_array_equal(loop.tau, 0.0)


def test_goes_on_along_a_new_plan(setting):
    loop = Loop(setting).run(0.6).run(0.01, lambda q, v: (np.nan * q, v)).run(0.8)
    scenario = replace(loop.scenario, start=loop.q)
    clearance = Clearance(scenario.arm, scenario.scene)
    plan = plan_motion(scenario, clearance, GuideKind.PATH)
    assert loop.guarded.resume(make_controller(scenario, plan))
    loop.k = 0
    loop.run(plan.reference.duration + 0.3)
    assert loop.guarded.status.word == GuardWord.ACTING
    assert np.abs(loop.arm.difference(loop.q, scenario.goal)).max() < 1e-3


def test_does_not_resume_while_the_state_is_wrong(setting):
    loop = Loop(setting).run(0.6).run(0.8, lambda q, v: (np.nan * q, v))
    assert loop.guarded.is_at_rest
    assert not loop.guarded.resume()


def test_before_the_first_state_there_is_no_torque(setting):
    guarded = GuardedController(setting[0].arm, setting[1], DT)
    np.testing.assert_array_equal(guarded.torque(0.0, np.full(4, np.nan), np.zeros(2)), 0.0)


@pytest.mark.parametrize("key", ["position", "velocity", "memory", "tracking", "gap", "delay"])
@pytest.mark.parametrize("value", [0.0, np.nan, "long"])
def test_tolerances_are_checked(key, value):
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        GuardTolerances(**{key: value})


def test_the_period_is_checked(setting):
    with pytest.raises(InvalidValueError, match=r"^period = "):
        GuardedController(setting[0].arm, setting[1], 0.0)
