import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.density import EuclideanDistance, ProductDistance, TorusDistance, joint_error
from densarm.density.goal_distance import torus_distance
from densarm.errors import InvalidValueError

KINDS, NV = "bcbc", 4
angle_vectors = arrays(np.float64, NV, elements=st.floats(-3.0, 3.0))
kappas = st.sampled_from([1e-3, 0.1, 1.0, 10.0, math.inf])
WEIGHTS = np.array([1.0, 2.0, 0.5, 3.0])


def value_of(distance, q):
    return distance.evaluate(q, np.empty(NV))


@pytest.fixture(scope="module")
def arm(joint_space):
    return joint_space(KINDS)


@pytest.fixture(scope="module", params=["euclidean", "torus", "sum", "product"])
def distance(request, arm):
    """Every implementation, at a goal of zeros."""
    goal = arm.configuration(np.zeros(NV))
    return {
        "euclidean": lambda: EuclideanDistance(np.zeros(NV)),
        "torus": lambda: TorusDistance(arm, goal, WEIGHTS),
        "sum": lambda: TorusDistance(arm, goal, WEIGHTS, kappa=math.inf),
        "product": lambda: ProductDistance(arm, goal),
    }[request.param]()


def configuration(arm, distance, angles):
    return angles if isinstance(distance, EuclideanDistance) else arm.configuration(angles)


@given(angles=angle_vectors)
def test_gradient_is_the_derivative(arm, distance, numerical_gradient, angles):
    integrate = np.add if isinstance(distance, EuclideanDistance) else arm.integrate
    q, gradient = configuration(arm, distance, angles), np.empty(NV)
    value = distance.evaluate(q, gradient)
    numerical = numerical_gradient(lambda p: value_of(distance, p), q, NV, integrate)
    np.testing.assert_allclose(gradient, numerical, rtol=1e-6, atol=1e-8 * (1.0 + value))


def test_remainder_of_the_linear_model_is_quadratic(arm, distance):
    rng = np.random.default_rng(0)
    angles, direction = rng.normal(size=(2, NV))
    gradient = np.empty(NV)
    value = distance.evaluate(configuration(arm, distance, angles), gradient)
    steps = np.logspace(-4, -2, 9)
    remainders = [
        abs(
            value_of(distance, configuration(arm, distance, angles + step * direction))
            - value
            - step * gradient @ direction
        )
        for step in steps
    ]
    order = np.polyfit(np.log(steps), np.log(remainders), 1)[0]
    assert order == pytest.approx(2.0, abs=0.1)


@given(angles=angle_vectors)
def test_is_zero_at_the_goal_and_never_negative(arm, distance, angles):
    q = configuration(arm, distance, angles)
    assert value_of(distance, q) >= 0.0
    distance.set_goal(q)
    gradient = np.full(NV, np.nan)
    assert distance.evaluate(q, gradient) == 0.0
    np.testing.assert_array_equal(gradient, np.zeros(NV))
    distance.set_goal(configuration(arm, distance, np.zeros(NV)))


def test_a_goal_of_the_wrong_shape_is_refused(distance):
    with pytest.raises(InvalidValueError, match="configuration"):
        distance.set_goal(np.zeros(NV - 1))


@given(angles=angle_vectors, kappa=kappas)
def test_torus_distance_is_positive_definite(arm, angles, kappa):
    distance = TorusDistance(arm, arm.configuration(np.zeros(NV)), kappa=kappa)
    if np.abs(angles).max() > 1e-6:
        assert value_of(distance, arm.configuration(angles)) > 0.0


@pytest.mark.parametrize("kappa", [1e-3, 1.0, math.inf])
def test_torus_distance_keeps_tiny_errors(arm, kappa):
    distance = TorusDistance(arm, arm.configuration(np.zeros(NV)), WEIGHTS, kappa)
    gradient = np.empty(NV)
    value = distance.evaluate(arm.configuration(np.full(NV, 1e-8)), gradient)
    assert value == pytest.approx(WEIGHTS.sum() * 1e-16 / 2.0, rel=1e-12)
    np.testing.assert_allclose(gradient, WEIGHTS * 1e-8, rtol=1e-12)


