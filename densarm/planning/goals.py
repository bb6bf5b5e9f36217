"""Goals: configurations and poses of which any will do, and in what order they are tried."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.arms.pose import Pose
from densarm.errors import DensarmError, InvalidValueError, UnknownNameError
from densarm.planning.guide import Guide, PlannedPath, PlanningParameters
from densarm.planning.motion import PlanningError
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.configurations import infeasibility
from densarm.world.swept_check import SweptCheck

Goal = ArrayLike | Pose | Sequence[object]
"""A configuration (nq,), a pose, or several of them, of which any will do."""

_WORTH = 0.97  # of the cost of a way, above which another goal is not tried
_CONTACT_COST = 0.3  # [s] of a goal in contact, which falls to none at the path's margin
_ANY = 1e-9  # [m]
_LENGTH_COST = (
    0.2  # [s/rad] of a way; bends cost time too, which limits of single joints do not see
)


class Candidate(NamedTuple):
    """A configuration that may be the goal."""

    q: Array
    """The configuration (nq,)."""
    least_cost: float
    """Cost of the straight way there, which none is below [s]."""
    own_cost: float
    """Cost of being near to contact there, included in that [s]."""


def goal_list(arm: Arm, goal: Goal, name: str = "goal") -> list[Array | Pose]:
    """Return the goals that are given, configurations checked; errors call them by a name.

    Raises:
        InvalidValueError: no goal, or one that is neither configuration nor pose.
        UnknownNameError: a pose of an unknown frame.
    """
    given: list[Any] = [goal]
    if isinstance(goal, list | tuple | np.ndarray) and not isinstance(goal, Pose):
        entries = list(goal)
        if not entries:
            raise InvalidValueError(name, goal, "a configuration, a densarm.Pose, or some")
        if any(isinstance(item, Pose) or np.ndim(item) > 0 for item in entries):
            given = entries
    names = [name] if len(given) == 1 else [f"{name} {k + 1}" for k in range(len(given))]
    return [
        item if isinstance(item, Pose) else arm.check_configuration(name, item)
        for name, item in zip(names, given, strict=True)
    ]


def candidates(
    check: SweptCheck,
    start: Array,
    goals: Sequence[Array | Pose],
    seed: int,
    solutions: int,
    path_margin: float,
) -> list[Candidate]:
    """Return configurations that are goals, or take a frame to one, of the least cost first.

    Args:
        check: the world, and the safety margin.
        start: configuration (nq,).
        goals: as `goal_list` returns them.
        seed: of inverse kinematics.
        solutions: configurations for each pose at most.
        path_margin: distance beyond the safety margin above which more is worth nothing [m].

    Raises:
        PlanningError: none is feasible, with the reason of each.
        UnknownNameError: a pose of an unknown frame.
    """
    arm, found, faults = check.arm, list[Array](), []
    for goal in goals:
        if not isinstance(goal, Pose):
            fault = infeasibility(check, {"goal": goal})
            found += [] if fault else [goal]
        else:
            try:
                ways = check.world.inverse_kinematics(
                    goal, solutions, seed, near=start, margin=check.margin
                )
            except (UnknownNameError, InvalidValueError):
                raise
            except DensarmError as error:
                fault = f"goal: {error}"
            else:
                fault, found = "", [*found, *ways]
        faults += [fault] if fault else []
    if not found:
        raise PlanningError(Outcome.INFEASIBLE, "; ".join(faults))
    ranked = []
    for q in found:
        short = 1.0 - check.least_distance_margin(q[np.newaxis]) / max(path_margin, _ANY)
        own_cost = _CONTACT_COST * float(np.clip(short, 0.0, 1.0))
        ranked.append(Candidate(q, way_cost(arm, np.stack([start, q])) + own_cost, own_cost))
    return sorted(ranked, key=lambda candidate: candidate.least_cost)


def way_cost(arm: Arm, points: Array) -> float:
    r"""Return about how long a way through configurations (N, nq) takes [s].

    .. math:: \max_j T_j\Bigl(\sum_n |\Delta q_{nj}|\Bigr) + c \sum_n \|\Delta q_n\|

    T_j is the shortest time in which a joint gets so far, under its limits of velocity and
    acceleration alone.
    """
    steps = np.abs(arm.difference(points[:-1], points[1:]))
    travel, limits = steps.sum(axis=0), arm.limits
    speed = np.minimum(limits.velocity, np.sqrt(limits.acceleration * travel))
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.where(travel > 0.0, travel / speed + speed / limits.acceleration, 0.0)
    return float(times.max()) + _LENGTH_COST * float(np.linalg.norm(steps, axis=1).sum())


def plan_to_any(
    chosen: Sequence[Candidate],
    guide: str | Guide,
    search: PlanningParameters,
    plan: Callable[[Array, str | Guide, PlanningParameters], PlannedPath],
) -> PlannedPath:
    """Plan to several goals, and return the way of least cost that the density alone leads.

    Where it leads to none, the first way that there is by way of via points, or by a planner.

    Args:
        chosen: the goals to try, nearest first.
        guide: one of `GUIDES`, or one's own.
        search: its via points are shared among the goals.
        plan: plans to a configuration (nq,) along a guide.

    Raises:
        PlanningError: there is no way to any.
    """
    faults: list[str] = []

    def tried(q: Array, guide: str | Guide, vias: int) -> PlannedPath | None:
        try:
            return plan(q, guide, replace(search, vias=vias))
        except PlanningError as error:
            faults.append(error.detail)
            return None

    density_leads = guide in ("auto", "density")
    if density_leads:
        if best := _least_cost(chosen, lambda q: tried(q, "density", 0)):
            return best
        vias = math.ceil(search.vias / len(chosen))
        for way in (tried(q, "density", vias) for q, *_ in chosen):
            if way:
                return way
    stuck = faults[0] if density_leads else ""
    if guide == "density":
        raise PlanningError(Outcome.STUCK, stuck)
    rest = "path" if density_leads else guide
    for way in (tried(q, rest, search.vias) for q, *_ in chosen):
        if way:
            return replace(way, path=replace(way.path, stuck=way.path.stuck or stuck))
    also = f"; the density alone is stuck: {stuck}" if stuck else ""
    raise PlanningError(
        Outcome.NO_PATH, f"of {len(chosen)} goals (planning.goals) none: {faults[-1]}{also}"
    )


def _least_cost(
    chosen: Sequence[Candidate], plan: Callable[[Array], PlannedPath | None]
) -> PlannedPath | None:
    best: PlannedPath | None = None
    least = math.inf
    for q, least_cost, own_cost in chosen:
        if least_cost > _WORTH * least:
            break
        way = plan(q)
        if way and way.cost + own_cost < least:
            best, least = way, way.cost + own_cost
    return best
