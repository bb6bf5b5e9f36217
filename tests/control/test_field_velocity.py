"""The planning system as a velocity controller, in the loop with a single integrator."""

from dataclasses import replace

import numpy as np
import pytest

import densarm
from densarm.errors import InvalidValueError
from densarm.proof.swept_check import SweptCheck, SweptVerdict
from densarm.simulation import FixedStepLoop, LoopEnd, SingleIntegrator


@pytest.fixture(scope="module")
def scenario():
    swing_up = densarm.load_scenario("swing_up")
    return replace(
        swing_up,
        control=replace(swing_up.control, form="regulation"),
        simulation=replace(swing_up.simulation, dt=0.01),
    )


def controller_and_bound(scenario):
    clearance = densarm.Clearance(scenario.arm, scenario.scene)
    plan = densarm.plan_motion(scenario, clearance, scenario.control.guide)
    return densarm.make_velocity_controller(scenario, plan), plan.bound


def test_drives_the_arm_to_its_goal_within_limits_and_proved_clear(scenario):
    arm = scenario.arm
    controller, bound = controller_and_bound(scenario)
    plant = SingleIntegrator(arm, scenario.simulation.dt)
    run = FixedStepLoop(arm, plant, scenario.simulation).run(
        controller, scenario.start, scenario.goal
    )
    assert run.end == LoopEnd.REACHED
    assert (np.abs(run.u) <= arm.limits.velocity * (1.0 + 1e-12)).all()
    assert SweptCheck(bound).check(run.q).verdict == SweptVerdict.CLEAR


def test_a_state_of_another_arm_is_refused(scenario):
    controller, _ = controller_and_bound(scenario)
    with pytest.raises(InvalidValueError, match="configuration"):
        controller.velocity(0.0, [0.0, 0.0], [0.0, 0.0])
