"""Checks of values, and what they let through."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError
from densarm.values.checks import (
    finite_tuple,
    finite_vector,
    non_negative,
    one_of,
    positive,
    positive_integer,
    unit_quaternion,
)


@pytest.mark.parametrize(
    "value", [[1, 2], (1.0, 2.0), np.array([1, 2]), np.array([1, 2], np.float32)]
)
def test_vectors(value: ArrayLike) -> None:
    vector = finite_vector("v", value, 2)
    assert vector.dtype == np.float64
    np.testing.assert_array_equal(vector, [1.0, 2.0])
    assert finite_tuple("v", value, 2) == (1.0, 2.0)


def test_vectors_are_copies() -> None:
    given = np.zeros(2)
    finite_vector("v", given, 2)[0] = 1.0
    assert given[0] == 0.0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([1.0], r"v = \[1.0\]: must be of shape \(2,\), got \(1,\)"),
        ([[1.0, 2.0]], r"\(2,\), got \(1, 2\)"),
        (1.0, r"\(2,\), got \(\)"),
        ([1.0, np.nan], r"v = \[1.0, nan\]: must be finite numbers"),
        ([1.0, -np.inf], "must be finite numbers"),
        ([1.0, None], "must be 2 numbers"),
        (["1", "2"], "must be 2 numbers"),
        ([True, False], "must be 2 numbers"),
        ([[1.0], [1.0, 2.0]], "must be 2 numbers"),
        ([1j, 2], "must be 2 numbers"),
        ([10**400, 1], "must be 2 numbers"),
        (None, "must be 2 numbers"),
    ],
)
def test_wrong_vectors(value: Any, message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        finite_vector("v", value, 2)


@pytest.mark.parametrize("value", [1, 0.5, np.float32(2), np.int64(3), Fraction(1, 3)])
def test_positive_numbers(value: Any) -> None:
    for check in (positive, non_negative):
        assert check("x", value) == float(value)
        assert type(check("x", value)) is float


@pytest.mark.parametrize("value", [-1, np.nan, np.inf, "1", None, True, 1j, [1]])
def test_wrong_numbers(value: Any) -> None:
    for check in (positive, non_negative):
        with pytest.raises(InvalidValueError, match=r"x = .*must be a finite number >"):
            check("x", value)


def test_zero() -> None:
    assert non_negative("x", 0) == 0.0
    with pytest.raises(InvalidValueError, match="> 0"):
        positive("x", 0)


def test_integers() -> None:
    assert type(positive_integer("n", np.int32(3))) is int
    wrong: tuple[Any, ...] = (0, -1, 1.0, True, "1")
    for value in wrong:
        with pytest.raises(InvalidValueError, match=r"n = .*an integer >= 1"):
            positive_integer("n", value)


def test_one_of() -> None:
    assert one_of("kind", "a", {"a", "b"}) == "a"
    with pytest.raises(InvalidValueError, match="kind = 'c': must be one of a, b"):
        one_of("kind", "c", {"b", "a"})


def test_quaternions() -> None:
    assert unit_quaternion("o", [0, 0, 0, 1]) == (0.0, 0.0, 0.0, 1.0)
    scaled = unit_quaternion("o", [0, 0, 0.7071, 0.7071])
    assert np.linalg.norm(scaled) == pytest.approx(1.0, abs=1e-15)
    assert unit_quaternion("o", scaled) == scaled
    for value in ([0, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, np.nan], [0, 0, 1]):
        with pytest.raises(InvalidValueError, match="o = "):
            unit_quaternion("o", value)
