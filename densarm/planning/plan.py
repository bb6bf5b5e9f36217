"""From a start and a goal to a path of sub-goals, and to the motion along it."""

import math
import time
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.line import Line, Segment
from densarm.arms.pose import Pose
from densarm.arms.upright import TILT, Upright
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import DensityParameters
from densarm.density.sub_goals import GuidePath
from densarm.density.unsafe_sets import SensingParameters
from densarm.errors import InvalidValueError
from densarm.planning.density_guide import ALONE, DensityGuide, Legs
from densarm.planning.goals import Goal, candidates, goal_list, plan_to_any, way_cost
from densarm.planning.guide import (
    FreeSpace,
    Guide,
    NoPath,
    PlannedPath,
    PlanningParameters,
    checked_path,
)
from densarm.planning.motion import Motion, PlanningError, TimingParameters
from densarm.planning.path_guide import PathGuide
from densarm.planning.path_margins import ends_between, kept_along, kept_at
from densarm.planning.portfolio import quickest_way
from densarm.planning.shortening import shortened
from densarm.planning.straight import straight_way
from densarm.planning.upright import UprightSpace, planned_upright
from densarm.planning.way_points import BLEND, planned_through
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, non_negative_integer, one_of
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

GUIDES = ("auto", "density", "direct", "path")
"""Names of guides: "density" is `DensityGuide`; "path" is `PathGuide`, a collision-free path by
OMPL; "auto" the second where the first finds none; "direct" the goal alone, as in [ZNV]."""

PATH_MARGIN = 0.02
"""Distance that paths keep beyond m, less in narrow spaces and near start and goal [m]."""

PLANNING_ALPHA = 10.0
"""α of the planning system where its curve is tracked, so that its direction alone counts.

The larger, the closer to obstacles ρ leads, and the fewer its spurious maxima: [ZNV] Remark 3
takes 1 to 10.
"""

_EFFORT = 6  # ways that are looked for where any of several goals will do

# Shares of the path margin and of the planner's iterations, tried in turn: most spaces are wide,
# and a narrow passage may leave less distance than wanted. Where not all are to be spent, those
# that are draw samples near both ends above all. Under all margins but the last half of the
# searches are made: what they do not find rather needs a smaller margin than more samples.
_ATTEMPTS = ((1.0, 0.02), (0.25, 1.0), (0.05, 1.0))

_EVEN_SHARE = 0.995  # of the limits at grid points of a path that bends evenly

_AT_GOAL = 1e-7  # [rad or m]; a shorter way is left to feedback, for rounding shapes its curve

_SMOOTH_SHARE = 0.8  # of what a path keeps that the smooth path near it keeps
_STOP_SHARE = 0.5  # of the smooth path's that stopping keeps too; the rest is for tracking errors


