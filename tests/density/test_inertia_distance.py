"""InertiaDistance: positive definite, and as a torque it moves the arm straight to the goal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arm import load_arm
from densarm.density.inertia_distance import InertiaDistance

PANDA, TWO_LINK = load_arm("panda"), load_arm("two_link")


@given(e=arrays(np.float64, 7, elements=st.floats(-1.0, 1.0)))
def test_as_a_torque_it_leads_straight_to_the_goal(e):
    goal = PANDA.postures["ready"]
    distance, gradient = InertiaDistance(PANDA, goal), np.empty(7)
    q = PANDA.integrate(goal, e)
    value = distance.evaluate(q, gradient)
    largest = PANDA.mass_matrix(goal).diagonal().max()
    straight = largest * np.linalg.solve(PANDA.mass_matrix(q), gradient)
    np.testing.assert_allclose(straight, e, atol=1e-9)
    assert value == pytest.approx(0.5 * e @ gradient, abs=1e-12)


@given(angles=arrays(np.float64, 2, elements=st.floats(-3.1, 3.1)))
def test_is_positive_definite_on_circles(angles):
    goal = TWO_LINK.configuration([0.3, -2.0])
    distance, gradient = InertiaDistance(TWO_LINK, goal), np.empty(2)
    q = TWO_LINK.integrate(goal, angles)
    value, far = distance.evaluate(q, gradient), np.abs(angles).max() > 1e-6
    assert (value > 0.0) == far or not far
    np.testing.assert_allclose(distance.error(q), angles, atol=1e-9)


def test_gradient_is_the_derivative_at_the_inertia_of_the_place(numerical_gradient):
    goal = TWO_LINK.configuration([0.3, -2.0])
    distance, gradient = InertiaDistance(TWO_LINK, goal), np.empty(2)
    q = TWO_LINK.configuration([1.5, 0.5])
    distance.evaluate(q, gradient)
    held = TWO_LINK.mass_matrix(q)

    class Held:
        nq, nv, idx_q, is_circle = TWO_LINK.nq, 2, TWO_LINK.idx_q, TWO_LINK.is_circle

        @staticmethod
        def mass_matrix(at):
            return held if not np.array_equal(at, goal) else TWO_LINK.mass_matrix(goal)

    frozen = InertiaDistance(Held, goal)
    numerical = numerical_gradient(
        lambda p: frozen.evaluate(p, np.empty(2)), q, 2, TWO_LINK.integrate
    )
    np.testing.assert_allclose(gradient, numerical, rtol=1e-6)
