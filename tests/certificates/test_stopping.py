"""The stopping part refuses runs timed without regard to it, and it alone does."""

from dataclasses import replace

import numpy as np
import pytest

from densarm.certificates import certify
from densarm.clearance import Clearance
from densarm.control.computed_torque import ComputedTorque
from densarm.control.gains import Gains
from densarm.proof.stopping_check import StoppingCheck
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound
from densarm.reference import TimingParameters
from densarm.reference.smooth_path import smooth_path
from densarm.reference.timing import time_path
from densarm.scenario import load_scenario
from densarm.scene import Scene, Sphere
from densarm.simulation import FixedStepLoop, PinocchioPlant

BALL = Sphere(name="ball", radius=0.1, position=(1.487, 0.0, 1.337))


@pytest.fixture(scope="module")
def scenario():
    swing_up = load_scenario("swing_up")
    goal = swing_up.arm.configuration((2.4, -2.4))
    return replace(swing_up, scene=Scene([BALL]), goal=goal)


def failing(scenario, stopping):
    arm = scenario.arm
    corners = np.stack([scenario.start, arm.configuration((2.4, 0.0)), scenario.goal])
    path = smooth_path(SweptBound(Clearance(arm, Scene())), corners)
    reference = time_path(arm, path, 4.8, 0.001, TimingParameters(), stopping)
    controller = ComputedTorque(arm, reference, Gains())
    p = scenario.simulation
    loop = FixedStepLoop(arm, PinocchioPlant(arm, p.dt, p.integrator), p)
    run = loop.run(controller, scenario.start, scenario.goal, not_before=reference.duration)
    certificate = certify(scenario, run.time, run.q, run.v, run.u)
    return {check.name: check for check in certificate.checks if not check.holds}


def test_timed_without_brakes_in_mind(scenario):
    refused = failing(scenario, None)
    assert set(refused) == {"stopping"}
    assert "comes too near to a body" in refused["stopping"].detail
    assert refused["stopping"].margin is None
    assert 0.0 < refused["stopping"].time < 2.0


def test_timed_with_brakes_in_mind(scenario):
    bound = SweptBound(Clearance(scenario.arm, scenario.scene), 1e-3)
    brake = StraightBrake(scenario.arm, 0.9, 0.9)
    assert failing(scenario, StoppingCheck(bound, brake)) == {}
