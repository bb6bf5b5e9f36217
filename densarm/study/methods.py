"""Methods: the density and its rivals, by name, each from a scenario to what drives the arm."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.closed_loop import Drive, make_controller
from densarm.control.computed_torque import ComputedTorque
from densarm.control.field_regulation import FieldRegulation
from densarm.density import GoalDistance, TorusDistance
from densarm.fields.barrier_filter import BarrierFilter, BarrierParameters
from densarm.fields.barriers import Barriers
from densarm.fields.joint_navigation_function import JointNavigationFunction
from densarm.fields.joint_potential import PotentialAscent
from densarm.fields.joint_potential_field import JointPotentialField
from densarm.fields.speed_law import SpeedLaw
from densarm.fields.velocity_field import VelocityField
from densarm.guides.guide import NoPath
from densarm.motion_plan import plan_motion
from densarm.proof.swept_bound import SweptBound
from densarm.scenario import ControlForm, GuideKind, Scenario

_NEAREST = 3  # pairs named where an arm rests
_KAPPA = 100.0  # of the navigation function: at 10 and below it is stuck on every arm tried


def density(scenario: Scenario, clearance: Clearance, scale: float = 1.0) -> Drive | NoPath:
    """Track the planning system's curve along a collision-free path by the density controller."""
    return _by_density(scenario, clearance, scale, ControlForm.TRACKING, GuideKind.PATH)


def density_direct(scenario: Scenario, clearance: Clearance, scale: float = 1.0) -> Drive | NoPath:
    """Follow the plain density of [ZNV] to the goal."""
    return _by_density(scenario, clearance, scale, ControlForm.REGULATION, GuideKind.DIRECT)


def potential_field(scenario: Scenario, clearance: Clearance, scale: float = 1.0) -> Drive:
    """Follow Khatib's artificial potential; it repels where the density senses."""
    barriers, goal_distance, speed_law = _shared(scenario, clearance)
    sensing = scenario.sensing
    influence = scale * sensing.distance
    potential = JointPotentialField(barriers, goal_distance, influence, sensing.joint)
    field = PotentialAscent(potential, speed_law, scenario.gains.rate)
    return _follow(scenario, clearance, field)


def navigation_function(scenario: Scenario, clearance: Clearance, scale: float = 1.0) -> Drive:
    """Follow Rimon and Koditschek's navigation function."""
    barriers, goal_distance, speed_law = _shared(scenario, clearance)
    potential = JointNavigationFunction(barriers, goal_distance, scale * _KAPPA)
    field = PotentialAscent(potential, speed_law, scenario.gains.rate)
    return _follow(scenario, clearance, field)


def cbf_qp(scenario: Scenario, clearance: Clearance, scale: float = 1.0) -> Drive:
    """Follow the pull of the goal, filtered by control barrier functions."""
    barriers, goal_distance, speed_law = _shared(scenario, clearance)
    parameters = BarrierParameters(barrier_rate=scale * BarrierParameters.barrier_rate)
    field = BarrierFilter(barriers, goal_distance, speed_law, scenario.gains.rate, parameters)
    return _follow(scenario, clearance, field)


def plan_then_track(scenario: Scenario, clearance: Clearance, scale: float = 1.0) -> Drive | NoPath:
    """Track the reference of `density` by computed torque."""
    drive = density(scenario, clearance, scale)
    if isinstance(drive, NoPath) or drive.reference is None:
        return drive
    controller = ComputedTorque(scenario.arm, drive.reference, scenario.gains)
    return replace(drive, controller=controller)


class ScalableMethod(Protocol):
    """A method whose main parameter can be scaled."""

    def __call__(
        self, scenario: Scenario, clearance: Clearance, scale: float = 1.0
    ) -> Drive | NoPath:
        """Act as `Method`, the main parameter at `scale` times its default."""
        ...


METHODS: Mapping[str, ScalableMethod] = {
    "density": density,
    "density_direct": density_direct,
    "potential_field": potential_field,
    "navigation_function": navigation_function,
    "cbf_qp": cbf_qp,
    "plan_then_track": plan_then_track,
}
"""The methods by name."""

MAIN_PARAMETERS: Mapping[str, str] = {
    "density": "sensing distance",
    "density_direct": "sensing distance",
    "potential_field": "influence distance",
    "navigation_function": "κ",
    "cbf_qp": "barrier rate",
    "plan_then_track": "sensing distance",
}
"""What `scale` scales: the scenario's sensing distance, or the default of the rival's parameter."""


def _by_density(
    scenario: Scenario, clearance: Clearance, scale: float, form: ControlForm, guide: GuideKind
) -> Drive | NoPath:
    scenario = replace(
        scenario,
        control=replace(scenario.control, form=form),
        sensing=replace(scenario.sensing, distance=scale * scenario.sensing.distance),
    )
    plan = plan_motion(scenario, clearance, guide)
    if isinstance(plan, NoPath):
        return plan
    controller = make_controller(scenario, plan)
    return Drive(controller, plan.describe_stall, plan.reference, plan_time=plan.guide_time)


def _shared(scenario: Scenario, clearance: Clearance) -> tuple[Barriers, GoalDistance, SpeedLaw]:
    """Return what every field gets alike: distances and margin, V, and the speed law."""
    margin = scenario.control.margin
    return (
        Barriers(clearance, margin),
        TorusDistance(scenario.arm, scenario.goal, kappa=scenario.control.kappa),
        SpeedLaw(SweptBound(clearance, margin), scenario.speed),
    )


def _follow(scenario: Scenario, clearance: Clearance, field: VelocityField) -> Drive:
    controller = FieldRegulation(
        scenario.arm, field, scenario.gains, scenario.simulation.control_period
    )
    return Drive(controller, _describe_rest(clearance))


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
