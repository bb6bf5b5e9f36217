"""Checks of values at construction, each raising one `InvalidValueError`."""

import math
from collections.abc import Collection
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.errors import InvalidValueError


def finite_vector(name: str, value: ArrayLike, length: int, hint: str = "") -> Array:
    """Return `value` as a float array of shape (length,).

    Args:
        name: how errors call the value.
        value: anything numpy reads as a vector.
        length: its required length.
        hint: appended to the error of a wrong length.

    Raises:
        InvalidValueError: a wrong shape (expected and got), or an entry that is not finite.
    """
    vector = _array_of_numbers(value)
    if vector is None:
        raise InvalidValueError(name, value, f"{length} numbers")
    if vector.shape != (length,):
        shape = f"of shape ({length},), got {vector.shape}{hint}"
        raise InvalidValueError(name, value, shape)
    if not np.isfinite(vector).all():
        raise InvalidValueError(name, value, "finite numbers")
    return vector


def positive_array(name: str, value: ArrayLike, length: int) -> Array:
    """Return one positive number, or `length` of them, as a new float array (length,).

    Raises:
        InvalidValueError: a wrong shape, or an entry that is not finite and positive.
    """
    array = np.array(value, dtype=np.float64)
    for entry in array.flat:
        positive(name, entry)
    if array.shape not in [(), (length,)]:
        raise InvalidValueError(name, value, f"a number or of shape ({length},)")
    return np.broadcast_to(array, (length,)).copy()


def finite_tuple(name: str, value: ArrayLike, length: int) -> tuple[float, ...]:
    """Return `value` as a tuple of `length` finite floats; errors as `finite_vector`."""
    return tuple(finite_vector(name, value, length).tolist())


def unit_quaternion(name: str, value: ArrayLike) -> tuple[float, ...]:
    """Return the quaternion x y z w, of a length within 1 % of one, scaled to one.

    Raises:
        InvalidValueError: a wrong shape, an entry that is not finite, or another length.
    """
    quaternion = finite_vector(name, value, 4)
    norm = math.hypot(*quaternion)
    if abs(norm - 1.0) > 0.01:
        raise InvalidValueError(name, value, "a unit quaternion x y z w")
    # Scaling once more would change the last digit of what is already of unit length.
    return tuple((quaternion / norm if abs(norm - 1.0) > 1e-12 else quaternion).tolist())


def finite_number(name: str, value: float) -> float:
    """Return `value` if it is a finite number, else raise InvalidValueError."""
    if not _is_finite_number(value):
        raise InvalidValueError(name, value, "a finite number")
    return float(value)


def positive(name: str, value: float) -> float:
    """Return `value` if it is a finite number above zero, else raise InvalidValueError."""
    if not _is_finite_number(value) or not value > 0.0:
        raise InvalidValueError(name, value, "a finite number > 0")
    return float(value)


def non_negative(name: str, value: float) -> float:
    """Return `value` if it is a finite number, zero or above, else raise InvalidValueError."""
    if not _is_finite_number(value) or not value >= 0.0:
        raise InvalidValueError(name, value, "a finite number >= 0")
    return float(value)


def positive_integer(name: str, value: int) -> int:
    """Return `value` if it is an integer above zero, else raise InvalidValueError."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise InvalidValueError(name, value, "an integer >= 1")
    return int(value)


def non_negative_integer(name: str, value: int) -> int:
    """Return `value` if it is an integer, zero or above, else raise InvalidValueError."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise InvalidValueError(name, value, "an integer >= 0")
    return int(value)


def one_of(name: str, value: str, allowed: Collection[str]) -> str:
    """Return `value` if it is among `allowed`, else raise InvalidValueError."""
    if value not in allowed:
        raise InvalidValueError(name, value, "one of " + ", ".join(sorted(allowed)))
    return value


def _is_finite_number(value: object) -> bool:
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the range of floats
        return False


def _array_of_numbers(value: ArrayLike) -> Array | None:
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):  # rows of different lengths
        return None
    return array.astype(np.float64) if array.dtype.kind in "iuf" else None