def plan_motion(
    world: World,
    start: ArrayLike,
    goal: Goal | Line,
    guide: str | Guide = "auto",
    *,
    through: Goal | None = None,
    blend: float = BLEND,
    upright: str | None = None,
    tilt: float = TILT,
    margin: float = 0.0,
    seed: int = 0,
    path_margin: float = PATH_MARGIN,
    alpha: float = PLANNING_ALPHA,
    kappa: float = 1.0,
    period: float = 0.001,
    density: DensityParameters = DensityParameters(),
    sensing: SensingParameters = SensingParameters(),
    search: PlanningParameters = PlanningParameters(),
    timing: TimingParameters = TimingParameters(),
    time_limit: float = math.inf,
) -> Motion:
    """Plan a motion: sub-goals, the integral curve of ρ along them, a smooth path, its timing.

    Where the curve from the start gets stuck, and the one from the goal with the start as its goal
    does not, it is the second one, gone backwards. The motion is proved clear, under the safety
    margin, as are the stopping trajectories from it.

    Args:
        world: the arm among obstacles.
        start: configuration (nq,).
        goal: configuration (nq,), pose, or a list of these, of which any will do. The planner leads
            to the `search.goals` soonest reached of them and of the poses' configurations, and the
            quickest of `search.effort` ways is taken; with an effort of 1, or where the planner
            finds none, the density leads, and the least cost is what counts. Or a `Line`, which a
            frame follows within 0.25 mm and 2.5 mrad, whatever the guide.
        guide: supplies the sub-goals: one of `GUIDES`, or a `Guide`.
        through: way points: configurations and poses that it passes one after another without a
            stop; none where the goal is a `Line`, or the guide's ways are not proved clear.
        blend: how far off each joint may be where it passes one [rad or m], at least 0.01.
        upright: name of a frame, of which what points up at the start stays up on the way; it is
            led by a search of its own, in place of the guides "auto" and "path".
        tilt: how far it may tilt [rad], 0.01 to π/2.
        margin: safety margin m [m]; it must hold at start and goal too.
        seed: of the guide's random choices.
        path_margin: distance that paths keep beyond m [m].
        alpha: α of the planning system.
        kappa: κ of its goal distance.
        period: time between the motion's knots, for which torques will be held [s].
        density: θ, gauge and weights of V of the planning system.
        sensing: sensing distances.
        search: how long and how finely a path is searched.
        timing: shares of the limits that the motion may use.
        time_limit: longest duration of the motion [s]; never more than 10⁶ periods.

    Raises:
        PlanningError: there is no motion, with the outcome and the reason.
        InvalidValueError: no configuration, an unknown guide, or a value out of its range.
    """
    legs, line = _legs(world, margin, density, alpha, kappa, sensing), None
    if isinstance(goal, Line):
        for name, value in (("through", through), ("upright", upright)):
            if value is not None:
                raise InvalidValueError(name, value, "left out where the goal is a Line")
        planned, line = _straight(legs.check, start, goal, path_margin)
    else:
        level = None
        if upright is not None:
            q = world.arm.check_configuration("start", start)
            level = Upright.from_start(world.arm, q, upright, tilt)
        planned = _way(legs, start, goal, guide, seed, path_margin, search, through, blend, level)
    points, kept = planned.path.waypoints, planned.kept
    stuck, remark = "", planned.path.remark
    if not planned.path.is_clear:
        curve = legs.curve_from_either_end(planned.path)
        # No more than the density would: where nothing is sensed it leads straight.
        space, rng = SeparatingPlanes(world, margin, sensing.distance), np.random.default_rng(seed)
        points = shortened(world.arm, space, curve.q, search.shortcuts, rng)
        kept = kept_along(legs.check, points, kept)
        stuck, remark = legs.why_stuck(curve), curve.remark
    points, kept = np.vstack([start, points]), _SMOOTH_SHARE * kept
    motion = replace(
        _timed(world, margin, kept, points, period, timing, time_limit, line, planned),
        margin=margin,
        path=planned.path,
        goal=planned.goal,
        way_points=planned.way_points,
        upright=planned.upright,
        plan_time=planned.plan_time,
        detail=stuck,
        remark=remark,
        world=world,
    )
    if stuck:
        raise PlanningError(Outcome.STUCK, stuck, motion)
    return motion


def plan_path(
    world: World,
    start: ArrayLike,
    goal: Goal,
    guide: str | Guide = "auto",
    *,
    margin: float = 0.0,
    seed: int = 0,
    path_margin: float = PATH_MARGIN,
    alpha: float = PLANNING_ALPHA,
    kappa: float = 1.0,
    density: DensityParameters = DensityParameters(),
    sensing: SensingParameters = SensingParameters(),
    search: PlanningParameters = PlanningParameters(),
) -> PlannedPath:
    """Plan sub-goals alone, for a controller that follows them without a timed motion.

    Args and errors as for `plan_motion`; an effort counts as 1.
    """
    legs = _legs(world, margin, density, alpha, kappa, sensing)
    return _planned(legs, start, goal, guide, seed, path_margin, replace(search, effort=1))


def _legs(
    world: World,
    margin: float,
    density: DensityParameters,
    alpha: float,
    kappa: float,
    sensing: SensingParameters,
) -> Legs:
    distance = TorusDistance(world.arm, density.weights, kappa)
    return Legs(SweptCheck(world, margin), distance, replace(density, alpha=alpha), sensing)


