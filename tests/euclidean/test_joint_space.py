import numpy as np
import pytest

import densarm
from densarm.density.goal_distance import TorusDistance
from densarm.density.navigation_density import NavigationDensity
from densarm.density.unsafe_sets import ClearanceSet
from densarm.euclidean.fields import JointSpaceField, SmallestClearance
from densarm.euclidean.integral_curves import CurveParameters, integral_curves
from densarm.values.outcome import Outcome
from densarm.world.world import World

SCENARIO = densarm.load_scenario("swing_up")
ARM = SCENARIO.arm
WORLD = World(ARM, SCENARIO.scene)
GOAL = ARM.postures["upright"]
UNSAFE = [ClearanceSet(WORLD, 0.0, 0.1)]
DENSITY = NavigationDensity(ARM, GOAL, UNSAFE, TorusDistance(ARM, [8.0, 1.0], np.inf))
FIELD = JointSpaceField(WORLD, DENSITY)


def test_goal_is_the_goal_s_joint_positions() -> None:
    np.testing.assert_allclose(FIELD.goal, [np.pi, 0.0], atol=1e-12)


def test_direction_is_the_derivative_of_height_for_any_batch_shape() -> None:
    x = np.random.default_rng(1).uniform(-np.pi, np.pi, (400, 2))
    x = x[SmallestClearance(WORLD)(x) > 0.03][:300].reshape(3, 100, 2)
    axes = 1e-6 * np.eye(2)[:, np.newaxis, np.newaxis]
    slope = (FIELD.height(x + axes) - FIELD.height(x - axes)) / 2e-6
    np.testing.assert_allclose(FIELD.direction(x), np.moveaxis(slope, 0, -1), rtol=1e-3, atol=1e-6)
    assert FIELD.direction(x[0, 0]).shape == (2,)


def test_smallest_clearance_has_its_gradient() -> None:
    h = SmallestClearance(WORLD)
    x = np.random.default_rng(2).uniform(-np.pi, np.pi, (50, 2))
    expected = [WORLD.clearance(q).distance.min() for q in ARM.configurations(x)]
    np.testing.assert_allclose(h(x), expected, atol=1e-12)
    axes = 1e-6 * np.eye(2)[:, np.newaxis]
    slope = ((h(x + axes) - h(x - axes)) / 2e-6).T
    assert np.mean(np.isclose(h.gradient(x), slope, atol=1e-5).all(axis=-1)) > 0.95  # kinks


def test_weights_by_inertia_free_the_starts_that_equal_weights_trap() -> None:
    starts = np.array([[0.01, 0.01], [0.7, -0.7], [1.2, 0.9], [2.5, 1.0]])
    parameters = CurveParameters(tolerance=1e-3, longest_curve=30.0)
    curves = integral_curves(FIELD, starts, parameters)
    assert curves.count(Outcome.REACHED) == len(starts)
    equal = NavigationDensity(ARM, GOAL, UNSAFE, TorusDistance(ARM, kappa=np.inf))
    trapped = integral_curves(JointSpaceField(WORLD, equal), starts, parameters)
    assert list(trapped.outcome[:2]) == [Outcome.STUCK, Outcome.STUCK]


@pytest.mark.parametrize("turns", [-1.0, 1.0])
def test_field_is_periodic(turns: float) -> None:
    x = np.array([[1.0, -1.0], [0.3, 2.0]])
    np.testing.assert_allclose(FIELD.direction(x + 2.0 * np.pi * turns), FIELD.direction(x))
