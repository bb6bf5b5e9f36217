"""Controllers load or compile their kernels when they are made, none in a control loop."""

import gc
from dataclasses import replace

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from densarm.clearance import Clearance
from densarm.closed_loop import make_controller, make_velocity_controller
from densarm.control.computed_torque import ComputedTorque
from densarm.control.guarded_controller import GuardedController
from densarm.errors import InvalidValueError
from densarm.guides import GuidePath
from densarm.motion_plan import MotionPlan
from densarm.proof.swept_bound import SweptBound
from densarm.reference.reference import Reference
from densarm.scenario import ControlForm, load_scenario


def kernels() -> list[Dispatcher]:
    found = [item for item in gc.get_objects() if isinstance(item, Dispatcher)]
    return [item for item in found if item.py_func.__module__.startswith("densarm")]


@pytest.fixture
def fresh():
    """Nothing is loaded, as in a new process."""
    for kernel in kernels():
        kernel._reset_overloads()


def loaded() -> dict[str, int]:
    return {str(item.py_func): len(item.overloads) for item in kernels() if item.overloads}


def plan_of(form: ControlForm) -> MotionPlan:
    scenario = load_scenario("swing_up")
    scenario = replace(scenario, control=replace(scenario.control, form=form))
    reference = None
    if form == ControlForm.TRACKING:
        angles = np.tile(scenario.arm.angles(scenario.start), (3, 1))
        reference = Reference(0.001, angles, np.zeros_like(angles))
    bound = SweptBound(Clearance(scenario.arm, scenario.scene))
    path = GuidePath(np.stack([scenario.start, scenario.goal]), is_clear=False)
    return MotionPlan(scenario, path, bound, reference)


def states(arm):
    """States as a caller may give them: arrays not to be written to, lists, parts of others."""
    q, v = arm.configuration([0.4, 0.3]), np.array([0.1, -0.2])
    fixed = q.copy(), v.copy()
    for array in fixed:
        array.flags.writeable = False
    yield 0, *fixed
    yield np.float32(0.001), q.tolist(), [0, 0]
    yield 0.002, np.repeat(q, 2)[::2], np.repeat(v, 2)[::2]


NO_STATES = [([0.0], [0.0]), (np.zeros((2, 2)), np.zeros((1, 2))), ([np.nan] * 4, [0.0, 0.0])]


@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize("form", ControlForm)
def test_torque_loads_no_kernel(form):
    plan = plan_of(form)
    arm, controller = plan.scenario.arm, make_controller(plan.scenario, plan)
    before = loaded()
    for state in states(arm):
        controller.torque(*state)
    for q, v in NO_STATES:
        with pytest.raises(InvalidValueError):
            controller.torque(0.0, q, v)
    controller.stop()
    for state in states(arm):
        controller.torque(*state)
    assert loaded() == before
    assert len(before) > 5


@pytest.mark.usefixtures("fresh")
def test_a_guard_loads_no_kernel_whatever_comes():
    plan = plan_of(ControlForm.TRACKING)
    arm = plan.scenario.arm
    tracking = ComputedTorque(arm, plan.reference, plan.scenario.gains)
    controller = GuardedController(arm, tracking, 0.001)
    before = loaded()
    for state in (*states(arm), *((0.003, *state) for state in NO_STATES), *states(arm)):
        controller.torque(*state)
    assert loaded() == before
    assert len(before) > 5


@pytest.mark.usefixtures("fresh")
def test_velocity_loads_no_kernel():
    plan = plan_of(ControlForm.REGULATION)
    controller = make_velocity_controller(plan.scenario, plan)
    before = loaded()
    for state in states(plan.scenario.arm):
        controller.velocity(*state)
    assert loaded() == before
    assert len(before) > 5


@pytest.mark.parametrize("form", [ControlForm.REGULATION, ControlForm.PLAIN])
def test_a_new_controller_is_at_its_first_sub_goal(form):
    plan = plan_of(form)
    make_controller(plan.scenario, plan)
    assert plan.guided.chain.current == 1
