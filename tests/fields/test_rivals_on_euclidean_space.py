import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.implicit_function import Complement, Placed, UnsafeRegion, smallest_value
from densarm.density.implicit_shapes import Ball
from densarm.errors import InvalidValueError
from densarm.fields.integral_curves import integral_curves
from densarm.fields.navigation_function import NavigationFunction
from densarm.fields.potential_field import PotentialField
from densarm.outcome import Outcome

GOAL = np.array([3.0, -2.0])
DISCS = (Ball(1.0), Placed(Ball(0.8), (-3.0, 2.0)))
WORLD = Complement(Ball(8.0))
FIELDS = [
    EuclideanDensity([UnsafeRegion(Ball(1.0), Ball(1.8))], GOAL),
    NavigationFunction([*DISCS, WORLD], GOAL, kappa=4.0),
    PotentialField(DISCS, GOAL, influence=2.0),
]
clouds = arrays(np.float64, (4, 2), elements=st.floats(-5.0, 5.0))


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: type(field).__name__)
@given(x=clouds)
def test_direction_is_parallel_to_the_gradient_of_the_height(field, x):
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
def test_rivals_lead_out_of_contact_and_rest_at_the_goal(field):
    rim = np.array([[1.0 + 1e-6, 0.0], [0.0, 1.0 + 1e-6]])
    assert (np.sum(field.direction(rim) * rim, axis=1) > 0.0).all()
    np.testing.assert_allclose(field.direction(GOAL), 0.0, atol=1e-12)


def test_the_value_of_a_navigation_function_runs_from_zero_to_one():
    field = FIELDS[1]
    assert field.value(GOAL) == pytest.approx(0.0, abs=1e-12)
    assert field.value(np.zeros(2)) == 1.0
    x = np.array([2.0, 2.0])
    beta = np.prod([h(x) for h in field.obstacles])
    gamma = np.sum((x - GOAL) ** 2)
    assert field.value(x) == pytest.approx(gamma / (gamma + beta**0.25))


def test_a_navigation_function_reaches_in_a_sphere_world():
    field = NavigationFunction([*DISCS, WORLD], GOAL, kappa=10.0)
    points = np.random.default_rng(1).uniform(-5.0, 5.0, (80, 2))
    points = points[smallest_value(field.obstacles, points) > 0.0]
    assert integral_curves(field, points).rate(Outcome.REACHED) == 1.0


def test_khatibs_potential_does_not_act_beyond_its_influence():
    field = PotentialField(DISCS, GOAL, influence=0.5)
    x = np.array([[2.0, 2.0], [-1.0, -3.0]])
    np.testing.assert_array_equal(field.direction(x), GOAL - x)


def test_parameters_out_of_range_are_refused():
    with pytest.raises(InvalidValueError, match="kappa"):
        NavigationFunction(DISCS, GOAL, kappa=0.0)
    with pytest.raises(InvalidValueError, match="influence"):
        PotentialField(DISCS, GOAL, influence=-1.0)
