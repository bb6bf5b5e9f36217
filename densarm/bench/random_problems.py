"""Random problems of an arm: scenes, starts and goals that belong to a seed."""

from collections.abc import Callable
from functools import lru_cache, partial
from itertools import islice

import numpy as np

from densarm.arrays import Array
from densarm.bench.problem import Problem, named_arm
from densarm.bench.processes import in_processes
from densarm.bench.random_scene import SCENE_KINDS, RandomScene, Region
from densarm.bench.workspace import Workspace
from densarm.clearance import Clearance
from densarm.errors import DensarmError
from densarm.guides.guide import GuidePath
from densarm.guides.path import PathGuide, PathGuideParameters
from densarm.holding_torque import holding_ratios
from densarm.proof.separating_planes import SeparatingPlanes
from densarm.proof.swept_bound import SweptBound
from densarm.reference.timing_parameters import TimingParameters
from densarm.validation import non_negative_integer, one_of, positive_integer

_SCENES = 200  # drawn for one problem at most
_DRAWS = 3000  # of one end in one scene
_CHECKS = 300  # of those, where the end effector is in its region
_ROOM = 0.005  # that ends keep from contact, in units of the reach
_PATH_ROOM = 0.0025  # that the path keeps that makes a problem solvable, in the same units
_APART = 0.3  # of the ends' end effectors, at least, in units of the reach
_BUDGET = PathGuideParameters(iterations=100_000, near_share=0.0, searches=1, shortcuts=1)


def random_problems(
    arm: str,
    count: int,
    seed: int,
    scenes: str = "mixed",
    jobs: int = 1,
    on_progress: Callable[[str], None] = lambda _: None,
) -> list[Problem]:
    """Draw problems of an arm among random obstacles, of which each has a solution.

    Starts and goals are drawn evenly within the position limits, continuous joints from a whole
    turn, and kept where the arm touches nothing and can be held, its end effector in the regions
    that the scene asks for and 0.3 of the reach apart. With obstacles, a problem is kept if a
    search of 100,000 samples finds a path that keeps a quarter of a percent of the reach from
    contact, half of what the ends keep: without room, chance alone finds passages of less than
    0.1 mm. The first problems stay the same when more are drawn.

    Args:
        arm: a known name.
        count: number of problems.
        seed: of the draws and of the planner.
        scenes: one of `SCENE_KINDS`.
        jobs: processes to search in.
        on_progress: told what is being done.

    Raises:
        UnknownNameError: no such arm.
        InvalidValueError: a number of problems below one, a seed that is not a whole number, or
            unknown scenes.
        DensarmError: no problem was found in many scenes.
    """
    positive_integer("problems", count)
    non_negative_integer("seed", seed)
    one_of("scenes", scenes, list(SCENE_KINDS))
    named_arm(arm)
    problems = []
    draw = partial(_draw_problem, arm, scenes, seed)
    for problem in in_processes(draw, range(count), jobs):
        problems.append(problem)
        on_progress(f"{len(problems)} of {count} problems drawn")
    return problems


def _draw_problem(arm: str, scenes: str, seed: int, index: int) -> Problem:
    workspace, random = _workspace(arm), np.random.default_rng([seed, index])
    kinds = SCENE_KINDS[scenes]
    kind = kinds[index % len(kinds)]
    for _ in range(_SCENES):
        found = kind(workspace, random)
        clearance = Clearance(workspace.arm, found.scene)
        ends = _draw_ends(workspace, clearance, found, random)
        room = _PATH_ROOM * workspace.reach
        if ends is not None and (not len(found.scene) or _has_path(clearance, *ends, room, seed)):
            start, goal = (tuple(workspace.arm.angles(q).tolist()) for q in ends)
            return Problem(arm, kind.__name__, index, found.scene, start, goal, seed)
    raise DensarmError(f"robot {arm!r}: no problem with a solution in {_SCENES} random scenes")


@lru_cache(maxsize=1)
def _workspace(arm: str) -> Workspace:
    return Workspace(named_arm(arm))


def _draw_ends(
    workspace: Workspace, clearance: Clearance, found: RandomScene, random: np.random.Generator
) -> tuple[Array, Array] | None:
    start_region, goal_region = found.ends or (None, None)
    start = _draw_end(workspace, clearance, start_region, random)
    goal = _draw_end(workspace, clearance, goal_region, random)
    if start is None or goal is None:
        return None
    apart = np.linalg.norm(workspace.tip(goal) - workspace.tip(start))
    return (start, goal) if apart >= _APART * workspace.reach else None


def _draw_end(
    workspace: Workspace,
    clearance: Clearance,
    region: Region | None,
    random: np.random.Generator,
) -> Array | None:
    arm, room = workspace.arm, _ROOM * workspace.reach
    draws = (workspace.draw(random) for _ in range(_DRAWS))
    inside = (q for q in draws if region is None or region.contains(workspace.tip(q)))
    for q in islice(inside, _CHECKS):
        is_held = holding_ratios(arm, q).max() <= TimingParameters().torque_share
        if is_held and clearance.distances(q).min(initial=np.inf) > room:
            return q
    return None


def _has_path(clearance: Clearance, start: Array, goal: Array, room: float, seed: int) -> bool:
    freedom = SeparatingPlanes(SweptBound(clearance, room))
    guide = PathGuide(clearance.arm, freedom, _BUDGET)
    return isinstance(guide.plan(start, goal, seed), GuidePath)
