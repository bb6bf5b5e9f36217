"""Planning: a motion to the goal, proved clear, or an error that says why there is none."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm
from densarm.arms.joints import POSITION_TOLERANCE
from densarm.control.tracking import DensityTracking
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import DensityParameters
from densarm.density.unsafe_sets import SensingParameters
from densarm.errors import InvalidValueError
from densarm.planning.density_guide import Legs
from densarm.planning.guide import FreeSpace, GuidePath, NoPath, PlanningParameters
from densarm.planning.integral_curve import IntegralCurve
from densarm.planning.motion import Motion, PlanningError, TimingParameters
from densarm.planning.path_guide import PathGuide
from densarm.planning.plan import PATH_MARGIN, PLANNING_ALPHA, plan_motion, plan_path
from densarm.scenarios.scenario import Scenario, load_scenario
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.simulation.simulate import simulate
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.stopping import StoppingCheck, StoppingTrajectory
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World

Among = Callable[..., Any]


def planned(scenario: Scenario, guide: Any = "path", **changes: Any) -> Motion:
    return plan_motion(scenario.world, scenario.start, scenario.goal, guide, **changes)


def configurations(arm: Arm, motion: Motion, every: int = 20) -> Array:
    return arm.configurations(motion.position[::every])


def test_the_motion_leads_from_start_to_goal_through_free_space(swing_up: Scenario) -> None:
    motion, arm = planned(swing_up), swing_up.arm
    ends = arm.configurations(motion.position[[0, -1]])
    wanted = np.stack([swing_up.start, swing_up.goal])
    np.testing.assert_allclose(arm.difference(ends, wanted), 0.0, atol=1e-9)
    np.testing.assert_array_equal(motion.velocity[[0, -1]], 0.0)
    check = SweptCheck(swing_up.world)
    assert check.least_distance_margin(configurations(arm, motion)) > 0.0
    stopping = StoppingCheck(swing_up.world, StoppingTrajectory(arm))
    q, v = configurations(arm, motion), motion.velocity[::20]
    assert stopping.check(q, v).holds.all()
    assert motion.detail == ""
    assert motion.plan_time > 0.0
    assert motion.path is not None
    assert motion.path.is_clear


def test_start_and_goal_may_be_lists(swing_up: Scenario) -> None:
    lists = swing_up.start.tolist(), swing_up.goal.tolist()
    motion = plan_motion(swing_up.world, *lists, "path", seed=1)
    np.testing.assert_array_equal(motion.position, planned(swing_up, seed=1).position)


def test_same_seed_same_bits_and_another_seed_others(swing_up: Scenario) -> None:
    first, again, other = (planned(swing_up, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first.knots, again.knots)
    assert not np.array_equal(first.position[:100], other.position[:100])


def test_goal_at_the_start_is_a_motion_at_rest(swing_up: Scenario) -> None:
    for guide in ("path", "direct"):
        motion = planned(replace(swing_up, goal=swing_up.start), guide, period=0.004)
        assert motion.duration == 0.004
        np.testing.assert_array_equal(motion.velocity, 0.0)


@pytest.mark.parametrize("period", [0.001, 0.01])
def test_the_period_is_that_of_the_knots(swing_up: Scenario, period: float) -> None:
    motion = planned(swing_up, period=period)
    assert motion.period == period
    assert motion.duration == pytest.approx(2.0, abs=0.4)


# Why there is no motion.


def why_not(world: World, start: Any, goal: Any, *arguments: Any, **changes: Any) -> PlanningError:
    with pytest.raises(PlanningError) as raised:
        plan_motion(world, start, goal, *arguments, **changes)
    error = raised.value
    assert str(error) == f"{error.outcome}: {error.detail}"
    assert "\n" not in str(error)
    return error


def test_goal_out_of_reach_is_no_path(fenced_in: Scenario) -> None:
    error = why_not(fenced_in.world, fenced_in.start, fenced_in.goal, search=fenced_in.planning)
    assert error.outcome == Outcome.NO_PATH
    assert "1 searches by RRT-Connect of 50 iterations each found no path" in error.detail
    assert " mm; the density alone is stuck: " in error.detail
    assert error.motion is None


def test_half_of_the_searches_are_made_under_all_margins_but_the_last(
    fenced_in: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[int, int]] = []

    class Watched(PathGuide):
        def __init__(self, arm: Arm, freedom: FreeSpace, parameters: PlanningParameters) -> None:
            made.append((parameters.iterations, parameters.searches))
            super().__init__(arm, freedom, parameters)

    monkeypatch.setattr("densarm.planning.plan.PathGuide", Watched)
    search = PlanningParameters(iterations=100, searches=3)
    why_not(fenced_in.world, fenced_in.start, fenced_in.goal, search=search)
    assert made == [(2, 1), (100, 2), (100, 3)]


@pytest.fixture(scope="module")
def panda() -> Scenario:
    return load_scenario("panda_table")


def test_ends_in_contact_and_outside_limits_are_told_at_once(panda: Scenario) -> None:
    crate = Box(name="crate", size=(0.2, 0.2, 0.2), position=(0.3, 0.0, 0.5))
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 0.3))
    start = panda.arm.postures["ready"]
    goal = [*panda.goal[:3], 0.5, *panda.goal[4:]]
    error = why_not(World(panda.arm, Scene([crate, ball])), start, goal)
    assert error.outcome == Outcome.INFEASIBLE
    assert error.detail.startswith("start: panda_")
    assert " and ball overlap by " in error.detail
    assert "goal: joint 'panda_joint4' at 0.5 is outside [-3.0718, -0.0698]" in error.detail
    assert error.motion is None


@pytest.mark.parametrize("guide", ["path", "direct"])
@pytest.mark.parametrize("backwards", [False, True])
def test_ends_at_the_limits_may_be_rounded(panda: Scenario, guide: str, backwards: bool) -> None:
    world, goal = panda.world, panda.goal.copy()
    goal[0] = panda.arm.limits.upper[0] + 0.9 * POSITION_TOLERANCE
    start, goal = (goal, panda.start) if backwards else (panda.start, goal)
    motion = plan_motion(world, start, goal, guide=guide)
    assert simulate(world, DensityTracking(world, motion), start).certified


def test_inside_the_margin_is_infeasible(swing_up: Scenario) -> None:
    error = why_not(swing_up.world, swing_up.start, swing_up.goal, margin=1.3)
    assert error.outcome == Outcome.INFEASIBLE
    assert "mm apart" in error.detail


@pytest.fixture(scope="module")
def weak(swing_up: Scenario) -> Arm:
    description = swing_up.arm.description
    return Arm(replace(description, urdf=description.urdf.replace('effort="60"', 'effort="15"')))


def test_a_goal_that_cannot_be_held_is_infeasible(weak: Arm) -> None:
    level = weak.configuration([np.pi / 2, 0.0])
    error = why_not(World(weak, Scene()), weak.postures["hanging"], level)
    assert error.outcome == Outcome.INFEASIBLE
    assert error.detail.startswith("goal: joint 'shoulder' needs 19.62 N·m to hold the arm")
    assert error.detail.endswith("and has 15")


def test_a_way_that_cannot_be_held_is_infeasible(weak: Arm) -> None:
    error = why_not(World(weak, Scene()), weak.postures["hanging"], weak.postures["upright"])
    assert error.outcome == Outcome.INFEASIBLE
    assert "no motion along the planned path" in error.detail
    assert "joint 'shoulder' needs" in error.detail


def test_timing_that_may_use_no_torque_is_infeasible(swing_up: Scenario) -> None:
    timing = TimingParameters(torque_share=0.01)
    error = why_not(swing_up.world, swing_up.start, swing_up.goal, timing=timing)
    assert error.outcome == Outcome.INFEASIBLE
    assert "torque limits" in error.detail


def test_no_slope_at_the_start_is_left_and_told(swing_up: Scenario) -> None:
    error = why_not(swing_up.world, swing_up.start, swing_up.goal, "direct")
    assert error.outcome == Outcome.STUCK
    assert error.detail.startswith("maximum of the density")
    assert error.motion is not None
    assert error.motion.detail == error.detail
    assert error.motion.remark.startswith("left a critical point of the density")


@pytest.mark.parametrize("weights", ["inertia", (8.0, 1.0)])
def test_weights_lead_where_equal_ones_are_stuck(swing_up: Scenario, weights: Any) -> None:
    motion = plan_motion(
        swing_up.world,
        swing_up.start,
        swing_up.goal,
        "direct",
        kappa=np.inf,
        density=DensityParameters(weights=weights),
    )
    np.testing.assert_allclose(motion.position[-1], [np.pi, 0.0], atol=1e-9)
    assert motion.position[:, 1].min() > -2.0  # the elbow gives way and comes back
    assert motion.remark.startswith("left a critical point of the density")


def test_an_obstacle_that_blocks_is_named_and_the_motion_ends_before_it(
    swing_up: Scenario,
) -> None:
    arm = swing_up.arm
    error = why_not(swing_up.world, arm.configuration((0.01, 0.01)), swing_up.goal, "direct")
    assert error.outcome == Outcome.STUCK
    assert "lower_link_0 and right" in error.detail
    assert error.motion is not None
    check = SweptCheck(swing_up.world)
    assert check.check(configurations(arm, error.motion, 1)).verdict == SweptVerdict.CLEAR
    assert np.abs(error.motion.position[-1] - error.motion.position[0]).max() > 0.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"guide": "astar"}, r"^guide = 'astar': must be one of auto, density, direct, path"),
        ({"seed": -1}, r"^seed = -1"),
        ({"seed": 0.5}, r"^seed = 0.5"),
        ({"margin": -0.1}, r"^margin = -0.1"),
        ({"margin": np.nan}, r"^margin = nan"),
        ({"path_margin": -0.1}, r"^path_margin = -0.1"),
        ({"alpha": 0.0}, r"^alpha = 0.0"),
        ({"kappa": 0.0}, r"^kappa = 0.0"),
        ({"start": [0.0, 0.0]}, r"^start = .*\(4,\), got \(2,\).*arm.configuration"),
        ({"goal": [2.0, 0.0, 1.0, 0.0]}, r"^goal of joint 'shoulder' = .*\(cos, sin\)"),
        ({"goal": "upright"}, r"^goal = 'upright'"),
    ],
)
def test_arguments_are_checked(swing_up: Scenario, change: dict[str, Any], message: str) -> None:
    arguments = {"start": swing_up.start, "goal": swing_up.goal} | change
    with pytest.raises(InvalidValueError, match=message):
        plan_motion(swing_up.world, **arguments)


# How much is kept from obstacles.


def keeps(world: World, path: GuidePath, margin: float) -> bool:
    check = SweptCheck(world, margin)
    return all(check.segment_is_clear(a, b) for a, b in pairwise(path.waypoints))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda_shelf", "ur5_bin"])
def test_a_path_keeps_its_margin_where_there_is_space(name: str) -> None:
    scenario = load_scenario(name)
    path = plan_path(scenario.world, scenario.start, scenario.goal).path
    at_ends = 0.5 * SweptCheck(scenario.world).least_distance_margin(path.waypoints[[0, -1]])
    assert at_ends > 0.01
    assert keeps(scenario.world, path, min(PATH_MARGIN, at_ends) - 1e-6)


@pytest.mark.slow
def test_a_narrow_passage_is_passed_with_less() -> None:
    scenario = load_scenario("three_link_gate")
    planned = plan_path(scenario.world, scenario.start, scenario.goal, "path")
    assert keeps(scenario.world, planned.path, 0.25 * PATH_MARGIN - 1e-6)
    assert not keeps(scenario.world, planned.path, PATH_MARGIN)
    assert planned.kept.max() == pytest.approx(0.25 * PATH_MARGIN)


@pytest.mark.parametrize("margin", [0.0, 0.05, 0.2])
def test_the_safety_margin_is_kept_by_path_and_motion(swing_up: Scenario, margin: float) -> None:
    motion = planned(swing_up, margin=margin)
    assert motion.margin == margin
    assert motion.path is not None
    assert keeps(swing_up.world, motion.path, margin)
    check = SweptCheck(swing_up.world, margin)
    assert check.least_distance_margin(configurations(swing_up.arm, motion, 5)) > 0.0


def test_a_pair_that_is_close_at_an_end_keeps_less_and_the_others_what_they_may(
    among: Among,
) -> None:
    near = Sphere(name="near", radius=0.1, position=(-0.7, 0.208, 0.0))
    far = Sphere(name="far", radius=0.1, position=(0.0, 0.14, 0.0))
    world, start, goal = among([near, far], (-0.7, 0.0), (0.7, 0.0))
    planned = plan_path(world, start, goal)
    np.testing.assert_allclose(planned.kept, [0.5 * 0.008, PATH_MARGIN], rtol=0.02)
    assert SweptCheck(world, kept=planned.kept).check(planned.path.waypoints).verdict == "clear"
    motion = plan_motion(world, start, goal)
    closest = np.min([world.distances(q) for q in motion.position], axis=0)
    assert (closest >= 0.7 * planned.kept).all()


# The planning system.


def curve_of(world: World, motion: Motion) -> tuple[IntegralCurve, str]:
    """Return the curve from the start of a motion along its sub-goals, and why it is stuck."""
    assert motion.path is not None
    check = SweptCheck(world, motion.margin)
    density = DensityParameters(PLANNING_ALPHA)
    legs = Legs(check, TorusDistance(world.arm), density, SensingParameters())
    curve = legs.curve(motion.path)
    return curve, legs.why_stuck(curve)


def test_stuck_from_the_start_it_comes_back_from_the_goal(among: Among) -> None:
    wall = Box(name="wall", size=(0.1, 1.0, 0.3))
    beside, behind = (-0.6, 0.9), (0.3, 0.2)
    for ends in ((beside, behind), (behind, beside)):
        world, start, goal = among([wall], *ends)
        motion = plan_motion(world, start, goal, "direct")
        np.testing.assert_allclose(motion.position[[0, -1]], [start, goal], atol=1e-9)
        assert curve_of(world, motion)[0].reached == (ends[0] == behind)


def test_stuck_from_both_ends_it_goes_where_the_start_leads(
    among: Among, cap: list[Obstacle]
) -> None:
    error = why_not(*among(cap, (-0.7, 0.0), (0.25, 0.0)), "direct")
    world = among(cap, (-0.7, 0.0), (0.25, 0.0))[0]
    assert error.outcome == Outcome.STUCK
    assert error.motion is not None
    curve, why = curve_of(world, error.motion)
    assert not curve.reached
    assert why == error.detail
    np.testing.assert_allclose(error.motion.position[-1], curve.q[-1], atol=1e-9)


@pytest.mark.parametrize(("alpha", "passes"), [(1.0, False), (10.0, True)])
def test_a_larger_alpha_leads_through_a_narrower_gap(
    among: Among, alpha: float, passes: bool
) -> None:
    posts: list[Obstacle] = [
        Sphere(name=name, radius=0.2, position=(0.0, y, 0.0))
        for name, y in (("left", 0.33), ("right", -0.33))
    ]
    world, start, goal = among(posts, (-0.7, 0.02), (0.7, 0.0))
    if passes:
        motion = plan_motion(world, start, goal, "direct", alpha=alpha)
        np.testing.assert_allclose(motion.position[-1], goal, atol=1e-9)
    else:
        error = why_not(world, start, goal, "direct", alpha=alpha)
        assert error.motion is not None
        assert error.motion.position[-1, 0] < 0.0


# A guide of one's own.


@dataclass
class Own:
    """A guide that gives one answer and remembers what it was asked."""

    answer: Callable[[Array, Array], Any]
    asked: list[tuple[Array, Array, int]] = field(default_factory=list)

    def plan(self, start: Array, goal: Array, seed: int) -> Any:
        self.asked.append((start, goal, seed))
        return self.answer(start, goal)


@pytest.mark.parametrize("plan", [plan_motion, plan_path])
def test_an_own_guide_is_asked_once_with_ends_and_seed(
    swing_up: Scenario, plan: Callable[..., Motion]
) -> None:
    middle = swing_up.arm.configuration([0.3, -0.6])
    guide = Own(lambda start, goal: GuidePath(np.stack([start, middle, goal]), is_clear=False))
    goal = swing_up.arm.configuration([0.5, 0.2])
    path = plan(swing_up.world, swing_up.start, goal, guide, seed=7).path
    ((asked_start, asked_goal, seed),) = guide.asked
    np.testing.assert_allclose(asked_start, swing_up.start, atol=1e-9)
    np.testing.assert_allclose(asked_goal, goal, atol=1e-9)
    assert seed == 7
    assert path is not None
    np.testing.assert_array_equal(path.waypoints[1], middle)


def test_waypoints_of_an_own_guide_may_be_lists(swing_up: Scenario) -> None:
    goal = swing_up.arm.configuration([0.3, 0.2])
    guide = Own(lambda start, goal: GuidePath([start.tolist(), goal.tolist()], is_clear=True))  # type: ignore[arg-type]
    motion = plan_motion(swing_up.world, swing_up.start, goal, guide)
    np.testing.assert_allclose(motion.position[-1], [0.3, 0.2], atol=1e-9)


def test_the_reason_of_an_own_guide_is_the_detail_word_for_word(swing_up: Scenario) -> None:
    guide = Own(lambda *_: NoPath("the moon is in the way"))
    error = why_not(swing_up.world, swing_up.start, swing_up.goal, guide)
    assert (error.outcome, error.detail) == (Outcome.NO_PATH, "the moon is in the way")
    assert len(guide.asked) == 1


def test_an_own_guide_is_not_asked_where_an_end_is_infeasible(swing_up: Scenario) -> None:
    guide = Own(lambda *_: NoPath("never asked"))
    error = why_not(swing_up.world, swing_up.start, swing_up.goal, guide, margin=1.3)
    assert error.outcome == Outcome.INFEASIBLE
    assert guide.asked == []


WAYPOINTS = r"^waypoints of the guide = .*of shape \(W, 4\), W >= 2, got "
ANSWERS: dict[str, tuple[Callable[[Array, Array], Any], str]] = {
    "none": (lambda *_: np.zeros((0, 4)), WAYPOINTS + r"\(0, 4\)"),
    "empty": (lambda *_: [], WAYPOINTS + r"\(0,\)"),
    "one": (lambda start, _: start[np.newaxis], WAYPOINTS + r"\(1, 4\)"),
    "nan": (lambda a, b: np.stack([a, np.nan * a, b]), "^waypoint of the guide = .*finite"),
    "long": (lambda a, b: np.stack([np.append(q, 0.0) for q in (a, b)]), WAYPOINTS + r"\(2, 5\)"),
    "angles": (lambda *_: np.zeros((2, 2)), WAYPOINTS + r"\(2, 2\)"),
    "ragged": (lambda a, b: [a, b[:3]], "^waypoints of the guide = "),
    "words": (lambda *_: [["a"] * 4] * 2, "^waypoints of the guide = "),
    "off": (lambda a, b: np.stack([a, 2.0 * a, b]), r"^waypoint of the guide of joint.*\(cos, sin"),
    "start": (lambda a, b: np.stack([b, a, b]), "^first waypoint of the guide = .*the start "),
    "goal": (lambda a, b: np.stack([a, b, a]), "^last waypoint of the guide = .*the goal "),
}


@pytest.mark.parametrize("plan", [plan_motion, plan_path])
@pytest.mark.parametrize("name", ANSWERS)
def test_waypoints_that_are_none_are_one_error(
    swing_up: Scenario, plan: Callable[..., Any], name: str
) -> None:
    waypoints, message = ANSWERS[name]
    guide = Own(lambda *ends: GuidePath(waypoints(*ends), is_clear=True))
    with pytest.raises(InvalidValueError, match=message) as raised:
        plan(swing_up.world, swing_up.start, swing_up.goal, guide)
    assert "\n" not in str(raised.value)
    assert len(guide.asked) == 1


@pytest.mark.parametrize("answer", [None, "no", 7, np.zeros((2, 4))])
def test_what_is_no_answer_is_one_error(swing_up: Scenario, answer: object) -> None:
    with pytest.raises(
        InvalidValueError, match=r"^answer of the guide = .*a GuidePath or a NoPath"
    ):
        planned(swing_up, Own(lambda *_: answer))


def test_a_path_that_claims_to_be_clear_and_is_not_gives_no_motion(swing_up: Scenario) -> None:
    through = Own(lambda start, goal: GuidePath(np.stack([start, goal]), is_clear=True))
    error = why_not(swing_up.world, swing_up.start, swing_up.arm.configuration([2.9, 0.0]), through)
    assert error.outcome == Outcome.NO_PATH
    assert "no smooth path" in error.detail


def test_the_direct_guide_is_one_whose_only_sub_goal_is_the_goal(swing_up: Scenario) -> None:
    goal = swing_up.arm.configuration([0.3, 0.2])
    own = Own(lambda start, goal: GuidePath(np.stack([start, goal]), is_clear=False))
    found, named = (
        plan_motion(swing_up.world, swing_up.start, goal, guide) for guide in (own, "direct")
    )
    np.testing.assert_array_equal(found.knots, named.knots)
    assert named.path is not None
    np.testing.assert_array_equal(named.path.waypoints, [swing_up.start, goal])
    assert not named.path.is_clear


def test_a_short_search_is_told_apart_by_its_parameters(swing_up: Scenario) -> None:
    search = PlanningParameters(iterations=1, near_share=0.0, searches=1)
    error = why_not(swing_up.world, swing_up.start, swing_up.goal, "path", search=search)
    assert error.outcome == Outcome.NO_PATH
    assert "1 searches by RRT-Connect of 1 iterations" in error.detail
