import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.errors import InvalidValueError
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.fields import NavigationField, NavigationFunction, PotentialField, saturate
from densarm.euclidean.implicit import Complement, Placed, UnsafeRegion, smallest_value
from densarm.euclidean.integral_curves import integral_curves
from densarm.euclidean.shapes import Ball
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome

GOAL = np.array([3.0, -2.0])
DISCS = (Ball(1.0), Placed(Ball(0.8), (-3.0, 2.0)))
WORLD = Complement(Ball(8.0))
FIELDS: list[NavigationField] = [
    EuclideanDensity([UnsafeRegion(Ball(1.0), Ball(1.8))], GOAL),
    NavigationFunction([*DISCS, WORLD], GOAL, kappa=4.0),
    PotentialField(DISCS, GOAL, influence=2.0),
]
controls = arrays(np.float64, (5, 3), elements=st.floats(-1e6, 1e6, allow_subnormal=False))
clouds = arrays(np.float64, (4, 2), elements=st.floats(-5.0, 5.0))


@pytest.mark.slow
@pytest.mark.parametrize("field", FIELDS, ids=lambda field: type(field).__name__)
@given(x=clouds)
def test_direction_is_parallel_to_the_gradient_of_the_height(
    field: NavigationField, x: Array
) -> None:
    assume(smallest_value(field.obstacles, x).min() > 0.05)
    assume(np.linalg.norm(x - GOAL, axis=1).min() > 0.05)
    step = 1e-6
    numerical = np.stack(
        [(field.height(x + a) - field.height(x - a)) / (2.0 * step) for a in step * np.eye(2)],
        axis=-1,
    )
    direction = field.direction(x)
    lengths = [np.linalg.norm(k, axis=1, keepdims=True) for k in (numerical, direction)]
    assume(min(length.min() for length in lengths) > 1e-3)
    units = numerical / lengths[0], direction / lengths[1]
    np.testing.assert_allclose(units[0], units[1], atol=1e-4)


@pytest.mark.parametrize("field", FIELDS[1:], ids=lambda field: type(field).__name__)
def test_baselines_lead_out_of_contact_and_rest_at_the_goal(field: NavigationField) -> None:
    rim = np.array([[1.0 + 1e-6, 0.0], [0.0, 1.0 + 1e-6]])
    assert (np.sum(field.direction(rim) * rim, axis=1) > 0.0).all()
    np.testing.assert_allclose(field.direction(GOAL), 0.0, atol=1e-12)


def test_the_height_of_a_navigation_function_is_that_of_beta_over_gamma() -> None:
    field = FIELDS[1]
    assert field.height(np.zeros(2)) == -np.inf
    x = np.array([2.0, 2.0])
    beta = np.prod([h(x) for h in field.obstacles])
    gamma = np.sum((x - GOAL) ** 2)
    assert field.height(x) == pytest.approx(np.log(beta**0.25 / gamma))


def test_a_navigation_function_reaches_in_a_sphere_world() -> None:
    field = NavigationFunction([*DISCS, WORLD], GOAL, kappa=10.0)
    points = np.random.default_rng(1).uniform(-5.0, 5.0, (80, 2))
    points = points[smallest_value(field.obstacles, points) > 0.0]
    assert integral_curves(field, points).count(Outcome.REACHED) == len(points)


def test_khatibs_potential_does_not_act_beyond_its_influence() -> None:
    field = PotentialField(DISCS, GOAL, influence=0.5)
    x = np.array([[2.0, 2.0], [-1.0, -3.0]])
    np.testing.assert_array_equal(field.direction(x), GOAL - x)


def test_parameters_out_of_range_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="kappa"):
        NavigationFunction(DISCS, GOAL, kappa=0.0)
    with pytest.raises(InvalidValueError, match="influence"):
        PotentialField(DISCS, GOAL, influence=-1.0)


@given(controls, st.floats(1e-3, 1e3))
def test_keeps_the_direction_and_the_bound(u: Array, u_max: float) -> None:
    bounded = saturate(u, u_max)
    assert np.abs(bounded).max() <= u_max * (1.0 + 1e-12)
    largest = np.abs(u).max(axis=1, keepdims=True)
    scaled = bounded * np.maximum(largest, u_max)
    # Below the normal doubles there is no relative accuracy.
    np.testing.assert_allclose(scaled, u * u_max, rtol=1e-12, atol=1e-300)
    inside = largest[:, 0] <= u_max
    np.testing.assert_array_equal(bounded[inside], u[inside])


def test_infinity_bounds_nothing() -> None:
    u = np.array([1e300, -1.0])
    np.testing.assert_array_equal(saturate(u, np.inf), u)


@pytest.mark.parametrize("u_max", [0.0, -1.0, np.nan])
def test_refuses_a_bound_that_is_not_positive(u_max: float) -> None:
    with pytest.raises(InvalidValueError, match="u_max"):
        saturate(np.ones(2), u_max)