@given(angles=angle_vectors, turns=arrays(np.int64, NV, elements=st.integers(-2, 2)))
def test_circle_joints_are_periodic_and_bounded_ones_are_not(arm, angles, turns):
    distance = TorusDistance(arm, arm.configuration(np.zeros(NV)))
    turned = angles + 2.0 * math.pi * turns * arm.is_circle
    value = value_of(distance, arm.configuration(angles))
    same = value_of(distance, arm.configuration(turned))
    assert same == pytest.approx(value, rel=1e-12, abs=1e-13)
    wound = np.where(arm.is_circle, 0.0, 2.0 * math.pi)
    assert value_of(distance, arm.configuration(wound)) > 10.0


@given(angle_vectors)
def test_kappa_runs_from_the_product_to_the_sum(arm, angles):
    goal, q = arm.configuration(np.zeros(NV)), arm.configuration(angles)
    costs = np.where(arm.is_circle, 1.0 - np.cos(angles), angles**2 / 2.0)
    plain_sum = value_of(TorusDistance(arm, goal, kappa=math.inf), q)
    assert plain_sum == pytest.approx(costs.sum(), rel=1e-12, abs=1e-15)
    assert value_of(TorusDistance(arm, goal, kappa=1e9), q) == pytest.approx(plain_sum, rel=1e-6)
    small = 1e-6
    product = value_of(ProductDistance(arm, goal), q)
    scaled = small ** (NV - 1) * value_of(TorusDistance(arm, goal, kappa=small), q)
    assert scaled == pytest.approx(product, rel=1e-3, abs=1e-3)


@given(angle_vectors, st.integers(0, NV - 1))
def test_product_is_degenerate_where_one_joint_is_at_its_goal(arm, angles, joint):
    distance = ProductDistance(arm, arm.configuration(np.zeros(NV)))
    gradient = np.empty(NV)
    at_its_goal = np.where(np.arange(NV) == joint, 0.0, angles)
    assert distance.evaluate(arm.configuration(at_its_goal), gradient) == 0.0
    np.testing.assert_array_equal(gradient, np.zeros(NV))


@given(angle_vectors, angle_vectors)
def test_error_integrates_the_goal_to_the_configuration(arm, goal, angles):
    distance = TorusDistance(arm, arm.configuration(goal))
    q = arm.configuration(angles)
    error = distance.error(q)
    assert (np.abs(error[arm.is_circle]) <= math.pi).all()
    np.testing.assert_allclose(arm.integrate(distance.goal, error), q, atol=1e-12)
    np.testing.assert_array_equal(ProductDistance(arm, distance.goal).error(q), error)


@given(angle_vectors, angle_vectors, kappas)
def test_kernels_equal_their_python_form(arm, goal, angles, kappa):
    q_goal, q = arm.configuration(goal), arm.configuration(angles)
    compiled, plain = np.empty(NV), np.empty(NV)
    joint_error(q_goal, q, arm.idx_q, arm.is_circle, compiled)
    joint_error.py_func(q_goal, q, arm.idx_q, arm.is_circle, plain)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-15)
    arguments = (q_goal, q, arm.idx_q, arm.is_circle, WEIGHTS, kappa)
    value = torus_distance(*arguments, compiled)
    assert value == pytest.approx(torus_distance.py_func(*arguments, plain), rel=1e-12)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-12 * np.abs(plain).max())


@pytest.mark.parametrize(
    "options",
    [{"kappa": 0.0}, {"kappa": math.nan}, {"weights": [1.0]}, {"weights": [0.0, 1.0, 1.0, 1.0]}],
)
def test_torus_distance_refuses_what_cannot_be(arm, options):
    with pytest.raises(InvalidValueError):
        TorusDistance(arm, arm.configuration(np.zeros(NV)), **options)


def test_a_vector_of_angles_is_refused_with_the_remedy(arm):
    with pytest.raises(InvalidValueError, match="configuration"):
        TorusDistance(arm, np.zeros(NV))
