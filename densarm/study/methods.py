"""Methods: the density and its rivals, by name, each from a scenario to what drives the arm."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.closed_loop import Drive, Method, make_controller
from densarm.control.computed_torque import ComputedTorque
from densarm.control.field_regulation import FieldRegulation
from densarm.density import GoalDistance, TorusDistance
from densarm.fields.barrier_filter import BarrierFilter
from densarm.fields.barriers import Barriers
from densarm.fields.joint_navigation_function import JointNavigationFunction
from densarm.fields.joint_potential import PotentialAscent
from densarm.fields.joint_potential_field import JointPotentialField
from densarm.fields.speed_law import SpeedLaw
from densarm.fields.velocity_field import VelocityField
from densarm.guides.guide import NoPath
from densarm.motion_plan import plan_motion
from densarm.scenario import ControlForm, GuideKind, Scenario
from densarm.swept_bound import SweptBound

_NEAREST = 3  # pairs named where an arm rests


def density(scenario: Scenario, clearance: Clearance) -> Drive | NoPath:
    """Track the planning system's curve along a collision-free path by the density controller."""
    return _by_density(scenario, clearance, ControlForm.TRACKING, GuideKind.PATH)


def density_direct(scenario: Scenario, clearance: Clearance) -> Drive | NoPath:
    """Follow the plain density of [ZNV] to the goal."""
    return _by_density(scenario, clearance, ControlForm.REGULATION, GuideKind.DIRECT)


def potential_field(scenario: Scenario, clearance: Clearance) -> Drive:
    """Follow Khatib's artificial potential; it repels where the density senses."""
    barriers, goal_distance, speed_law = _shared(scenario, clearance)
    potential = JointPotentialField(
        barriers, goal_distance, scenario.sensing.distance, scenario.sensing.joint
    )
    return _follow(scenario, PotentialAscent(potential, speed_law, scenario.gains.rate))


def navigation_function(scenario: Scenario, clearance: Clearance) -> Drive:
    """Follow Rimon and Koditschek's navigation function."""
    barriers, goal_distance, speed_law = _shared(scenario, clearance)
    potential = JointNavigationFunction(barriers, goal_distance)
    return _follow(scenario, PotentialAscent(potential, speed_law, scenario.gains.rate))


def cbf_qp(scenario: Scenario, clearance: Clearance) -> Drive:
    """Follow the pull of the goal, filtered by control barrier functions."""
    barriers, goal_distance, speed_law = _shared(scenario, clearance)
    return _follow(scenario, BarrierFilter(barriers, goal_distance, speed_law, scenario.gains.rate))


def plan_then_track(scenario: Scenario, clearance: Clearance) -> Drive | NoPath:
    """Track the reference of `density` by computed torque."""
    drive = density(scenario, clearance)
    if isinstance(drive, NoPath) or drive.reference is None:
        return drive
    controller = ComputedTorque(scenario.arm, drive.reference, scenario.gains)
    return replace(drive, controller=controller)


METHODS: Mapping[str, Method] = {
    method.__name__: method
    for method in (
        density,
        density_direct,
        potential_field,
        navigation_function,
        cbf_qp,
        plan_then_track,
    )
}
"""The methods by name, each called with a scenario and the clearance of its arm and scene."""


def _by_density(
    scenario: Scenario, clearance: Clearance, form: ControlForm, guide: GuideKind
) -> Drive | NoPath:
    scenario = replace(scenario, control=replace(scenario.control, form=form))
    plan = plan_motion(scenario, clearance, guide)
    if isinstance(plan, NoPath):
        return plan
    return Drive(make_controller(scenario, plan), plan.guided.describe_stall, plan.reference)


def _shared(scenario: Scenario, clearance: Clearance) -> tuple[Barriers, GoalDistance, SpeedLaw]:
    """Return what every field gets alike: distances and margin, V, and the speed law."""
    margin = scenario.control.margin
    return (
        Barriers(clearance, margin),
        TorusDistance(scenario.arm, scenario.goal, kappa=scenario.control.kappa),
        SpeedLaw(SweptBound(clearance, margin), scenario.speed),
    )


def _follow(scenario: Scenario, field: VelocityField) -> Drive:
    controller = FieldRegulation(
        scenario.arm, field, scenario.gains, scenario.simulation.control_period
    )
    return Drive(controller, _describe_rest(field.clearance))


def _describe_rest(clearance: Clearance) -> Callable[[Array], str]:
    def describe(q: Array) -> str:
        where = ", ".join(f"{angle:.4g}" for angle in clearance.arm.angles(q))
        distance = clearance.distances(q)
        nearest = ", ".join(
            f"{' and '.join(clearance.pairs[k])} ({1e3 * distance[k]:.3g} mm)"
            for k in np.argsort(distance)[:_NEAREST]
        )
        return f"at rest at joint positions ({where}); nearest there: {nearest or 'no pair'}"

    return describe