def _way(
    legs: Legs,
    start: ArrayLike,
    goal: Goal,
    guide: str | Guide,
    seed: int,
    path_margin: float,
    search: PlanningParameters,
    through: Goal | None,
    blend: float,
    upright: Upright | None,
) -> PlannedPath:
    """Plan to a goal, by way points and upright where that is asked for."""
    check, arm = legs.check, legs.check.arm
    if upright is not None and guide not in ("auto", "path"):
        raise InvalidValueError("guide", guide, "'auto' or 'path', where a frame is kept upright")

    def plan(q: ArrayLike, goal: Goal) -> PlannedPath:
        if upright is None:
            return _planned(legs, q, goal, guide, seed, path_margin, search)
        return planned_upright(check, q, goal, upright, path_margin, search, seed)

    def freedom(kept: Array) -> FreeSpace:
        planes = SeparatingPlanes(check.world, check.margin, kept)
        return planes if upright is None else UprightSpace(arm, planes, upright)

    if through is None:
        return plan(start, goal)
    ways = goal_list(arm, through, "way point")
    return planned_through(arm, start, ways, goal, blend, seed, plan, freedom)


def _planned(
    legs: Legs,
    start: ArrayLike,
    goal: Goal,
    guide: str | Guide,
    seed: int,
    path_margin: float,
    search: PlanningParameters,
) -> PlannedPath:
    check = legs.check
    arm, goals = check.arm, goal_list(check.arm, goal)
    start = arm.check_configuration("start", start)
    non_negative_integer("seed", seed)
    non_negative("path_margin", path_margin)
    if isinstance(guide, str):
        one_of("guide", guide, GUIDES)

    def plan(q: Array, guide: str | Guide, search: PlanningParameters) -> PlannedPath:
        return _planned_to(legs, start, q, guide, seed, path_margin, search)

    only = goals[0] if len(goals) == 1 and not isinstance(goals[0], Pose) else None
    ends = {"start": start} if only is None else {"start": start, "goal": only}
    if fault := infeasibility(check, ends):
        raise PlanningError(Outcome.INFEASIBLE, fault)
    effort = search.effort or (_EFFORT if only is None else 1)
    if only is not None and effort == 1:
        return plan(only, guide, search)
    began = time.perf_counter()
    found = candidates(check, start, goals, seed, search.solutions, path_margin)
    planned = None
    if effort > 1 and guide in ("auto", "path"):
        between = partial(ends_between, check, start)
        planned = quickest_way(check, start, found, between, path_margin, search, effort, seed)
    planned = planned or plan_to_any(found[: search.goals], guide, search, plan)
    return replace(planned, plan_time=time.perf_counter() - began)


def _straight(
    check: SweptCheck, start: ArrayLike, line: Line, path_margin: float
) -> tuple[PlannedPath, Segment]:
    began = time.perf_counter()
    path, segment = straight_way(check, start, line)
    points = path.waypoints
    kept = np.minimum(path_margin, kept_at(check, points[[0, -1]]))
    kept, cost = kept_along(check, points, kept), way_cost(check.arm, points)
    return PlannedPath(path, kept, time.perf_counter() - began, points[-1], cost), segment


def _planned_to(
    legs: Legs,
    start: Array,
    goal: Array,
    guide: str | Guide,
    seed: int,
    path_margin: float,
    search: PlanningParameters,
) -> PlannedPath:
    """Plan to one goal that is feasible, as is the start."""
    check = legs.check
    world, arm, margin = check.world, check.arm, check.margin
    depart, arrive, least = ends_between(check, start, goal)
    kept = np.minimum(path_margin, least)
    if guide == "direct":
        # Not claimed to be clear: the density bends around what blocks it, or gets stuck there.
        ends = np.stack([depart, arrive])
        path = GuidePath(ends, is_clear=False, found_by=ALONE)
        return PlannedPath(path, kept, 0.0, goal, way_cost(arm, ends))
    began = time.perf_counter()

    def found(path: GuidePath, kept: Array) -> PlannedPath:
        cost = way_cost(arm, path.waypoints)
        return PlannedPath(path, kept, time.perf_counter() - began, goal, cost)

    if not isinstance(guide, str):
        answer = guide.plan(depart, arrive, seed)
        if isinstance(answer, NoPath):
            raise PlanningError(Outcome.NO_PATH, answer.reason)
        path = checked_path(arm, answer, depart, arrive)
        if path.is_clear:
            kept = kept_along(check, path.waypoints, kept)
        return found(path, kept)
    stuck, remark = "", ""
    if guide != "path":
        space = SeparatingPlanes(world, margin, kept)
        answer = DensityGuide(legs, space, search).plan(depart, arrive, seed)
        if isinstance(answer, GuidePath):
            kept = kept_along(check, answer.waypoints, kept)
            return found(answer, kept)
        stuck, remark = answer.reason, answer.remark
        if guide == "density":
            raise PlanningError(Outcome.STUCK, stuck)
    try:
        path, kept = _searched(check, depart, arrive, path_margin, least, search, seed)
    except PlanningError as error:
        also = f"; the density alone is stuck: {stuck}" if stuck else ""
        raise PlanningError(error.outcome, error.detail + also) from None
    path = replace(path, stuck=stuck, remark=remark)
    return found(path, kept)


