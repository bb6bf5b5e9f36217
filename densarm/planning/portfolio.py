"""Portfolio: several ways to one or several goals, of which the quickest is taken."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from densarm.planning.goals import Candidate, way_cost
from densarm.planning.guide import GuidePath, PlannedPath, PlanningParameters
from densarm.planning.path_guide import PathGuide
from densarm.planning.path_margins import Ends
from densarm.planning.rounding import rounded, way_time
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.swept_check import SweptCheck

_NEAR_ENOUGH = 1.03  # times the straight way's time, in which no other way to that goal is tried
_ITERATIONS, _SHORTCUTS, _BENDS = 800, 100, 400  # of each way
_FINAL = 1500  # bends that are tried on the quickest
_ASKED = 9000  # proofs that were asked for, with which a way that was found is enough
_SHARES = 1.0, 0.25  # of the path margin, tried in turn


def quickest_way(
    check: SweptCheck,
    start: Array,
    goals: Sequence[Candidate],
    ends: Callable[[Array], Ends],
    path_margin: float,
    search: PlanningParameters,
    attempts: int,
    seed: int,
) -> PlannedPath | None:
    """Return the quickest of the ways that attempts find, rounded; None without any.

    Goals have their turns, that first which a straight way would soonest be at. One is left out
    when a straight way there is hardly quicker than what was found. Where searches took long, fewer
    are made.

    Args:
        check: the world and the safety margin.
        start: configuration (nq,).
        goals: what to go to; those count that a straight way would soonest be at.
        ends: tells where ways to a goal (nq,) begin and end.
        path_margin: distance that ways keep beyond the margin [m], or a quarter of it.
        search: how many goals count, and how far samples are drawn.
        attempts: how many are made.
        seed: of all.
    """
    arm, least, made = check.arm, math.inf, 0
    best: tuple[GuidePath, Array, SeparatingPlanes, Array, Array] | None = None
    soonest = [way_time(arm, np.stack([start, goal.q])) + goal.own_cost for goal in goals]
    order = np.argsort(soonest, kind="stable").tolist()[: search.goals]
    few = replace(search, iterations=_ITERATIONS, shortcuts=_SHORTCUTS, near_share=1.0, searches=1)
    known: dict[int, Ends] = {}
    spaces: dict[tuple[int, float], SeparatingPlanes] = {}
    rng = np.random.default_rng(seed)
    for turn in range(attempts):
        for n in order:
            is_enough = best is not None and sum(x.asked for x in spaces.values()) > _ASKED
            if made == attempts or is_enough or least < _NEAR_ENOUGH * soonest[n]:
                continue
            made += 1
            depart, arrive, most = known[n] = known.get(n) or ends(goals[n].q)
            for share in _SHARES:
                kept = np.minimum(share * path_margin, most)
                if (n, share) not in spaces:
                    spaces[n, share] = SeparatingPlanes(check.world, check.margin, kept)
                space = spaces[n, share]
                found = PathGuide(arm, space, few).plan(depart, arrive, seed + turn)
                if isinstance(found, GuidePath):
                    break
            else:
                continue
            points = rounded(arm, space, found.waypoints, _BENDS, rng)
            time = way_time(arm, points) + goals[n].own_cost
            if time < least:
                best, least = (found, points, space, kept, goals[n].q), time
    if best is None:
        return None
    found, points, space, kept, goal = best
    points = rounded(arm, space, points, _FINAL, rng)
    path = replace(found, waypoints=points)
    return PlannedPath(path, kept, 0.0, goal, way_cost(arm, points), is_rounded=True)
