"""Goal distances: positive, zero at the goal, with their gradients; each in its own form."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm, load_arm
from densarm.density.goal_distance import (
    EuclideanDistance,
    GoalDistance,
    InertiaDistance,
    ProductDistance,
    TorusDistance,
)
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array

KINDS, NV = "bcbc", 4
angle_vectors = arrays(np.float64, NV, elements=st.floats(-3.0, 3.0))
kappas = st.sampled_from([1e-3, 0.1, 1.0, 10.0, math.inf])
WEIGHTS = np.array([1.0, 2.0, 0.5, 3.0])


@pytest.fixture(scope="module")
def arm(joint_space: Callable[[str], Arm]) -> Arm:
    return joint_space(KINDS)


@pytest.fixture(scope="module", params=["euclidean", "torus", "inertia", "sum", "product"])
def distance(request: pytest.FixtureRequest, arm: Arm) -> GoalDistance:
    made: dict[str, Callable[[], GoalDistance]] = {
        "euclidean": EuclideanDistance,
        "torus": lambda: TorusDistance(arm, WEIGHTS),
        "inertia": lambda: TorusDistance(arm, "inertia"),
        "sum": lambda: TorusDistance(arm, WEIGHTS, kappa=math.inf),
        "product": lambda: ProductDistance(arm),
    }
    return made[request.param]()


def at(arm: Arm, distance: GoalDistance, angles: Array) -> Array:
    """The configuration of some joint positions, in the space of a distance."""
    return angles if isinstance(distance, EuclideanDistance) else arm.configuration(angles)


def evaluated(distance: GoalDistance, q: Array, goal: Array, nv: int = NV) -> tuple[float, Array]:
    gradient = np.full(nv, np.nan)
    return distance.evaluate(q, goal, gradient), gradient


@settings(max_examples=40)
@given(angles=angle_vectors, goal_angles=angle_vectors)
def test_gradient_is_the_derivative(
    arm: Arm,
    distance: GoalDistance,
    numerical_gradient: Callable[..., Array],
    angles: Array,
    goal_angles: Array,
) -> None:
    integrate = np.add if isinstance(distance, EuclideanDistance) else arm.integrate
    q, goal = at(arm, distance, angles), at(arm, distance, goal_angles)
    value, gradient = evaluated(distance, q, goal)
    numerical = numerical_gradient(lambda p: evaluated(distance, p, goal)[0], q, NV, integrate)
    np.testing.assert_allclose(gradient, numerical, rtol=1e-6, atol=1e-8 * (1.0 + value))


def test_remainder_of_the_linear_model_is_quadratic(arm: Arm, distance: GoalDistance) -> None:
    rng = np.random.default_rng(0)
    angles, direction = rng.normal(size=(2, NV))
    goal = at(arm, distance, np.zeros(NV))
    value, gradient = evaluated(distance, at(arm, distance, angles), goal)
    steps = np.logspace(-4, -2, 9)
    remainders = []
    for step in steps:
        ahead, _ = evaluated(distance, at(arm, distance, angles + step * direction), goal)
        remainders.append(abs(ahead - value - step * gradient @ direction))
    order = np.polyfit(np.log(steps), np.log(remainders), 1)[0]
    assert order == pytest.approx(2.0, abs=0.1)


@settings(max_examples=40)
@given(angles=angle_vectors, goal_angles=angle_vectors)
def test_is_zero_at_the_goal_and_never_negative(
    arm: Arm, distance: GoalDistance, angles: Array, goal_angles: Array
) -> None:
    q, goal = at(arm, distance, angles), at(arm, distance, goal_angles)
    assert evaluated(distance, q, goal)[0] >= 0.0
    value, gradient = evaluated(distance, q, q)
    assert value == 0.0
    np.testing.assert_array_equal(gradient, np.zeros(NV))


@settings(max_examples=40)
@given(angles=angle_vectors, kappa=kappas)
def test_torus_distance_is_positive_definite(arm: Arm, angles: Array, kappa: float) -> None:
    distance, goal = TorusDistance(arm, kappa=kappa), arm.configuration(np.zeros(NV))
    if np.abs(angles).max() > 1e-6:
        assert evaluated(distance, arm.configuration(angles), goal)[0] > 0.0


@pytest.mark.parametrize("kappa", [1e-3, 1.0, math.inf])
def test_torus_distance_keeps_tiny_errors(arm: Arm, kappa: float) -> None:
    distance, goal = TorusDistance(arm, WEIGHTS, kappa), arm.configuration(np.zeros(NV))
    value, gradient = evaluated(distance, arm.configuration(np.full(NV, 1e-8)), goal)
    assert value == pytest.approx(WEIGHTS.sum() * 1e-16 / 2.0, rel=1e-12)
    np.testing.assert_allclose(gradient, WEIGHTS * 1e-8, rtol=1e-12)


@settings(max_examples=40)
@given(angles=angle_vectors, turns=arrays(np.int64, NV, elements=st.integers(-2, 2)))
def test_continuous_joints_are_periodic_and_bounded_ones_are_not(
    arm: Arm, angles: Array, turns: Array
) -> None:
    distance, goal = TorusDistance(arm), arm.configuration(np.zeros(NV))
    turned = angles + 2.0 * math.pi * turns * arm.continuous
    value, _ = evaluated(distance, arm.configuration(angles), goal)
    same, _ = evaluated(distance, arm.configuration(turned), goal)
    assert same == pytest.approx(value, rel=1e-12, abs=1e-13)
    wound = np.where(arm.continuous, 0.0, 2.0 * math.pi)
    assert evaluated(distance, arm.configuration(wound), goal)[0] > 10.0


@given(angles=angle_vectors, goal_angles=angle_vectors, kappa=kappas)
def test_torus_distance_is_the_product_that_it_is_documented_to_be(
    arm: Arm, angles: Array, goal_angles: Array, kappa: float
) -> None:
    q, goal = arm.configuration(angles), arm.configuration(goal_angles)
    error = arm.difference(goal, q)
    costs = WEIGHTS * np.where(arm.continuous, 2.0 * np.sin(error / 2.0) ** 2, error**2 / 2.0)
    slopes = WEIGHTS * np.where(arm.continuous, np.sin(error), error)
    value, gradient = evaluated(TorusDistance(arm, WEIGHTS, kappa), q, goal)
    if math.isinf(kappa):
        expected, others = costs.sum(), np.ones(NV)
    else:
        expected = kappa * (np.prod(1.0 + costs / kappa) - 1.0)
        others = np.prod(1.0 + costs / kappa) / (1.0 + costs / kappa)
    assert value == pytest.approx(expected, rel=1e-9, abs=1e-12 * max(1.0, kappa))
    np.testing.assert_allclose(gradient, slopes * others, rtol=1e-9, atol=1e-12)


@settings(max_examples=40)
@given(angle_vectors)
def test_kappa_runs_from_the_product_to_the_sum(arm: Arm, angles: Array) -> None:
    goal, q = arm.configuration(np.zeros(NV)), arm.configuration(angles)
    costs = np.where(arm.continuous, 1.0 - np.cos(angles), angles**2 / 2.0)
    plain_sum, _ = evaluated(TorusDistance(arm, kappa=math.inf), q, goal)
    assert plain_sum == pytest.approx(costs.sum(), rel=1e-12, abs=1e-15)
    nearly, _ = evaluated(TorusDistance(arm, kappa=1e9), q, goal)
    assert nearly == pytest.approx(plain_sum, rel=1e-6)
    small = 1e-6
    product, _ = evaluated(ProductDistance(arm), q, goal)
    scaled = small ** (NV - 1) * evaluated(TorusDistance(arm, kappa=small), q, goal)[0]
    assert scaled == pytest.approx(product, rel=1e-3, abs=1e-3)


@settings(max_examples=40)
@given(angle_vectors, st.integers(0, NV - 1))
def test_product_is_degenerate_where_one_joint_is_at_its_goal(
    arm: Arm, angles: Array, joint: int
) -> None:
    goal, at_its_goal = np.zeros(NV), np.where(np.arange(NV) == joint, 0.0, angles)
    value, gradient = evaluated(
        ProductDistance(arm), arm.configuration(at_its_goal), arm.configuration(goal)
    )
    assert value == 0.0
    np.testing.assert_array_equal(gradient, np.zeros(NV))


@pytest.mark.parametrize(
    "options",
    [
        {"kappa": 0.0},
        {"kappa": math.nan},
        {"weights": [1.0]},
        {"weights": [0.0, 1.0, 1.0, 1.0]},
        {"weights": [1.0, 1.0, math.inf, 1.0]},
        {"weights": "mass"},
        {"weights": 3.0},
    ],
)
def test_torus_distance_refuses_what_cannot_be(arm: Arm, options: dict[str, Any]) -> None:
    with pytest.raises(InvalidValueError):
        TorusDistance(arm, **options)


def test_weights_by_inertia_are_those_of_the_stretched_rods(two_link: Arm) -> None:
    """8/3 and 1/3 kg m² about their own axes: two rods of 1 m and 1 kg."""
    weights = TorusDistance(two_link, "inertia").weights
    np.testing.assert_allclose(weights, [1.0, 0.125], rtol=1e-12)


def test_weights_by_inertia_are_taken_in_the_middle_of_the_limits(panda: Arm) -> None:
    middle = 0.5 * (panda.limits.lower + panda.limits.upper)
    inertia = panda.mass_matrix(middle).diagonal()
    weights = TorusDistance(panda, "inertia").weights
    np.testing.assert_allclose(weights, inertia / inertia.max(), rtol=1e-12)


# In the metric of the inertia


@pytest.fixture(scope="module")
def panda() -> Arm:
    return load_arm("panda")


@pytest.fixture(scope="module")
def two_link() -> Arm:
    return load_arm("two_link")


@settings(max_examples=40)
@given(e=arrays(np.float64, 7, elements=st.floats(-1.0, 1.0)))
def test_as_a_torque_it_leads_straight_to_the_goal(panda: Arm, e: Array) -> None:
    goal = panda.postures["ready"]
    q = panda.integrate(goal, e)
    value, gradient = evaluated(InertiaDistance(panda, goal), q, goal, 7)
    largest = panda.mass_matrix(goal).diagonal().max()
    straight = largest * np.linalg.solve(panda.mass_matrix(q), gradient)
    np.testing.assert_allclose(straight, e, atol=1e-9)
    assert value == pytest.approx(0.5 * e @ gradient, abs=1e-12)


@settings(max_examples=40)
@given(angles=arrays(np.float64, 2, elements=st.floats(-3.1, 3.1)))
def test_inertia_distance_is_positive_definite_on_continuous_joints(
    two_link: Arm, angles: Array
) -> None:
    goal = two_link.configuration([0.3, -2.0])
    q = two_link.integrate(goal, angles)
    value, _ = evaluated(InertiaDistance(two_link, goal), q, goal, 2)
    assert value >= 0.0
    if np.abs(angles).max() > 1e-6:
        assert value > 0.0
    assert evaluated(InertiaDistance(two_link, goal), goal, goal, 2)[0] == 0.0


def test_inertia_is_in_units_of_the_largest_where_it_is_asked_for(two_link: Arm) -> None:
    """And the goal is of the question, not of the distance."""
    q, goal = two_link.configuration([1.5, 0.5]), two_link.configuration([0.3, -2.0])
    units = [two_link.configuration([0.0, angle]) for angle in (0.0, 3.0)]
    (one, slope), (other, other_slope) = (
        evaluated(InertiaDistance(two_link, unit), q, goal, 2) for unit in units
    )
    largest = [two_link.mass_matrix(unit).diagonal().max() for unit in units]
    assert largest[0] > 1.5 * largest[1]
    assert one * largest[0] == pytest.approx(other * largest[1], rel=1e-12)
    np.testing.assert_allclose(slope * largest[0], other_slope * largest[1], rtol=1e-12)


def test_gradient_is_the_derivative_at_the_inertia_of_the_place(
    two_link: Arm, numerical_gradient: Callable[..., Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    goal, q = two_link.configuration([0.3, -2.0]), two_link.configuration([1.5, 0.5])
    distance = InertiaDistance(two_link, goal)
    _, gradient = evaluated(distance, q, goal, 2)
    held = two_link.mass_matrix(q)
    monkeypatch.setattr(two_link, "mass_matrix", lambda _: held)
    numerical = numerical_gradient(
        lambda p: evaluated(distance, p, goal, 2)[0], q, 2, two_link.integrate
    )
    np.testing.assert_allclose(gradient, numerical, rtol=1e-6)
