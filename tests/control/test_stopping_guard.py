"""The guard: from a state that the arm can stop in, every state that follows is one too."""

import numpy as np
import pinocchio as pin
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.stopping_guard import StoppingGuard
from densarm.density.distance_bounds import ExactDistances
from densarm.fields import SpeedLaw, SpeedParameters
from densarm.proof.straight_brake import HELD_SHARE
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Scene, Sphere

ARM = load_arm("two_link")
BALLS = [
    Sphere(name=f"ball{k}", radius=0.3, position=(1.8 * np.sin(a), 0.0, -1.8 * np.cos(a)))
    for k, a in enumerate((1.2, -1.2, 2.6))
]
BOUND = SweptBound(Clearance(ARM, Scene(BALLS)))
DT = 0.002  # [s]


def exact(q):
    return ExactDistances(BOUND.clearance.distances(q))


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_contact_whatever_torque_is_asked_for(seed):
    rng = np.random.default_rng(seed)
    law = SpeedLaw(BOUND, SpeedParameters())
    guard = StoppingGuard(ARM, law, Gains(), DT)
    dynamics = InverseDynamics(ARM, HELD_SHARE * ARM.limits.acceleration)
    q, v = ARM.postures["hanging"], np.zeros(2)
    pull = rng.uniform(-10.0, 10.0, 2)
    for k in range(400):
        if k % 150 == 0:
            pull = rng.uniform(-10.0, 10.0, 2)
        distances = exact(q)
        assert (distances.distance > 0.0).all()
        dynamics.update(q, v)
        wanted = dynamics.torque(-0.2 * v, pull)
        tau = guard.torque(k * DT, dynamics, q, v, wanted, distances)
        assert (np.abs(tau) <= ARM.limits.effort).all()
        v = v + DT * pin.aba(ARM.model, ARM.data, q, v, tau)
        q = pin.integrate(ARM.model, q, DT * v)


def test_acceleration_changes_by_its_limit_within_a_fortieth_of_a_second_at_most():
    guard = StoppingGuard(ARM, SpeedLaw(BOUND, SpeedParameters()), Gains(), DT)
    dynamics = InverseDynamics(ARM, ARM.limits.acceleration)
    q, v, last = ARM.postures["hanging"], np.zeros(2), np.zeros(2)
    for k in range(60):
        dynamics.update(q, v)
        wanted = dynamics.torque(np.zeros(2), (-1) ** (k // 20) * ARM.limits.acceleration)
        tau = guard.torque(k * DT, dynamics, q, v, wanted, exact(q))
        a = pin.aba(ARM.model, ARM.data, q, v, tau).copy()
        assert (np.abs(a - last) <= ARM.limits.acceleration * DT * 40 * (1 + 1e-6)).all()
        v, last = v + DT * a, a
        q = pin.integrate(ARM.model, q, DT * v)
    assert np.abs(last).max() > 0.1
    dynamics.update(q, v)
    tau = guard.torque(1e3, dynamics, q, v, wanted, exact(q))
    a = pin.aba(ARM.model, ARM.data, q, v, tau)  # from zero again
    assert (np.abs(a) <= ARM.limits.acceleration * DT * 40 * (1 + 1e-6)).all()


def test_what_is_harmless_is_let_through():
    guard = StoppingGuard(ARM, SpeedLaw(BOUND, SpeedParameters()), Gains(), DT)
    dynamics = InverseDynamics(ARM, ARM.limits.acceleration)
    q, v = ARM.postures["hanging"], np.zeros(2)
    dynamics.update(q, v)
    wanted = dynamics.torque(v, np.array([0.5, 0.0]))
    assert guard.torque(0.0, dynamics, q, v, wanted, exact(q)) is wanted