def _searched(
    check: SweptCheck,
    start: Array,
    goal: Array,
    path_margin: float,
    least: Array,
    search: PlanningParameters,
    seed: int,
) -> tuple[GuidePath, Array]:
    """Search a path that keeps ever less (K,) [m], of each pair at most so much."""
    attempts: list[tuple[Array, float]] = []
    for share, effort in _ATTEMPTS:
        kept = np.minimum(share * path_margin, least)
        if attempts and np.array_equal(kept, attempts[-1][0]):
            attempts.pop()  # of those that keep the same the last is the most thorough
        attempts.append((kept, effort))
    for kept, effort in attempts:
        parameters = search
        if kept is not attempts[-1][0]:
            parameters = replace(search, searches=math.ceil(0.5 * search.searches))
        if effort < 1.0:
            iterations = math.ceil(effort * search.iterations)
            parameters = replace(search, iterations=iterations, near_share=1.0, searches=1)
        space = SeparatingPlanes(check.world, check.margin, kept)
        path = PathGuide(check.arm, space, parameters).plan(start, goal, seed)
        if isinstance(path, GuidePath):
            return path, kept
        reason = path.reason
    tried = ", ".join(f"{1e3 * (check.margin + kept.max(initial=0.0)):.3g}" for kept, _ in attempts)
    raise PlanningError(Outcome.NO_PATH, f"{reason}, with margins of {tried} mm")


def _timed(
    world: World,
    margin: float,
    kept: Array,
    curve: Array,
    period: float,
    timing: TimingParameters,
    time_limit: float,
    line: Segment | None,
    planned: PlannedPath,
) -> Motion:
    """Return a smooth motion near a curve (N, nq) that keeps so much beyond the margin (K,) [m]."""
    arm = world.arm
    length = float(np.linalg.norm(arm.difference(curve[:-1], curve[1:]), axis=1).sum())
    if length < _AT_GOAL:
        rest = np.tile(arm.angles(curve[-1]), (2, 1))
        return Motion(period, rest, np.zeros_like(rest))
    # TOPP-RA takes a tenth of a second to import.
    from densarm.planning.smoothing import blended_path, smooth_path
    from densarm.planning.timing import time_path
    from densarm.planning.topp_ra import GRID_SHARE

    path, passed = None, planned.way_points
    if planned.is_rounded:
        path = blended_path(world, margin, curve, kept, way_points=passed, upright=planned.upright)
    if path is None and passed is None and planned.upright is None:
        path = smooth_path(world, margin, curve, kept, line)
    if path is None:
        near = (
            "the planning system's curve is proved clear" if line is None else "the line is clear"
        )
        reason = f"no smooth path near {near}"
        raise PlanningError(Outcome.NO_PATH, reason)
    stops = StoppingTrajectory(arm, timing.acceleration_share, timing.torque_share)
    stopping = StoppingCheck(world, stops, margin, _STOP_SHARE * kept)
    share = _EVEN_SHARE if planned.is_rounded else GRID_SHARE
    return time_path(arm, path, length, period, timing, stopping, time_limit, grid_share=share)
