"""The navigation density: its gradients in every gauge, its blend, its goal."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.arms.joint_space import EuclideanSpace
from densarm.density.goal_distance import EuclideanDistance, TorusDistance
from densarm.density.navigation_density import (
    DensityParameters,
    DensitySample,
    Gauge,
    NavigationDensity,
    density_towards,
    write_gauge_gradient,
)
from densarm.density.unsafe_sets import (
    ClearanceSet,
    ImplicitSet,
    JointLimitSet,
    SensingParameters,
    UnsafeSet,
)
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.world import World

PLANE = EuclideanSpace(2)
GOAL = np.array([3.0, 0.5])
points = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0)).map(np.array)
alphas = st.sampled_from([0.1, 0.5, 1.0, 2.0])
FUNCTIONS: dict[Gauge, Callable[[DensitySample], float]] = {
    Gauge.DENSITY: lambda sample: sample.value,
    Gauge.LOG: lambda sample: sample.log_value,
    Gauge.RECIPROCAL: lambda sample: -1.0 / sample.value,
}
MakeDensity = Callable[..., NavigationDensity]
Disc = tuple[Callable[[Array], tuple[float, Array]], Callable[[Array], tuple[float, Array]]]


def in_the_plane(goal: Array, *unsafe_sets: UnsafeSet, **parameters: Any) -> NavigationDensity:
    return NavigationDensity(
        PLANE, goal, unsafe_sets, EuclideanDistance(), DensityParameters(**parameters)
    )


@pytest.fixture(scope="module")
def density(disc: Disc) -> MakeDensity:
    return lambda **parameters: in_the_plane(GOAL, ImplicitSet(*disc), **parameters)


@pytest.mark.parametrize("gauge", list(Gauge))
@settings(max_examples=40)
@given(x=points, alpha=alphas, theta=st.sampled_from([0.0, 0.1]))
def test_gradient_is_the_derivative_of_the_gauge(
    density: MakeDensity,
    numerical_gradient: Callable[..., Array],
    gauge: Gauge,
    x: Array,
    alpha: float,
    theta: float,
) -> None:
    assume(np.linalg.norm(x) > 1.1)
    assume(np.linalg.norm(x - GOAL) > 0.1)
    field = density(alpha=alpha, theta=theta)
    gradient = field.evaluate(x).gradient(gauge)
    numerical = numerical_gradient(lambda y: FUNCTIONS[gauge](field.evaluate(y)), x, 2)
    scale = np.abs(gradient).max() + abs(FUNCTIONS[gauge](field.evaluate(x)))
    np.testing.assert_allclose(gradient, numerical, atol=1e-5 * scale)


@pytest.mark.parametrize("gauge", list(Gauge))
def test_remainder_of_the_linear_model_is_quadratic(density: MakeDensity, gauge: Gauge) -> None:
    field, function = density(alpha=0.5), FUNCTIONS[gauge]
    x, direction = np.array([-1.5, 0.3]), np.array([0.6, 0.8])
    sample = field.evaluate(x)
    slope = sample.gradient(gauge) @ direction
    steps = np.logspace(-4, -2.5, 9)
    remainders = [
        abs(function(field.evaluate(x + step * direction)) - function(sample) - step * slope)
        for step in steps
    ]
    order = np.polyfit(np.log(steps), np.log(remainders), 1)[0]
    assert order == pytest.approx(2.0, abs=0.05)


@given(points, alphas)
def test_gauges_are_parallel(density: MakeDensity, x: Array, alpha: float) -> None:
    sample = density(alpha=alpha).evaluate(x)
    assume(sample.log_psi > -300.0)
    directions = [sample.gradient(gauge) for gauge in Gauge]
    lengths = [np.linalg.norm(direction) for direction in directions]
    assume(min(lengths) > 0.0)
    units = [direction / length for direction, length in zip(directions, lengths, strict=True)]
    np.testing.assert_allclose(units, [units[0]] * 3, atol=1e-12)


@given(points, alphas)
def test_every_gauge_is_finite_everywhere(density: MakeDensity, x: Array, alpha: float) -> None:
    sample = density(alpha=alpha).evaluate(x)
    assert not math.isnan(sample.log_value)
    assert sample.value >= 0.0
    for gauge in Gauge:
        assert np.isfinite(np.linalg.norm(sample.gradient(gauge)))


@given(st.floats(-math.pi, math.pi), st.sampled_from([1e-3, 1e-8, 1e-30, 1e-170]))
def test_reciprocal_gauge_is_linear_near_the_goal(angle: float, distance: float) -> None:
    error = distance * np.array([math.cos(angle), math.sin(angle)])
    field = in_the_plane(np.zeros(2))
    np.testing.assert_allclose(
        field.evaluate(error).gradient(Gauge.RECIPROCAL), -2.0 * error, rtol=1e-12
    )


@given(alphas)
def test_the_goal_is_an_exact_equilibrium_in_every_gauge(
    density: MakeDensity, alpha: float
) -> None:
    sample = density(alpha=alpha).evaluate(GOAL)
    assert sample.log_value == math.inf
    assert sample.value == math.inf
    for gauge in Gauge:
        np.testing.assert_array_equal(sample.gradient(gauge), np.zeros(2))


def test_the_goal_is_an_equilibrium_inside_a_sensing_region(disc: Disc) -> None:
    goal = np.array([1.5, 0.0])
    field = in_the_plane(goal, ImplicitSet(*disc))
    sample = field.evaluate(goal)
    assert sample.log_psi < 0.0
    assert np.abs(sample.log_psi_gradient).max() > 0.1
    np.testing.assert_array_equal(sample.gradient(Gauge.RECIPROCAL), np.zeros(2))


def test_the_density_gauge_saturates_towards_the_goal() -> None:
    field = in_the_plane(np.zeros(2))
    gradient = field.evaluate(np.array([1e-60, 0.0])).gradient(Gauge.DENSITY)
    np.testing.assert_allclose(gradient, [-1e150, 0.0], rtol=1e-12)


def test_contact_pushes_out_but_in_the_flat_density_gauge(density: MakeDensity) -> None:
    sample = density().evaluate(np.array([-0.9, 0.0]))
    assert sample.log_value == -math.inf
    assert sample.value == 0.0
    np.testing.assert_array_equal(sample.gradient(Gauge.DENSITY), np.zeros(2))
    assert sample.log_gradient[0] < 0.0
    np.testing.assert_allclose(sample.gradient(Gauge.RECIPROCAL)[0], -1e150, rtol=1e-12)


def test_a_goal_in_contact_has_no_density(disc: Disc) -> None:
    field = in_the_plane(np.zeros(2), ImplicitSet(*disc))
    assert field.evaluate(np.zeros(2)).value == 0.0


@given(points, st.sampled_from(list(Gauge)))
def test_the_blend_is_the_gradient_outside_and_linear_inside(
    density: MakeDensity, x: Array, gauge: Gauge
) -> None:
    sample = density(gauge=gauge, blend_radius=0.7).evaluate(x)
    blended, distance = sample.blended_gradient(), np.linalg.norm(sample.goal_error)
    if distance <= 0.7:
        np.testing.assert_array_equal(blended, -sample.goal_error)
    elif distance >= 1.4:
        np.testing.assert_array_equal(blended, sample.gradient(gauge))
    else:
        between = np.sort([sample.gradient(gauge), -sample.goal_error], axis=0)
        assert ((between[0] - 1e-12 <= blended) & (blended <= between[1] + 1e-12)).all()


def test_without_a_radius_nothing_is_blended(density: MakeDensity) -> None:
    sample = density().evaluate(GOAL + 1e-9)
    np.testing.assert_array_equal(sample.blended_gradient(), sample.gradient(Gauge.RECIPROCAL))


def test_update_and_write_gradient_work_in_place_and_samples_are_copies(
    density: MakeDensity,
) -> None:
    field, out = density(), np.empty(2)
    held = field.log_psi_gradient, field.goal_distance_gradient
    first = field.evaluate(np.array([-1.2, 0.1]))
    kept = first.log_psi_gradient.copy()
    second = field.evaluate(np.array([-1.5, 0.2]))
    np.testing.assert_array_equal(first.log_psi_gradient, kept)
    assert field.log_psi_gradient is held[0]
    assert field.goal_distance_gradient is held[1]
    for gauge in Gauge:
        field.write_gradient(gauge, out)
        np.testing.assert_array_equal(out, second.gradient(gauge))


@settings(max_examples=40)
@given(st.lists(st.floats(-1.4, 1.4), min_size=3, max_size=3))
def test_bumps_of_all_sets_multiply(joint_space: Callable[..., Arm], angles: list[float]) -> None:
    arm = joint_space("bcb", lower=[-1.5] * 3, upper=[1.5] * 3)
    sets = [JointLimitSet(arm, 0.5), JointLimitSet(arm, 1.0)]
    q, goal = arm.configuration(angles), arm.configuration([0.3, 0.2, 0.1])
    together = NavigationDensity(arm, goal, sets, TorusDistance(arm)).evaluate(q)
    apart = [NavigationDensity(arm, goal, [one], TorusDistance(arm)).evaluate(q) for one in sets]
    assert together.log_psi == pytest.approx(sum(one.log_psi for one in apart), rel=1e-12)
    np.testing.assert_allclose(
        together.log_psi_gradient, sum(one.log_psi_gradient for one in apart), rtol=1e-12
    )


@given(
    points,
    points,
    st.floats(1e-300, 1e3),
    alphas,
    st.floats(-800.0, 0.0),
    st.sampled_from([(-2.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]),
)
def test_kernel_equals_its_python_form(
    log_gradient: Array,
    gradient: Array,
    distance: float,
    alpha: float,
    log_psi: float,
    exponents: tuple[float, float],
) -> None:
    compiled, plain = np.empty(2), np.empty(2)
    arguments = (log_gradient, distance, gradient, alpha, log_psi, *exponents)
    write_gauge_gradient(*arguments, compiled)
    write_gauge_gradient.py_func(*arguments, plain)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("name", ["alpha", "theta", "blend_radius"])
@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_parameters_out_of_range_are_refused(name: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=name):
        DensityParameters(**{name: value})


def test_a_gauge_is_known_by_its_name() -> None:
    names: list[Any] = ["log", "linear"]
    assert DensityParameters(gauge=names[0]).gauge is Gauge.LOG
    with pytest.raises(InvalidValueError, match="reciprocal"):
        DensityParameters(gauge=names[1])
    with pytest.raises(InvalidValueError, match="alpha"):
        DensityParameters(alpha=0.0)


def test_a_sample_cannot_be_changed(density: MakeDensity) -> None:
    sample = density().evaluate(np.zeros(2))
    assert isinstance(sample, DensitySample)
    with pytest.raises(AttributeError):
        sample.log_psi = 0.0  # type: ignore[misc]


# The goal and the distance to it


class TaxicabDistance:
    """An own goal distance, smooth: the sum of √(1 + e²) − 1."""

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        root = np.sqrt(1.0 + (q - goal) ** 2)
        np.divide(q - goal, root, out=out_gradient)
        return float((root - 1.0).sum())


@given(x=points, alpha=alphas)
def test_a_goal_distance_is_any_object_with_one_method(
    disc: Disc, numerical_gradient: Callable[..., Array], x: Array, alpha: float
) -> None:
    assume(np.linalg.norm(x) > 1.1)
    assume(np.linalg.norm(x - GOAL) > 0.1)
    field = NavigationDensity(
        PLANE, GOAL, [ImplicitSet(*disc)], TaxicabDistance(), DensityParameters(alpha=alpha)
    )
    sample = field.evaluate(x)
    assert sample.goal_distance == pytest.approx((np.sqrt(1.0 + (x - GOAL) ** 2) - 1.0).sum())
    numerical = numerical_gradient(lambda y: field.evaluate(y).log_value, x, 2)
    np.testing.assert_allclose(sample.log_gradient, numerical, rtol=1e-5, atol=1e-5)
    assert field.evaluate(GOAL).value == math.inf


@given(x=points, goal=points)
def test_a_goal_that_was_moved_is_that_of_a_new_density(
    density: MakeDensity, disc: Disc, x: Array, goal: Array
) -> None:
    moved, given_goal = density(), goal.copy()
    moved.evaluate(x)
    moved.set_goal(given_goal)
    given_goal[:] = np.nan  # the density keeps its own
    sample, expected = moved.evaluate(x), in_the_plane(goal, ImplicitSet(*disc)).evaluate(x)
    np.testing.assert_array_equal(moved.goal, goal)
    assert sample.goal_distance == expected.goal_distance
    assert sample.log_value == expected.log_value
    np.testing.assert_array_equal(sample.goal_error, x - goal)
    for gauge in Gauge:
        np.testing.assert_array_equal(sample.gradient(gauge), expected.gradient(gauge))


def test_the_goal_that_is_given_stays_as_it_is() -> None:
    goal = np.array([1.0, 2.0])
    in_the_plane(goal).set_goal(np.zeros(2))
    np.testing.assert_array_equal(goal, [1.0, 2.0])


angles_of_three = st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3)


@settings(max_examples=40)
@given(goal=angles_of_three, angles=angles_of_three)
def test_error_integrates_the_goal_to_the_configuration(
    joint_space: Callable[..., Arm], goal: list[float], angles: list[float]
) -> None:
    arm = joint_space("bcb")
    field = NavigationDensity(arm, arm.configuration(goal), [], TorusDistance(arm))
    q = arm.configuration(angles)
    error = field.error(q)
    assert (np.abs(error[arm.continuous]) <= math.pi).all()
    np.testing.assert_allclose(arm.integrate(field.goal, error), q, atol=1e-12)
    np.testing.assert_array_equal(field.evaluate(q).goal_error, error)


def test_a_goal_of_the_wrong_shape_is_refused(joint_space: Callable[..., Arm]) -> None:
    arm = joint_space("bcb")
    hint = r"goal = .*\(4,\), got \(3,\).*arm.configuration"
    with pytest.raises(InvalidValueError, match=hint):
        NavigationDensity(arm, np.zeros(3), [], TorusDistance(arm))
    field = NavigationDensity(arm, arm.configuration(np.zeros(3)), [], TorusDistance(arm))
    for wrong in (np.zeros(3), np.zeros(1), np.zeros((1, 4))):
        with pytest.raises(InvalidValueError, match=r"goal = .*of shape \(4,\)"):
            field.set_goal(wrong)
    with pytest.raises(InvalidValueError, match="goal"):
        in_the_plane(np.zeros(3))
    with pytest.raises(InvalidValueError, match=r"goal = .*finite"):
        in_the_plane(np.array([0.0, np.nan]))


# Of an arm


@settings(max_examples=40)
@given(angles=st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2))
def test_the_plain_density_is_that_of_all_pairs_and_limits(
    two_link_world: World, angles: list[float]
) -> None:
    arm = two_link_world.arm
    goal, q = arm.configuration([1.0, 0.5]), arm.configuration(angles)
    parameters = DensityParameters(alpha=0.7)
    plain = density_towards(
        two_link_world,
        goal,
        margin=0.01,
        kappa=2.0,
        parameters=parameters,
        sensing=SensingParameters(distance=0.2, joint=0.3),
    )
    sets: list[UnsafeSet] = [ClearanceSet(two_link_world, 0.01, 0.2), JointLimitSet(arm, 0.3)]
    distance = TorusDistance(arm, kappa=2.0)
    sample = plain.evaluate(q)
    expected = NavigationDensity(arm, goal, sets, distance, parameters).evaluate(q)
    assert sample.log_value == expected.log_value
    for gauge in Gauge:
        np.testing.assert_array_equal(sample.gradient(gauge), expected.gradient(gauge))


def test_the_plain_density_takes_another_goal_distance(two_link_world: World) -> None:
    arm = two_link_world.arm
    q, goal = arm.configuration([0.3, 0.4]), arm.configuration([1.0, 0.5])
    weighted = TorusDistance(arm, [8.0, 1.0])
    plain = density_towards(two_link_world, goal, goal_distance=weighted)
    assert plain.evaluate(q).goal_distance == weighted.evaluate(q, goal, np.empty(2))


def test_the_plain_density_refuses_what_is_no_goal(two_link_world: World) -> None:
    with pytest.raises(InvalidValueError, match=r"goal = .*arm.configuration"):
        density_towards(two_link_world, np.array([1.0, 0.5]))
    with pytest.raises(InvalidValueError, match=r"goal of joint 'shoulder'.*\(cos, sin\)"):
        density_towards(two_link_world, np.array([2.0, 0.0, 1.0, 0.0]))


@pytest.fixture(scope="module")
def two_link_world() -> World:
    ball = Sphere(name="ball", radius=0.3, position=(0.9, 0.0, -1.2))
    return World(load_arm("two_link"), Scene([ball]))
