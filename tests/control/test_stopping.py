"""Stopping: a straight line and then rest, and a filter that keeps the arm able to stop."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.control.controller import Gains
from densarm.control.inverse_dynamics import TRUSTED, InverseDynamics
from densarm.control.speed_law import SpeedLaw
from densarm.control.stopping import BackupFilter, StopAndHold
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ExactDistances
from densarm.world.stopping import HELD_SHARE, StoppingTrajectory
from densarm.world.world import World

ARM = load_arm("two_link")
BALLS = [
    Sphere(name=f"ball{k}", radius=0.3, position=(1.8 * np.sin(a), 0.0, -1.8 * np.cos(a)))
    for k, a in enumerate((1.2, -1.2, 2.6))
]
WORLD = World(ARM, Scene(BALLS))
DT = 0.002  # [s]
REST = np.zeros(2)


def exact(q: Array) -> ExactDistances:
    return ExactDistances(WORLD.distances(q))


def step(arm: Arm, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
    v = v + DT * pin.aba(arm.model, arm.data, q, v, tau)
    return arm.integrate(q, DT * v), v


# Stop and hold.


@settings(max_examples=15)
@given(angles=st.tuples(*[st.floats(-3.0, 3.0)] * 2), v=st.tuples(*[st.floats(-2.0, 2.0)] * 2))
def test_it_stops_on_a_straight_line_in_the_time_of_the_trajectory_and_holds(
    angles: tuple[float, float], v: tuple[float, float]
) -> None:
    stop = StopAndHold(ARM, Gains(), DT)
    q, velocity = ARM.configuration(angles), np.array(v)
    start, begun = q, velocity.copy()
    duration = StoppingTrajectory(ARM, 0.97).duration(q, velocity)
    stop.begin(q, velocity)
    assert not stop.is_holding
    for k in range(round(duration / DT) + 150):
        tau = stop.torque(q, velocity, DT if k else 0.0)
        assert (np.abs(tau) <= ARM.limits.effort).all()
        before = velocity
        q, velocity = step(ARM, q, velocity, tau)
        acceleration = np.abs(velocity - before) / DT
        assert (acceleration <= ARM.limits.acceleration * (1.0 + 1e-6)).all()
    assert stop.is_holding
    assert np.abs(velocity).max() < 1e-2
    way = ARM.difference(start, q)
    np.testing.assert_allclose(way, 0.5 * duration * begun, rtol=0, atol=0.02)


def test_a_second_stop_remembers_no_disturbance_of_the_first() -> None:
    stop, ways = StopAndHold(ARM, Gains(), DT), []
    for begun in (REST, np.array([1.0, -1.0]), np.array([1.0, -1.0])):
        v, q, start = begun, ARM.configuration([0.3, -0.2]), ARM.configuration([0.3, -0.2])
        stop.begin(q, v)
        for k in range(400):
            q, v_next = step(ARM, q, v, stop.torque(q, v, DT if k else 0.0))
            change, v = np.abs(v_next - v) / DT, v_next
            assert (change <= ARM.limits.acceleration * (1.0 + 1e-6)).all()
        ways.append(ARM.difference(start, q))
    np.testing.assert_allclose(ways[2], ways[1], rtol=0, atol=1e-4)


def test_a_brake_ends_at_once_whatever_torque_rate_the_arm_has() -> None:
    """Else its last torque would push the resting arm on, and off."""
    arm = load_arm("panda")
    stop, q, v = StopAndHold(arm, Gains(), 0.001), arm.postures["ready"], np.full(7, 0.8)
    stop.begin(q, v)
    for k in range(400):
        tau, before = stop.torque(q, v, 0.001 if k else 0.0), v
        v = v + 0.001 * pin.aba(arm.model, arm.data, q, v, tau)
        q = arm.integrate(q, 0.001 * v)
        change = np.abs(v - before) / 0.001
        assert (change <= arm.limits.acceleration * (1.0 + 1e-6)).all()
    assert stop.is_holding
    assert np.abs(v).max() < 1e-4


def test_a_gentle_stop_ends_in_damping() -> None:
    q, v = ARM.postures["hanging"], np.array([1e-2, -1e-2])
    hard, gentle = StopAndHold(ARM, Gains(), DT), StopAndHold(ARM, Gains(), DT)
    hard.begin(q, v)
    gentle.begin(q, v)
    gentle.begin_again(q, v)
    taus = [stop.torque(q, v, 0.0) for stop in (hard, gentle)]
    accelerations = [np.array(pin.aba(ARM.model, ARM.data, q, v, tau)) for tau in taus]
    np.testing.assert_allclose(accelerations[1], -Gains().velocity * v, rtol=1e-6)
    assert np.abs(accelerations[0]).max() > np.abs(accelerations[1]).max()


def test_a_push_while_it_holds_is_answered_by_the_gains() -> None:
    stop, q = StopAndHold(ARM, Gains(), DT, TRUSTED), ARM.configuration([0.4, -0.2])
    stop.begin(q, REST)
    stop.torque(q, REST, 0.0)
    assert stop.is_holding
    pushed, v = ARM.integrate(q, np.array([1e-3, -2e-3])), np.array([-1e-3, 0.0])
    tau = stop.torque(pushed, v, DT)
    a = pin.aba(ARM.model, ARM.data, pushed, v, tau)
    wanted = -Gains().position * np.array([1e-3, -2e-3]) - Gains().velocity * v
    np.testing.assert_allclose(a, wanted, rtol=1e-6, atol=1e-9)
    stop.begin(pushed, v)
    assert not stop.is_holding


# The backup filter.


@pytest.mark.slow
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_contact_whatever_torque_is_asked_for(seed: int) -> None:
    rng = np.random.default_rng(seed)
    backup = BackupFilter(ARM, SpeedLaw(WORLD, 0.0), Gains(), DT)
    dynamics = InverseDynamics(ARM, HELD_SHARE * ARM.limits.acceleration)
    q, v = ARM.postures["hanging"], np.zeros(2)
    pull = rng.uniform(-10.0, 10.0, 2)
    for k in range(400):
        if k % 150 == 0:
            pull = rng.uniform(-10.0, 10.0, 2)
        distances = exact(q)
        assert (distances.distance > 0.0).all()
        dynamics.update(math.nan, q, v)
        wanted = dynamics.torque(-0.2 * v, pull)
        tau = backup.torque(k * DT, dynamics, q, v, wanted, distances)
        assert (np.abs(tau) <= ARM.limits.effort).all()
        q, v = step(ARM, q, v, tau)


def test_acceleration_changes_by_its_limit_within_a_fortieth_of_a_second_at_most() -> None:
    backup = BackupFilter(ARM, SpeedLaw(WORLD, 0.0), Gains(), DT)
    dynamics = InverseDynamics(ARM, ARM.limits.acceleration)
    q, v, last = ARM.postures["hanging"], np.zeros(2), np.zeros(2)
    largest = ARM.limits.acceleration * DT * 40 * (1 + 1e-6)
    for k in range(60):
        dynamics.update(math.nan, q, v)
        wanted = dynamics.torque(REST, (-1) ** (k // 20) * ARM.limits.acceleration)
        tau = backup.torque(k * DT, dynamics, q, v, wanted, exact(q))
        a = np.array(pin.aba(ARM.model, ARM.data, q, v, tau))
        assert (np.abs(a - last) <= largest).all()
        last = a
        q, v = step(ARM, q, v, tau)
    assert np.abs(last).max() > 0.1
    dynamics.update(math.nan, q, v)
    tau = backup.torque(1e3, dynamics, q, v, wanted, exact(q))
    a = np.array(pin.aba(ARM.model, ARM.data, q, v, tau))  # from zero again
    assert (np.abs(a) <= largest).all()


def test_what_is_harmless_is_let_through() -> None:
    backup = BackupFilter(ARM, SpeedLaw(WORLD, 0.0), Gains(), DT)
    dynamics = InverseDynamics(ARM, ARM.limits.acceleration)
    q, v = ARM.postures["hanging"], np.zeros(2)
    dynamics.update(math.nan, q, v)
    wanted = dynamics.torque(v, np.array([0.5, 0.0]))
    passed = backup.torque(0.0, dynamics, q, v, wanted, exact(q))
    np.testing.assert_array_equal(passed, wanted)


@pytest.mark.parametrize("margin", [0.0, 0.2])
def test_the_margin_of_its_speed_law_is_kept(margin: float) -> None:
    """Swung at a ball by a torque that does not see it, the arm rests before the margin."""
    backup = BackupFilter(ARM, SpeedLaw(WORLD, margin), Gains(), DT)
    dynamics = InverseDynamics(ARM, HELD_SHARE * ARM.limits.acceleration)
    q, v, least = ARM.postures["hanging"], np.zeros(2), np.inf
    for k in range(1000):
        distances = exact(q)
        least = min(least, float(distances.distance.min()))
        dynamics.update(math.nan, q, v)
        wanted = dynamics.torque(-2.0 * v, np.array([2.0, 0.0]))
        q, v = step(ARM, q, v, backup.torque(k * DT, dynamics, q, v, wanted, distances))
    assert margin < least < margin + 0.1
