"""Critical points by Newton's method, told apart; and what blocks an arm that rests at one."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq

from densarm.arms.arm import Arm
from densarm.density.critical_points import (
    CriticalKind,
    Stall,
    find_critical_point,
    find_stall,
    log_hessian,
    unstable_direction,
)
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import Gauge, NavigationDensity
from densarm.density.sub_goals import GuidedDensity, GuidePath, SubGoals
from densarm.density.unsafe_sets import ClearanceSet, JointLimitSet, SensingParameters
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import UnsafeRegion
from densarm.euclidean.shapes import Ball, CShape, Ellipsoid
from densarm.planning.integral_curve import PlanningSystem
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

GOAL = np.array([4.0, -3.0])
AWAY = -GOAL / 5.0


def disc() -> EuclideanDensity:
    return EuclideanDensity([UnsafeRegion(Ball(2.0), Ball(3.0))], GOAL)


@pytest.mark.parametrize("off", [0.0, 1e-5, -1e-5])
def test_a_saddle_is_left_across_the_way_to_the_goal(off: float) -> None:
    """To the side where it lies off the axis, or if on it, where the first large entry grows."""
    density = disc()
    saddle = find_critical_point(slope_of(density), 2.8 * AWAY).position
    across = np.array([3.0, 4.0]) / 5.0
    direction = unstable_direction(slope_of(density), saddle + off * across)
    assert direction is not None
    np.testing.assert_allclose(direction, np.copysign(1.0, off) * across, atol=1e-4)


def test_nothing_leads_away_from_a_maximum_or_where_no_critical_point_is() -> None:
    assert unstable_direction(lambda x: -x, np.zeros(2)) is None
    saddle = np.diag([1.0, -1.0])
    assert unstable_direction(lambda x: x @ saddle, np.array([0.01, 0.0])) is None
    direction = unstable_direction(lambda x: x @ saddle, np.array([0.0, 0.0]))
    np.testing.assert_array_equal(direction, [1.0, 0.0])


def slope_of(density: EuclideanDensity) -> Callable[[Array], Array]:
    return lambda x: density.gradient(x, Gauge.LOG)


def test_the_saddle_behind_a_disc() -> None:
    density = disc()
    radius = brentq(lambda r: density.gradient(r * AWAY, Gauge.LOG) @ AWAY, 2.5, 2.99, xtol=1e-14)
    point = find_critical_point(slope_of(density), 2.6 * AWAY + 0.05)
    assert point.kind is CriticalKind.SADDLE
    assert point.slope < 1e-10
    np.testing.assert_allclose(point.position, radius * AWAY, atol=1e-9)
    assert point.eigenvalues[0] < 0.0 < point.eigenvalues[1]


def test_a_flat_sensing_region_makes_a_maximum_of_it() -> None:
    flat = Ellipsoid((0.1, 1.0), 1.0)  # 20 m wide, flatter than a circle of 6 m about the goal
    density = EuclideanDensity([UnsafeRegion(flat, Ellipsoid((0.1, 1.0), 1.6))], [0.0, -5.0])
    point = find_critical_point(slope_of(density), np.array([0.1, 1.5]))
    assert point.slope < 1e-10
    assert point.kind is CriticalKind.MAXIMUM


def test_hessian_is_the_derivative_of_the_gradient_along_any_direction() -> None:
    density, x, along = disc(), np.array([-2.3, 0.7]), np.array([0.6, 0.8])
    step = 1e-4
    ahead, behind = (density.gradient(x + s * step * along, Gauge.LOG) for s in (1.0, -1.0))
    expected = (ahead - behind) / (2.0 * step)
    np.testing.assert_allclose(log_hessian(slope_of(density), x) @ along, expected, rtol=1e-4)


def test_in_free_space_the_hessian_is_known() -> None:
    x = np.array([-6.0, 1.0])
    error = x - GOAL
    square = error @ error
    expected = -2.0 * (np.eye(2) - 2.0 * np.outer(error, error) / square) / square
    np.testing.assert_allclose(log_hessian(slope_of(disc()), x), expected, atol=1e-8)


def test_where_newton_finds_nothing_the_slope_tells() -> None:
    density = EuclideanDensity([UnsafeRegion(CShape(2.2, 0.4, 0.0, 2.0), Ball(4.0))], GOAL)
    assert find_critical_point(slope_of(density), np.array([20.0, 20.0]), iterations=5).slope == (
        pytest.approx(2.0 / np.linalg.norm(np.array([20.0, 20.0]) - GOAL), rel=0.05)
    )


@pytest.mark.parametrize(
    ("curvatures", "kind"),
    [
        ((-1.0, -3.0), CriticalKind.MAXIMUM),
        ((-1.0, 2.0), CriticalKind.SADDLE),
        ((4.0, 2.0), CriticalKind.MINIMUM),
        ((0.0, -2.0), CriticalKind.DEGENERATE),
        ((0.0, 2.0), CriticalKind.DEGENERATE),
        ((0.0, -2.0, 1.0), CriticalKind.SADDLE),
    ],
)
def test_the_signs_of_the_eigenvalues_tell_the_kind(
    curvatures: tuple[float, ...], kind: CriticalKind
) -> None:
    point = find_critical_point(
        lambda x: np.asarray(x * np.array(curvatures)), np.full(len(curvatures), 0.02)
    )
    assert point.kind is kind
    assert point.slope < 1e-9
    np.testing.assert_allclose(point.eigenvalues, np.sort(curvatures), atol=1e-9)


# Stalls, of a ball that two slides carry in a plane: joint space is the plane itself

DISC = Sphere(name="disc", radius=0.2)
WALL = Box(name="wall", size=(0.1, 1.0, 0.2))


def stall_of(
    arm: Arm, obstacle: Obstacle, goal: tuple[float, float], q: Array | tuple[float, float]
) -> tuple[NavigationDensity, Stall]:
    clearance_set = ClearanceSet(World(arm, Scene([obstacle])), 0.0, 0.05)
    limit_set, distance = JointLimitSet(arm, 0.1), TorusDistance(arm, kappa=np.inf)
    density = NavigationDensity(arm, np.array(goal), [clearance_set, limit_set], distance)
    return density, find_stall(density, clearance_set, limit_set, np.array(q))


def around(density: NavigationDensity, q: Array, radius: float = 2e-3) -> Array:
    """How ρ at points around q differs from ρ at q, in its logarithm."""
    turns = np.linspace(0.0, 2.0 * np.pi, 361)
    ring = q + radius * np.column_stack([np.cos(turns), np.sin(turns)])
    here = density.evaluate(q).log_value
    return np.array([density.evaluate(point).log_value for point in ring]) - here


def test_behind_a_disc_is_a_saddle(ball_on_slides: Arm) -> None:
    # Nearly where the disc holds the ball: beyond it by the sensing distance at most.
    density, stall = stall_of(ball_on_slides, DISC, (0.6, 0.0), (-0.345, 0.0))
    assert stall.kind is CriticalKind.SADDLE
    assert stall.blocking == ("ball_0 and disc",)
    assert stall.description.startswith("saddle of the density at joint positions (-0.345, 0)")
    rise = around(density, np.array([-0.3432, 0.0]), 0.03)
    assert (rise > 0.0).any()
    assert (rise < 0.0).any()


@pytest.mark.parametrize("across", [0.0, 0.2])
def test_behind_a_wall_is_a_maximum(ball_on_slides: Arm, across: float) -> None:
    goal, start = (0.6, across), np.array([-0.6, -0.1])
    check = SweptCheck(World(ball_on_slides, Scene([WALL])))
    path = GuidePath(np.array([start, goal]), is_clear=False)
    distance = TorusDistance(ball_on_slides, kappa=np.inf)
    guided = GuidedDensity(check, SubGoals(check, path, SensingParameters()), distance)
    system = PlanningSystem(guided, 0.0)
    curve = system.curve(start)
    assert not curve.reached
    detail = system.describe_stall(curve)
    assert detail.startswith("maximum of the density at joint positions (-0.1")
    assert detail.endswith("blocked by ball_0 and wall")
    density, stall = stall_of(ball_on_slides, WALL, goal, curve.q[-1])
    assert stall.kind is CriticalKind.MAXIMUM
    assert (around(density, curve.q[-1]) < 0.0).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_position_limit_that_blocks_is_named(ball_on_slides: Arm, side: float) -> None:
    # Of a goal nearer to the limit than ρ senses it, the limit keeps off who comes from inside.
    far = Sphere(name="far", radius=0.1, position=(0.0, 0.0, 2.0))
    _, stall = stall_of(ball_on_slides, far, (0.0, side * 0.995), (0.0, side * 0.95))
    assert stall.blocking == (f"the {'upper' if side > 0 else 'lower'} limit of joint 'across'",)
    assert stall.kind is CriticalKind.MAXIMUM


def test_where_nothing_is_critical_nothing_is_decided(ball_on_slides: Arm) -> None:
    _, stall = stall_of(ball_on_slides, DISC, (0.6, 0.0), (-0.8, 0.5))
    assert stall.kind is None
    assert stall.blocking == ()
    assert "not decided" in stall.description
    assert "nothing sensed there" in stall.description
