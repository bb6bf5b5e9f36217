"""MotionPlan: from a guide's sub-goals to what a controller follows."""

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.density.goal_distance import GoalDistance, TorusDistance
from densarm.density.inertia_distance import InertiaDistance
from densarm.density.navigation_density import DensityParameters
from densarm.fields.guided_density import GuidedDensity
from densarm.fields.planning_system import PlanningSystem
from densarm.fields.sub_goal_chain import SubGoalChain
from densarm.guides.direct import DirectGuide
from densarm.guides.guide import Guide, GuidePath, NoPath
from densarm.guides.path import PathGuide
from densarm.proof.separating_planes import SeparatingPlanes
from densarm.proof.stopping_check import StoppingCheck
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound
from densarm.reference.reference import Reference
from densarm.scenario import ControlForm, GuideKind, Scenario
from densarm.simulation.fixed_step_loop import REACHED_POSITION

_LIMIT_INSET = 0.2 * REACHED_POSITION
"""Distance from position limits that the motion leaves and reaches its ends at [rad or m]."""

_ATTEMPTS = ((1.0, 0.01), (0.25, 1.0), (0.05, 1.0))
"""Shares of the path margin and of the planner's iterations, tried in turn: most spaces are wide,
and a narrow passage may leave less room than wanted. Where not all are to be spent, those that are
draw samples near both ends above all."""

_END_SHARE = 0.5
"""Share of the clearance at start and goal that a path's margin may take."""

_SMOOTH_SHARE = 0.5
"""Share of a path's or curve's room beyond the margin that the smooth path keeps."""

_STOP_SHARE = 0.5
"""Share of the smooth path's room that brakes keep too; the rest is for tracking errors."""


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """What the controllers need to know of the way."""

    scenario: Scenario
    """What was planned for."""
    path: GuidePath
    """The guide's sub-goals."""
    bound: SweptBound
    """The swept bound under the scenario's margin."""
    reference: Reference | None = None
    """The timed trajectory of the planning system, to where it got, if it is to be tracked."""
    guide_time: float = 0.0
    """Wall-clock time that the guide took [s]."""

    @cached_property
    def guided(self) -> GuidedDensity:
        """The density along the sub-goals, for feedback on it."""
        return self._guided(self.scenario.density)

    @cached_property
    def planned(self) -> GuidedDensity:
        """The density along the sub-goals, for a curve of its planning system that is tracked."""
        alpha = self.scenario.control.planning_alpha
        return self._guided(replace(self.scenario.density, alpha=alpha))

    def _guided(self, parameters: DensityParameters) -> GuidedDensity:
        chain = SubGoalChain(self.bound, self.path, self.scenario.sensing)
        return GuidedDensity(self.bound, chain, parameters, _goal_distance(self.scenario))

    def describe_stall(self, q: Array) -> str:
        """As `GuidedDensity.describe_stall`, of the density that led the arm to q (nq,)."""
        is_tracked = self.scenario.control.form == ControlForm.TRACKING
        return (self.planned if is_tracked else self.guided).describe_stall(q)


def plan_motion(
    scenario: Scenario, clearance: Clearance, guide: Guide | GuideKind
) -> MotionPlan | NoPath:
    """Plan a motion: sub-goals, and for tracking the integral curve, a smooth path, its timing.

    Where the curve from the start gets stuck, and the one from the goal with the start as its goal
    does not, it is the second one, gone backwards. Where both get stuck it is the first.

    Args:
        scenario: start, goal, parameters and seed.
        clearance: of the scenario's arm and scene.
        guide: supplies the sub-goals.

    Raises:
        InfeasibleTimingError: the limits allow no motion along the path.
    """
    start, goal, control = scenario.start, scenario.goal, scenario.control
    bound = SweptBound(clearance, control.margin)
    depart, arrive = (_inside_limits(bound, q) for q in (start, goal))
    ends = _least_slack(bound, np.stack([start, depart, arrive]))
    room = max(0.0, _END_SHARE * ends)
    began = time.perf_counter()
    # Of attempts with the same margin the last counts, which is the most thorough.
    attempts = {min(share * control.path_margin, room): effort for share, effort in _ATTEMPTS}
    for margin, effort in attempts.items():
        path_bound = bound.with_margin(control.margin + margin)
        path = _chosen(guide, scenario, path_bound, effort).plan(depart, arrive, scenario.seed)
        if isinstance(path, GuidePath):
            break
    if isinstance(path, NoPath):
        tried = ", ".join(f"{1e3 * (control.margin + margin):.3g}" for margin in attempts)
        return NoPath(f"{path.reason}, with margins of {tried} mm")
    plan = MotionPlan(scenario, path, bound, guide_time=time.perf_counter() - began)
    if control.form != ControlForm.TRACKING:
        return plan
    return _with_reference(plan, path_bound.margin - control.margin)


