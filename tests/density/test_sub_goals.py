"""Sub-goals: from each the next is in sight, and all that is followed has Ψ = 1."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import Gauge, density_towards
from densarm.density.sub_goals import SIGHT, SPACING, GuidedDensity, GuidePath, SubGoals
from densarm.density.unsafe_sets import ImplicitSet, SensingParameters
from densarm.errors import InvalidValueError, SceneChangedError
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ExactDistances
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

ANGLES = st.tuples(*[st.floats(-3, 3)] * 2).map(np.array)
OFFSETS = st.tuples(*[st.floats(-0.1, 0.1)] * 2).map(np.array)
MakeGuided = Callable[..., GuidedDensity]


@pytest.fixture(scope="module")
def guided(make_guided: MakeGuided) -> GuidedDensity:
    return make_guided()


@pytest.fixture(scope="module")
def sub_goals(guided: GuidedDensity) -> SubGoals:
    return guided.sub_goals


@pytest.fixture(scope="module")
def check(guided: GuidedDensity) -> SweptCheck:
    return SweptCheck(guided.world)


def exact(check: SweptCheck, q: Array) -> ExactDistances:
    return ExactDistances(check.world.distances(q))


def test_path_runs_from_start_to_goal(
    swing_up: Scenario, check: SweptCheck, sub_goals: SubGoals
) -> None:
    np.testing.assert_array_equal(sub_goals.q[0], swing_up.start)
    np.testing.assert_allclose(sub_goals.q[-1], swing_up.goal, atol=1e-15)
    steps = check.arm.difference(sub_goals.q[:-1], sub_goals.q[1:])
    assert np.abs(steps).max() <= SPACING + 1e-12
    assert sub_goals.remaining[0] == pytest.approx(np.linalg.norm(steps, axis=1).sum())
    assert sub_goals.remaining[-1] == 0.0


def test_neighbours_see_each_other(check: SweptCheck, sub_goals: SubGoals) -> None:
    for k in range(1, len(sub_goals.q)):
        sub_goals.current = k - 1
        q = sub_goals.q[k - 1]
        sub_goals.advance(q, exact(check, q))
        assert sub_goals.current >= k
    assert sub_goals.is_last


def test_psi_is_one_on_every_followed_segment(check: SweptCheck, sub_goals: SubGoals) -> None:
    sub_goals.current = 1
    for q in sub_goals.q:
        sub_goals.advance(q, exact(check, q))
        step = check.arm.difference(q, sub_goals.q[sub_goals.current])
        for share in np.linspace(0.0, 1.0, 5):
            h = check.world.distances(check.arm.integrate(q, share * step)) - check.margin
            assert (h > sub_goals.sensing_distance[sub_goals.current]).all()


@given(index=st.integers(0, 10_000), offset=OFFSETS)
def test_a_sub_goal_in_sight_is_proved_in_sight(
    check: SweptCheck, sub_goals: SubGoals, index: int, offset: Array
) -> None:
    before = index % (len(sub_goals.q) - 1)
    q = check.arm.integrate(sub_goals.q[before], offset)
    sub_goals.current = before
    if sub_goals.advance(q, exact(check, q)):
        target = sub_goals.q[sub_goals.current]
        assert check.segment_is_clear(q, target)
        assert np.abs(check.arm.difference(q, target)).max() <= SIGHT


def test_never_back_and_never_past_an_obstacle(check: SweptCheck, sub_goals: SubGoals) -> None:
    sub_goals.current = 3
    far = check.arm.integrate(sub_goals.q[-1], np.array([0.3, 0.3]))
    sub_goals.advance(far, exact(check, far))
    assert sub_goals.current == 3


def test_direct_way_has_one_sub_goal_and_full_sensing(make_guided: MakeGuided) -> None:
    sub_goals = make_guided("direct").sub_goals
    assert len(sub_goals.q) == 2
    assert sub_goals.is_last
    assert (sub_goals.sensing_distance == 0.05).all()
    assert (sub_goals.joint_sensing_distance == 0.1).all()


def test_sub_goals_that_nobody_proved_follow_when_they_are_reached(
    swing_up: Scenario, check: SweptCheck
) -> None:
    """The plain density leads to each of them, also where none sees the next."""
    arm = swing_up.arm
    angles = np.array([[0.0, 0.0], [1.3, 0.0], [np.pi, 0.0]])  # through the right ball
    path = GuidePath(arm.configurations(angles), is_clear=False)
    goals = SubGoals(check, path, SensingParameters())
    np.testing.assert_array_equal(goals.q, path.waypoints)
    assert (goals.sensing_distance == 0.05).all()
    for at, current in ((0.0, 1), (1.29, 1), (1.2995, 2), (1.3, 2)):
        q = arm.configuration([at, 0.0])
        goals.advance(q, exact(check, q))
        assert goals.current == current


def test_in_an_empty_scene_sight_ends_at_a_quarter_turn(make_guided: MakeGuided) -> None:
    guided = make_guided(scene=Scene())
    goals, arm = guided.sub_goals, guided.world.arm
    goals.advance(goals.q[0], exact(SweptCheck(guided.world), goals.q[0]))
    seen = arm.difference(goals.q[0], goals.q[goals.current])
    assert 1.5 < np.abs(seen).max() <= np.pi / 2


def test_a_path_that_is_not_clear_is_refused(check: SweptCheck) -> None:
    # The stretched arm sweeps over the right obstacle.
    through = check.arm.configurations(np.array([[0.4, 0.0], [2.0, 0.0]]))
    with pytest.raises(InvalidValueError, match=r"^path = "):
        SubGoals(check, GuidePath(through, is_clear=True), SensingParameters())


# The density that they guide


@given(angles=ANGLES)
def test_direct_guidance_is_the_plain_density(direct: GuidedDensity, angles: Array) -> None:
    """Its gradient is written in its own gauge."""
    world, gradient = direct.world, np.empty(2)
    q = world.arm.configuration(angles)
    plain = density_towards(world, direct.sub_goals.q[-1]).evaluate(q)
    direct.update(q)
    direct.write_gradient(q, gradient)
    np.testing.assert_allclose(gradient, plain.gradient(Gauge.RECIPROCAL), rtol=1e-9)
    np.testing.assert_allclose(direct.density.evaluate(q).log_gradient, plain.log_gradient)
    to_goal = float(np.linalg.norm(plain.goal_error))
    assert direct.way_left(q) == pytest.approx((to_goal, 0.0), rel=1e-9)


@pytest.fixture(scope="module")
def direct(make_guided: MakeGuided) -> GuidedDensity:
    return make_guided("direct", goal=(0.3, -0.2))


@pytest.mark.parametrize("gauge", Gauge)
def test_blend_is_linear_near_the_goal_in_every_gauge(
    make_guided: MakeGuided, gauge: Gauge
) -> None:
    guided = make_guided("direct", goal=(0.3, -0.2), gauge=gauge, blend_radius=0.05)
    q, gradient = guided.world.arm.configuration([0.301, -0.2]), np.empty(2)
    guided.update(q)
    guided.write_gradient(q, gradient)
    np.testing.assert_allclose(gradient, [-0.001, 0.0], rtol=1e-9, atol=1e-12)


def test_the_start_below_a_goal_above_is_a_critical_point(make_guided: MakeGuided) -> None:
    guided = make_guided("direct")
    q = guided.world.arm.configuration([0.0, 0.0])
    guided.update(q)
    assert guided.is_critical()
    assert guided.describe_stall(q).startswith("saddle of the density at joint positions (0, 0)")
    guided.update(guided.world.arm.configuration([0.1, 0.0]))
    assert not guided.is_critical()


def test_the_sub_goal_in_sight_is_current_and_leads_uphill(guided: GuidedDensity) -> None:
    guided.restart()
    goals, q = guided.sub_goals, guided.sub_goals.q[0]
    ways = []
    for _ in range(len(goals.q)):
        guided.update(q)
        ways.append(sum(guided.way_left(q)))
        if goals.is_last:
            break
        seen = guided.sub_goal_in_sight(q)
        assert seen is not None
        np.testing.assert_array_equal(seen, goals.q[goals.current])
        middle = guided.world.arm.integrate(q, 0.5 * guided.world.arm.difference(q, seen))
        before, after = guided.density.evaluate(q).value, guided.density.evaluate(middle).value
        assert after > before
        q = seen
    assert goals.is_last
    assert (np.diff(ways) < 0.0).all()


def test_nothing_is_in_sight_where_something_is_sensed(direct: GuidedDensity) -> None:
    q = direct.world.arm.configuration([1.25, 0.0])  # beside the right ball
    direct.update(q)
    assert direct.density.log_psi < 0.0
    assert direct.sub_goal_in_sight(q) is None


def test_restart_returns_to_the_first_sub_goal(guided: GuidedDensity) -> None:
    goals = guided.sub_goals
    goals.current = len(goals.q) - 1
    guided.restart()
    assert goals.current == 1
    np.testing.assert_array_equal(guided.density.goal, goals.q[1])
    guided.update(goals.q[0])
    assert goals.current > 1
    np.testing.assert_array_equal(guided.density.goal, goals.q[goals.current])


def test_obstacles_that_change_ask_for_other_sub_goals(swing_up: Scenario) -> None:
    world = World(swing_up.arm, swing_up.scene)
    check, ends = SweptCheck(world), np.stack([swing_up.start, swing_up.goal])
    direct = GuidePath(ends, is_clear=False)
    guided = GuidedDensity(
        check, SubGoals(check, direct, SensingParameters()), TorusDistance(world.arm)
    )
    name = next(iter(swing_up.scene)).name
    world.move_obstacle(name, (-1.5, 0.0, -0.6))
    guided.update(swing_up.start)
    with pytest.raises(SceneChangedError):
        guided.sub_goal_in_sight(swing_up.start)
    guided.lead_along(SubGoals(check, direct, SensingParameters()))
    guided.update(swing_up.start)
    assert guided.density.log_psi == 0.0


def test_other_sub_goals_bring_their_own_sensing_distances(ball_on_slides: Arm) -> None:
    """Those of a path are smaller near limits than what a goal alone is led to with."""
    scene = Scene([Sphere(name="far", radius=0.1, position=(0.0, 0.0, 5.0))])
    check, sensing = SweptCheck(World(ball_on_slides, scene)), SensingParameters()
    along = np.array([[-0.5, 0.9], [0.5, 0.9]])
    path, alone = (GuidePath(along, is_clear=is_clear) for is_clear in (True, False))
    distance, q = TorusDistance(ball_on_slides), np.array([0.0, 0.95])
    guided = GuidedDensity(check, SubGoals(check, path, sensing), distance)
    fresh = GuidedDensity(check, SubGoals(check, alone, sensing), distance)
    guided.update(q)
    assert guided.density.log_psi == 0.0
    guided.lead_along(SubGoals(check, alone, sensing))
    guided.update(q)
    fresh.update(q)
    assert guided.density.log_psi == fresh.density.log_psi < 0.0


def test_other_unsafe_sets_are_kept_off(ball_on_slides: Arm) -> None:
    scene = Scene([Sphere(name="far", radius=0.1, position=(0.0, 0.0, 5.0))])
    check = SweptCheck(World(ball_on_slides, scene))
    path = GuidePath(np.array([[-0.5, 0.0], [0.5, 0.0]]), is_clear=False)
    strip = ImplicitSet(
        lambda q: (float(0.5 - q[1]), np.array([0.0, -1.0])),
        lambda q: (float(0.3 - q[1]), np.array([0.0, -1.0])),
    )
    guided = GuidedDensity(
        check,
        SubGoals(check, path, SensingParameters()),
        TorusDistance(ball_on_slides),
        unsafe_sets=(strip,),
    )
    guided.update(np.array([0.0, 0.0]))
    assert guided.density.log_psi == 0.0
    guided.update(np.array([0.0, 0.4]))
    assert guided.density.log_psi == pytest.approx(math.log(0.5))
