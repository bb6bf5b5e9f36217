from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.errors import InvalidValueError
from densarm.euclidean.implicit import Complement, ImplicitFunction, Lowered, Placed, smallest_value
from densarm.euclidean.shapes import Ball, Bowtie, Egg, Torus
from densarm.values.arrays import Array

ROTATION = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
WRAPPED = [
    Placed(Bowtie(2.0, 0.3), (0.5, -0.2), 0.7, (1.5, 0.5)),
    Lowered(Egg(1.0, 1.0, 1.2, 1.0), 0.5),
    Complement(Ball(1.0)),
    Placed(Placed(Ball(1.0), (0.3, 0.0)), (0.1, 0.1), 1.0, 2.0),
]


@pytest.mark.parametrize("function", WRAPPED, ids=lambda function: type(function).__name__)
@given(x=arrays(np.float64, (3, 2), elements=st.floats(-2.0, 2.0)))
def test_gradient_is_the_derivative(function: ImplicitFunction, x: Array) -> None:
    step = 1e-6
    numerical = np.stack(
        [(function(x + axis) - function(x - axis)) / (2.0 * step) for axis in step * np.eye(2)],
        axis=-1,
    )
    scale = 1.0 + np.abs(numerical).max()
    np.testing.assert_allclose(function.gradient(x), numerical, atol=1e-6 * scale)


def test_placing_moves_turns_and_stretches() -> None:
    ellipse = Placed(Ball(1.0), (1.0, 2.0), np.pi / 2.0, (3.0, 0.5))
    rim = np.array([[1.0, 5.0], [1.0, -1.0], [1.5, 2.0], [0.5, 2.0]])
    np.testing.assert_allclose(ellipse(rim), 0.0, atol=1e-12)


def test_placing_in_space_turns_by_a_matrix() -> None:
    torus = Placed(Torus(2.0, 0.5), (0.0, 0.0, 1.0), ROTATION)
    axis = ROTATION @ np.array([0.0, 0.0, 1.0])  # of the torus, now
    across = np.array([0.0, 1.0, 0.0])
    assert axis @ across == 0.0
    np.testing.assert_allclose(torus(np.array([0.0, 0.0, 1.0]) + 2.5 * across), 0.0, atol=1e-12)
    assert torus(np.array([0.0, 0.0, 1.0]) + 2.0 * axis) > 0.0


def test_smallest_value_of_none_is_infinite() -> None:
    x = np.zeros((4, 2))
    np.testing.assert_array_equal(smallest_value([], x), np.full(4, np.inf))
    np.testing.assert_array_equal(smallest_value([Ball(1.0), Ball(2.0)], x), np.full(4, -4.0))


@pytest.mark.parametrize(
    "make",
    [
        lambda: Placed(Ball(1.0), (0.0, 0.0), [[1.0, 0.5], [0.0, 1.0]]),
        lambda: Placed(Ball(1.0), (0.0, 0.0, 0.0), 0.5),
        lambda: Placed(Ball(1.0), (0.0, 0.0), scale=(1.0, 0.0)),
        lambda: Placed(Ball(1.0), (0.0, 0.0), scale=(1.0, 1.0, 1.0)),
        lambda: Placed(Ball(1.0), (0.0, np.nan)),
        lambda: Lowered(Ball(1.0), 0.0),
    ],
)
def test_impossible_placements_are_refused(make: Callable[[], ImplicitFunction]) -> None:
    with pytest.raises(InvalidValueError):
        make()