def _with_reference(plan: MotionPlan, room: float) -> MotionPlan | NoPath:
    """Return a plan with its reference, its path having kept so much room beyond the margin [m]."""
    scenario, bound, path = plan.scenario, plan.bound, plan.path
    curve = np.vstack([scenario.start, _curve(plan)])
    kept = _SMOOTH_SHARE * room
    if not path.is_clear:  # nor is the curve, but its steps are a share of its clearance
        kept = max(0.0, min(kept, _SMOOTH_SHARE * _least_slack(bound, curve)))
    smooth_bound = bound.with_margin(bound.margin + kept)
    stop_bound = bound.with_margin(bound.margin + _STOP_SHARE * kept)
    reference = _reference(scenario, smooth_bound, stop_bound, curve)
    if reference is None:
        return NoPath("no smooth path near the planning system's curve is proved clear")
    return replace(plan, reference=reference)


def _curve(plan: MotionPlan) -> Array:
    """Return points (N, nq) of the planning system's curve.

    On a path that is proved clear nothing is sensed, the sensing distances being below the
    path's own clearance: the density leads from each sub-goal straight to the next.
    """
    path = plan.path
    if path.is_clear:
        return path.waypoints
    curve = PlanningSystem(plan.planned, plan.bound).integrate(path.waypoints[0])
    if not curve.reached:
        # A goal lies in narrow space more often than a start, and leaving is easier than entering.
        back = replace(plan, path=GuidePath(path.waypoints[::-1], is_clear=False))
        returned = PlanningSystem(back.planned, plan.bound).integrate(path.waypoints[-1])
        if returned.reached:
            return returned.q[::-1]
    return curve.q


def _least_slack(bound: SweptBound, q: Array) -> float:
    """Return by how much the distances at configurations (N, nq) exceed the margin at least [m]."""
    return min(float(bound.slack(row).min(initial=np.inf)) for row in q)


def _chosen(
    guide: Guide | GuideKind, scenario: Scenario, bound: SweptBound, effort: float
) -> Guide:
    """Return a guide, which spends that share of its iterations if it searches."""
    if guide == GuideKind.DIRECT:
        return DirectGuide()
    if guide == GuideKind.PATH:
        planning = scenario.planning
        if effort < 1.0:
            iterations = math.ceil(effort * planning.iterations)
            planning = replace(planning, iterations=iterations, near_share=1.0, searches=1)
        return PathGuide(scenario.arm, SeparatingPlanes(bound), planning)
    return guide


def _inside_limits(bound: SweptBound, q: Array) -> Array:
    """Return where to leave or to reach q (nq,), at which the density must not vanish.

    A configuration at a position limit is on the rim of an unsafe set. The motion keeps a little
    inside, well within what counts as reached, unless something touches there.
    """
    arm, limits = bound.arm, bound.arm.limits
    low, high = limits.lower + _LIMIT_INSET, limits.upper - _LIMIT_INSET
    inside = arm.configurations(np.clip(arm.angles(q), low, high))
    return inside if bound.segment_is_clear(q, inside) else q


def _goal_distance(scenario: Scenario) -> GoalDistance:
    """Return V: in the metric of the inertia where the density is a torque."""
    if scenario.control.form == ControlForm.PLAIN:
        return InertiaDistance(scenario.arm, scenario.goal)
    return TorusDistance(scenario.arm, scenario.goal, kappa=scenario.control.kappa)


def _reference(
    scenario: Scenario, bound: SweptBound, stop_bound: SweptBound, curve: Array
) -> Reference | None:
    """Return a smooth reference near a curve (N, nq) under one margin, its brakes under another."""
    arm, period = scenario.arm, scenario.simulation.control_period
    length = float(np.linalg.norm(arm.difference(curve[:-1], curve[1:]), axis=1).sum())
    if length == 0.0:
        rest = np.tile(arm.angles(curve[0]), (2, 1))
        return Reference(period, rest, np.zeros_like(rest))
    # SciPy and TOPP-RA take a second to import.
    from densarm.reference.smooth_path import smooth_path
    from densarm.reference.timing import time_path

    path = smooth_path(bound, curve)
    if path is None:
        return None
    shares = scenario.timing
    brake = StraightBrake(arm, shares.acceleration_share, shares.torque_share)
    stopping = StoppingCheck(stop_bound, brake)
    return time_path(arm, path, length, period, shares, stopping)
