"""DensityGuide: the density alone, then via points, and what is said of it."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from densarm.planning.guide import PlanningParameters
from densarm.planning.motion import PlanningError
from densarm.planning.plan import plan_motion, plan_path
from densarm.scenarios.run import run
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.values.outcome import Outcome
from densarm.world.swept_check import SweptCheck

Among = Callable[..., Any]

INSIDE, BEHIND = (0.25, 0.0), (-0.7, 0.0)


def test_the_density_alone_leads_where_it_can(among: Among) -> None:
    wall = Box(name="wall", size=(0.1, 1.0, 0.3))
    world, start, goal = among([wall], (0.3, 0.2), (-0.6, 0.9))
    planned = plan_path(world, start, goal, "density")
    assert planned.path.found_by == "the density alone"
    assert planned.path.stuck == ""
    assert planned.path.is_clear
    check = SweptCheck(world)
    assert all(check.segment_is_clear(a, b) for a, b in pairwise(planned.path.waypoints))


def test_a_via_point_leads_round_what_holds_both_ends(among: Among, cap: list[Obstacle]) -> None:
    for ends in ((INSIDE, BEHIND), (BEHIND, INSIDE)):
        world, start, goal = among(cap, *ends)
        with pytest.raises(PlanningError, match="maximum of the density"):
            plan_motion(world, start, goal, "direct")
        motion = plan_motion(world, start, goal, "density")
        np.testing.assert_allclose(motion.position[[0, -1]], ends, atol=1e-9)
        assert motion.path is not None
        assert motion.path.found_by == "the density by way of a via point"
        assert motion.path.stuck.startswith("maximum of the density at joint positions (0.1876")
        assert min(world.distances(q).min() for q in motion.position) > 0.0


def test_the_same_seed_gives_the_same_via_point(among: Among, cap: list[Obstacle]) -> None:
    world, start, goal = among(cap, INSIDE, BEHIND)
    one, same, other = (
        plan_path(world, start, goal, "density", seed=seed).path.waypoints for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


def test_without_via_points_it_is_stuck_and_says_where(among: Among, cap: list[Obstacle]) -> None:
    world, start, goal = among(cap, INSIDE, BEHIND)
    search = PlanningParameters(vias=0)
    with pytest.raises(PlanningError) as caught:
        plan_motion(world, start, goal, "density", search=search)
    assert caught.value.outcome == Outcome.STUCK
    assert "blocked by body_0 and back" in caught.value.detail
    assert "via points" not in caught.value.detail


CELL: list[Obstacle] = [
    Box(name=f"{axis}{sign:+d}", size=size, position=position)
    for axis, across in enumerate([(0.1, 0.8, 0.3), (0.8, 0.1, 0.3)])
    for sign in (-1, 1)
    for size, position in [(across, tuple(0.35 * sign * (axis == k) for k in range(3)))]
]
"""Closed: nothing leads out of it."""


def test_where_no_via_point_helps_it_says_how_many_were_tried(among: Among) -> None:
    world, start, goal = among(CELL, (0.0, 0.0), BEHIND)
    with pytest.raises(PlanningError) as caught:
        plan_motion(world, start, goal, "density", search=PlanningParameters(vias=3))
    assert caught.value.outcome == Outcome.STUCK
    assert caught.value.detail.endswith("from none of 3 via points it leads to both ends")


def test_auto_asks_the_planner_where_the_density_is_stuck(
    among: Among, cap: list[Obstacle]
) -> None:
    world, start, goal = among(cap, INSIDE, BEHIND)
    path = plan_path(world, start, goal, search=PlanningParameters(vias=0)).path
    assert path.found_by == "RRT-Connect"
    assert path.stuck.startswith("maximum of the density")
    assert plan_path(world, start, goal, "path").path.stuck == ""
    few = PlanningParameters(vias=0, iterations=50, searches=1)
    with pytest.raises(PlanningError) as caught:
        plan_motion(*among(CELL, (0.0, 0.0), BEHIND), search=few)
    assert caught.value.outcome == Outcome.NO_PATH
    assert "the density alone is stuck: " in caught.value.detail
    assert "blocked by body_0 and" in caught.value.detail


@pytest.mark.parametrize("vias", [0, 20])
def test_a_critical_point_left_in_vain_is_told_whatever_leads(
    vias: int, among: Among, cap: list[Obstacle]
) -> None:
    """The goal is exactly behind a ball, beside which the cap's arms are in the way."""
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 0.0))
    world, start, goal = among([ball, *cap], (-0.5, 0.0), INSIDE)
    motion = plan_motion(world, start, goal, search=PlanningParameters(vias=vias))
    assert motion.remark.startswith("left a critical point of the density at joint positions (0.23")
    assert motion.path is not None
    assert motion.path.stuck.endswith("blocked by body_0 and ball")
    found_by = "the density by way of a via point" if vias else "RRT-Connect"
    assert motion.path.found_by == found_by


@pytest.mark.slow
def test_a_run_says_what_led_it() -> None:
    scenario: Scenario = load_scenario("panda_table")
    done = run(replace(scenario, planning=PlanningParameters(vias=0)))
    assert done.outcome == Outcome.REACHED
    assert done.led_by in {"the density alone", "RRT-Connect", "the straight segment"}
    assert (done.stuck == "") == (done.led_by == "the density alone")
    assert run("swing_up", guide="auto").remark.startswith("left a critical point of the density")
