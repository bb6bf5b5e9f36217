"""Way points: what a path passes on its way to the goal, without a stop."""

import time
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.arms.pose import Pose
from densarm.density.sub_goals import GuidePath
from densarm.errors import InvalidValueError
from densarm.planning.goals import Goal, way_cost
from densarm.planning.guide import FreeSpace, PlannedPath, WayPoints
from densarm.planning.motion import PlanningError
from densarm.planning.rounding import rounded_through
from densarm.values.arrays import Array
from densarm.values.checks import finite_number

BLEND = 0.05
"""How far off each joint may be by default where a way point is passed [rad or m]."""

_LEAST_BLEND = 0.01  # [rad or m], within which goals count as reached
_BENDS = 1500  # that are tried
_STEP = 1e-9  # [rad or m], the shortest


def checked_blend(blend: float) -> float:
    """Return how far off way points a joint may be [rad or m], if it is a number >= 0.01.

    Raises:
        InvalidValueError: it is not.
    """
    value = finite_number("blend", blend)
    if value < _LEAST_BLEND:
        raise InvalidValueError("blend", value, f"at least {_LEAST_BLEND} rad or m")
    return value


def planned_through(
    arm: Arm,
    start: ArrayLike,
    through: Sequence[Array | Pose],
    goal: Goal,
    blend: float,
    seed: int,
    plan: Callable[[ArrayLike, Goal], PlannedPath],
    freedom: Callable[[Array], FreeSpace],
) -> PlannedPath:
    """Plan from one way point to the next, and return all of it as one path, rounded.

    Args:
        arm: the arm.
        start: configuration (nq,).
        through: way points; of a pose, the configuration that is taken leads on from the one
            before.
        goal: what comes last.
        blend: how far off each joint may be at way points [rad or m].
        seed: of the rounding.
        plan: plans from a configuration (nq,) to a goal.
        freedom: what proves that pairs keep distances (K,) [m].

    Raises:
        PlanningError: there is no way from one to the next.
        InvalidValueError: a guide whose ways are not proved clear.
    """
    began, q = time.perf_counter(), start
    checked_blend(blend)
    legs = list[PlannedPath]()
    for k, target in enumerate([*through, goal], start=1):
        try:
            leg = plan(q, target)
        except PlanningError as error:
            where = f"way point {k}" if k <= len(through) else "the goal"
            raise PlanningError(error.outcome, f"to {where}: {error.detail}") from None
        if not leg.path.is_clear:
            allowed = "one whose ways are proved clear, where there are way points"
            raise InvalidValueError("guide", leg.path.found_by or "one's own", allowed)
        legs.append(leg)
        q = leg.goal
    points, rows = _joined([leg.path.waypoints for leg in legs])
    kept = np.min([leg.kept for leg in legs], axis=0)
    space, rng = freedom(kept), np.random.default_rng(seed)
    passed = WayPoints(np.stack([leg.goal for leg in legs[:-1]]), blend, rows)
    points, passed = rounded_through(arm, space, points, passed, _BENDS, rng)
    told = {
        key: "; ".join(dict.fromkeys(filter(None, (getattr(leg.path, key) for leg in legs))))
        for key in ("found_by", "stuck", "remark")
    }
    return PlannedPath(
        GuidePath(points, is_clear=True, **told),
        kept,
        time.perf_counter() - began,
        legs[-1].goal,
        way_cost(arm, points),
        is_rounded=True,
        way_points=passed,
        upright=legs[-1].upright,
    )


def _joined(legs: Sequence[Array]) -> tuple[Array, NDArray[np.int64]]:
    """Return the path of legs (W, nq), and the points at which all but the last of them end."""
    points = np.vstack([legs[0], *(leg[1:] for leg in legs[1:])])
    rows = np.cumsum([len(leg) - 1 for leg in legs[:-1]])
    # No point twice, which would look like a corner; the last one stays even if nothing moves.
    moves = np.append(np.abs(np.diff(points, axis=0)).max(axis=1) > _STEP, [True])
    if not moves[:-1].any():
        return points[[0, -1]], np.zeros_like(rows)
    kept = np.append(True, moves[:-1])
    return points[kept], np.cumsum(kept)[rows] - 1
