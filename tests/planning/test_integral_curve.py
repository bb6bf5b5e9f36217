"""The planning system: its curve climbs the density, reaches the goal or says why not."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from densarm.density.goal_distance import TorusDistance
from densarm.density.sub_goals import GuidedDensity, GuidePath, SubGoals
from densarm.density.unsafe_sets import SensingParameters
from densarm.planning.integral_curve import IntegralCurve, PlanningSystem
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck

Maker = Callable[..., GuidedDensity]


def curve_of(guided: GuidedDensity) -> IntegralCurve:
    return PlanningSystem(guided, 0.0).curve(guided.sub_goals.q[0])


def why_stuck(guided: GuidedDensity, curve: IntegralCurve) -> str:
    return PlanningSystem(guided, 0.0).describe_stall(curve)


def is_clear(guided: GuidedDensity, q: Array) -> bool:
    check = SweptCheck(guided.world)
    return all(check.segment_is_clear(a, b) for a, b in pairwise(q))


def test_reaches_through_the_sub_goals_without_touching(make_guided: Maker) -> None:
    guided = make_guided()
    curve = curve_of(guided)
    assert curve.reached
    assert why_stuck(guided, curve) == ""
    np.testing.assert_array_equal(curve.q[0], guided.sub_goals.q[0])
    np.testing.assert_array_equal(curve.q[-1], guided.sub_goals.q[-1])
    assert is_clear(guided, curve.q)


def test_density_grows_along_a_direct_curve(make_guided: Maker) -> None:
    guided = make_guided("direct", start=(0.3, 0.4), goal=(0.9, -1.5))
    curve = curve_of(guided)
    assert curve.reached
    values = [guided.density.evaluate(q).log_value for q in curve.q[:-1]]
    assert (np.diff(values) > 0.0).all()
    assert is_clear(guided, curve.q)


LEFT = (
    "left a critical point of the density at joint positions (0, 0) along its unstable direction "
    "(1, 0)"
)


@pytest.mark.parametrize("scene", [None, Scene()])
def test_the_saddle_at_the_start_of_swing_up_is_left(
    make_guided: Maker, scene: Scene | None
) -> None:
    guided = make_guided("direct", scene=scene)
    curve = curve_of(guided)
    assert curve.remark == LEFT
    assert guided.world.arm.angles(curve.q[1])[0] > 0.0
    values = [guided.density.evaluate(q).log_value for q in curve.q[:-1]]
    assert (np.diff(values) > 0.0).all()
    assert is_clear(guided, curve.q)
    assert curve.reached == (scene is not None)
    assert ("maximum of the density" in why_stuck(guided, curve)) != curve.reached


def test_a_saddle_that_a_curve_runs_into_is_left(make_guided: Maker) -> None:
    """The elbow comes down first, as the shoulder hangs exactly opposite to its goal."""
    curve = curve_of(make_guided("direct", start=(0.0, 1.0), scene=Scene()))
    assert curve.reached


@pytest.mark.slow
def test_spurious_maximum_names_what_blocks(make_guided: Maker) -> None:
    guided = make_guided("direct", start=(0.01, 0.01))
    curve = curve_of(guided)
    assert not curve.reached
    assert "lower_link_0 and right" in why_stuck(guided, curve)
    assert (guided.world.distances(curve.q[-1]) > 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.002, 0.02, 0.2])
def test_never_jumps_through_an_obstacle(make_guided: Maker, radius: float) -> None:
    """However thin what stands in the way, the curve does not come out behind it."""
    at = (1.5 * np.sin(0.8), 0.0, -1.5 * np.cos(0.8))
    pin = Sphere(name="pin", radius=radius, position=at)
    guided = make_guided("direct", (0.2, 0.0), (1.4, 0.0), Scene([pin]))
    assert is_clear(guided, curve_of(guided).q)


def test_at_the_goal_already(make_guided: Maker) -> None:
    guided = make_guided("direct", start=(0.5, 0.5), goal=(0.5, 0.5))
    curve = curve_of(guided)
    assert curve.reached
    np.testing.assert_array_equal(curve.q, guided.sub_goals.q[:1])


def test_again_from_the_start(make_guided: Maker) -> None:
    guided = make_guided()
    first, second = (curve_of(guided) for _ in range(2))
    np.testing.assert_array_equal(first.q, second.q)


@pytest.mark.parametrize(
    ("last", "is_reached"),
    [
        pytest.param((2.9, -1.5), True, id="reached"),
        pytest.param((np.pi, 0.0), False, id="stuck", marks=pytest.mark.slow),
    ],
)
def test_at_a_sub_goal_without_sight_of_the_next_it_goes_on(
    check: SweptCheck, last: tuple[float, float], is_reached: bool
) -> None:
    """A way that nothing proves, whose end is more than a quarter turn from the corner."""
    corners = check.arm.configurations(np.array([(0.0, 0.0), (1.0, -1.5), last]))
    goals = SubGoals(check, GuidePath(corners, is_clear=False), SensingParameters())
    guided = GuidedDensity(check, goals, TorusDistance(check.arm))
    curve = curve_of(guided)
    (at,) = np.flatnonzero((curve.q == corners[1]).all(axis=1))
    assert 0 < at < len(curve.q) - 1
    assert curve.reached == is_reached
    assert ("lower_link_0 and right" in why_stuck(guided, curve)) != is_reached
    assert is_clear(guided, curve.q)
