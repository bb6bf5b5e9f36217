"""Plans: what each controller form needs, and why there is none."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import densarm
from densarm.clearance import Clearance
from densarm.fields import PlanningSystem
from densarm.guides import DirectGuide, GuidePath, NoPath
from densarm.motion_plan import plan_motion
from densarm.reference import InfeasibleTimingError
from densarm.scenario import ControlForm, GuideKind, load_scenario


@pytest.fixture(scope="module")
def swing_up():
    return load_scenario("swing_up")


def planned(scenario, guide=GuideKind.PATH, form=ControlForm.TRACKING):
    scenario = replace(scenario, control=replace(scenario.control, form=form))
    return plan_motion(scenario, Clearance(scenario.arm, scenario.scene), guide)


def test_tracking_gets_a_reference_from_start_to_goal(swing_up):
    plan, arm = planned(swing_up), swing_up.arm
    ends = arm.configurations(plan.reference.position[[0, -1]])
    wanted = [swing_up.start, swing_up.goal]
    np.testing.assert_allclose(arm.difference(ends, np.stack(wanted)), 0.0, atol=1e-9)
    for position in plan.reference.position[::20]:
        assert (plan.bound.slack(arm.configuration(position)) > 0.0).all()


@pytest.mark.parametrize("form", [ControlForm.REGULATION, ControlForm.PLAIN])
def test_the_other_forms_get_none(swing_up, form):
    assert planned(swing_up, form=form).reference is None


def test_goal_at_the_start_is_a_reference_at_rest(swing_up):
    plan = planned(replace(swing_up, goal=swing_up.start), GuideKind.DIRECT)
    assert plan.reference.duration == swing_up.simulation.control_period
    np.testing.assert_array_equal(plan.reference.velocity, 0.0)


def test_goal_out_of_reach_is_no_path(fenced_in):
    plan = planned(fenced_in)
    assert isinstance(plan, NoPath)


def keeps(plan, margin) -> bool:
    bound = plan.bound.with_margin(margin)
    return all(bound.segment_is_clear(a, b) for a, b in pairwise(plan.path.waypoints))


@pytest.mark.parametrize("name", ["panda_shelf", "ur5_bin"])
def test_a_path_keeps_the_margin_where_there_is_room(name):
    plan = planned(load_scenario(name))
    room = 0.5 * min(plan.bound.slack(q).min() for q in plan.path.waypoints[[0, -1]])
    assert room > 0.01
    assert keeps(plan, min(plan.scenario.control.path_margin, room) - 1e-6)


def test_a_narrow_passage_is_passed_with_less():
    plan = planned(load_scenario("three_link_gate"))
    wanted = plan.scenario.control.path_margin
    assert keeps(plan, 0.25 * wanted - 1e-6)
    assert not keeps(plan, wanted)


def test_an_arm_too_weak_is_infeasible(swing_up):
    weak = replace(swing_up, timing=replace(swing_up.timing, torque_share=0.01))
    with pytest.raises(InfeasibleTimingError):
        planned(weak)


def test_a_guide_of_ones_own(swing_up):
    class Upward(DirectGuide):
        def plan(self, start, goal, seed):
            self.seed = seed
            middle = swing_up.arm.configuration([1.0, -1.5])
            return GuidePath(np.stack([start, middle, goal]), is_clear=False)

    guide = Upward()
    planned(replace(swing_up, seed=7), guide)
    assert guide.seed == 7


def among(obstacles, start, goal):
    """Return a disc's way in the plane, with a reference to where its density leads."""
    disc = densarm.Sphere(name="disc", radius=0.1)
    arm = densarm.free_body(disc, "plane", [(-1.2, 1.2)] * 2)
    scene, start, goal = densarm.Scene(obstacles), np.array(start), np.array(goal)
    return densarm.Scenario("plane", "A disc in the plane", arm, scene, start, goal)


def test_stuck_from_the_start_it_comes_back_from_the_goal():
    wall = densarm.Box(name="wall", size=(0.1, 1.0, 0.3))
    beside, behind = (-0.6, 0.9), (0.3, 0.2)
    for start, goal in ((beside, behind), (behind, beside)):
        plan = planned(among([wall], start, goal), GuideKind.DIRECT)
        np.testing.assert_allclose(plan.reference.position[[0, -1]], [start, goal], atol=1e-9)
        curve = PlanningSystem(plan.planned, plan.bound).integrate(plan.path.waypoints[0])
        assert curve.reached == (start == behind)


def test_stuck_from_both_ends_it_goes_where_the_start_leads():
    cap = [
        densarm.Box(name="back", size=(0.1, 1.0, 0.3)),
        densarm.Box(name="upper", size=(0.5, 0.1, 0.3), position=(0.2, 0.45, 0.0)),
        densarm.Box(name="lower", size=(0.5, 0.1, 0.3), position=(0.2, -0.45, 0.0)),
    ]
    plan = planned(among(cap, (-0.7, 0.0), (0.25, 0.0)), GuideKind.DIRECT)
    curve = PlanningSystem(plan.planned, plan.bound).integrate(plan.path.waypoints[0])
    assert not curve.reached
    np.testing.assert_allclose(plan.reference.position[-1], curve.q[-1], atol=1e-9)


@pytest.mark.parametrize(("planning_alpha", "passes"), [(1.0, False), (10.0, True)])
def test_a_larger_alpha_leads_through_a_narrower_gap(planning_alpha, passes):
    posts = [
        densarm.Sphere(name=name, radius=0.2, position=(0.0, y, 0.0))
        for name, y in (("left", 0.33), ("right", -0.33))
    ]
    scenario = among(posts, (-0.7, 0.02), (0.7, 0.0))
    control = replace(scenario.control, planning_alpha=planning_alpha)
    plan = planned(replace(scenario, control=control), GuideKind.DIRECT)
    assert (plan.reference.position[-1, 0] > 0.0) == passes


def test_feedback_keeps_its_own_alpha(swing_up):
    plan = planned(swing_up, GuideKind.DIRECT)
    assert plan.guided.density.parameters.alpha == swing_up.density.alpha
    assert plan.planned.density.parameters.alpha == swing_up.control.planning_alpha


def test_a_smooth_path_keeps_half_the_room_of_its_curve():
    wall = densarm.Box(name="wall", size=(0.1, 1.0, 0.3))
    scenario = among([wall], (0.3, 0.2), (-0.6, 0.9))
    scenario = replace(scenario, control=replace(scenario.control, path_margin=0.04))
    plan = planned(scenario, GuideKind.DIRECT)
    curve = PlanningSystem(plan.planned, plan.bound).integrate(plan.path.waypoints[0]).q
    curve_room, room = (
        min(plan.bound.slack(q).min() for q in points)
        for points in (curve, plan.reference.position)
    )
    assert room >= 0.5 * min(0.04, curve_room)
