"""The torque in one kernel is the one of its parts, whoever sleeps."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.bench.swing_among_spheres import clearance_among_spheres, swing
from densarm.control.density_tracking import DensityTracking
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.density import (
    ClearanceSet,
    DensityParameters,
    JointLimitSet,
    NavigationDensity,
    NearClearanceSet,
    NearPairs,
    TorusDistance,
)
from densarm.proof.straight_brake import HELD_SHARE
from densarm.proof.swept_bound import SweptBound

ARM = load_arm("panda", shapes="capsule")
REFERENCE = swing(ARM)
GAINS = Gains()
SENSING = 0.05  # [m]


@pytest.fixture(scope="module")
def clearance():
    return clearance_among_spheres(ARM, REFERENCE, 64)


def near_set(clearance):
    return NearClearanceSet(NearPairs(SweptBound(clearance)), 0.0, SENSING)


def density_with(unsafe_set) -> NavigationDensity:
    goal = TorusDistance(ARM, ARM.configuration(REFERENCE.position[-1]))
    return NavigationDensity([unsafe_set, JointLimitSet(ARM, 0.1)], goal, DensityParameters())


def states():
    """Times and states near the reference, near enough to spheres that they are sensed."""
    random = np.random.default_rng(0)
    for k in range(0, len(REFERENCE.position), 5):
        off = 0.02 * random.normal(size=(2, ARM.nv))
        q = ARM.configuration(REFERENCE.position[k] + off[0])
        yield k * REFERENCE.period, q, REFERENCE.velocity[k] + off[1]


def test_torque_is_that_of_its_parts(clearance):
    controller = DensityTracking(ARM, density_with(near_set(clearance)), REFERENCE, GAINS)
    density = density_with(ClearanceSet(clearance, 0.0, SENSING))
    dynamics = InverseDynamics(ARM, HELD_SHARE * ARM.limits.acceleration)
    attract, sensed = np.zeros(ARM.nv), 0
    for t, q, v in states():
        point = REFERENCE.update(t, lead=0.5 * REFERENCE.period)
        density.goal_distance.set_goal_angles(point[0])
        density.update(q)
        density.write_gradient(density.parameters.gauge, attract)
        dynamics.update(q, v)
        brake = point[2] - GAINS.velocity * (v - point[1])
        expected = dynamics.torque(brake, GAINS.position * attract)
        np.testing.assert_allclose(controller.torque(t, q, v), expected, rtol=1e-12, atol=1e-12)
        sensed += density.log_psi < 0.0
    assert sensed > 10


def test_torque_is_that_of_all_pairs_to_the_last_bit(clearance):
    sets = near_set(clearance), near_set(clearance)
    sleeping, every = (DensityTracking(ARM, density_with(s), REFERENCE, GAINS) for s in sets)
    slept = 0
    for state in states():
        sets[1].pairs.wake_all()
        np.testing.assert_array_equal(sleeping.torque(*state), every.torque(*state))
        slept += np.count_nonzero(sets[0].pairs.state == 0)
    assert slept > 0
