"""The plain density of a scenario: towards its goal, without sub-goals."""

from dataclasses import replace

from densarm.clearance import Clearance
from densarm.density import GoalDistance, NavigationDensity
from densarm.motion_plan import MotionPlan, plan_motion
from densarm.scenario import ControlForm, GuideKind, Scenario


def plain_density(scenario: Scenario) -> NavigationDensity[GoalDistance]:
    """Return the density that drives a scenario's arm straight to its goal, as [ZNV] has it.

    Args:
        scenario: arm, scene, goal and the density's parameters.
    """
    if scenario.control.form == ControlForm.TRACKING:  # it would plan a reference
        scenario = replace(scenario, control=replace(scenario.control, form=ControlForm.REGULATION))
    clearance = Clearance(scenario.arm, scenario.scene)
    plan = plan_motion(scenario, clearance, GuideKind.DIRECT)
    assert isinstance(plan, MotionPlan)  # the direct guide always finds its way
    return plan.guided.density
