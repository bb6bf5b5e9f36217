"""Checks of values at construction, each raising one `InvalidValueError`."""

import math
from collections.abc import Collection
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError
from densarm.values.arrays import Array


def finite_vector(name: str, value: ArrayLike, length: int, hint: str = "") -> Array:
    """Return `value` as a new float array (length,); `hint` follows the error of another shape."""
    try:
        vector = np.asarray(value)
    except (TypeError, ValueError):  # rows of different lengths
        vector = np.array(None)
    if vector.dtype.kind not in "iuf":
        raise InvalidValueError(name, value, f"{length} numbers")
    if vector.shape != (length,):
        raise InvalidValueError(name, value, f"of shape ({length},), got {vector.shape}{hint}")
    if not np.isfinite(vector).all():
        raise InvalidValueError(name, value, "finite numbers")
    return vector.astype(np.float64)


def positive_array(name: str, value: ArrayLike, length: int) -> Array:
    """Return one positive number, or `length` of them, as a new float array (length,)."""
    array = np.array(value, dtype=np.float64)
    for entry in array[~(np.isfinite(array) & (array > 0.0))].flat:
        positive(name, entry)  # refuses the first
    if array.shape not in [(), (length,)]:
        raise InvalidValueError(name, value, f"a number or of shape ({length},)")
    return np.broadcast_to(array, (length,)).copy()


def finite_tuple(name: str, value: ArrayLike, length: int) -> tuple[float, ...]:
    """Return `value` as a tuple of `length` finite floats; errors as `finite_vector`."""
    return tuple(finite_vector(name, value, length).tolist())


def positive_tuple(name: str, value: ArrayLike, length: int) -> tuple[float, ...]:
    """Return `value` as a tuple of `length` positive floats; errors as `finite_vector`."""
    return tuple(positive(name, entry) for entry in finite_tuple(name, value, length))


def unit_quaternion(name: str, value: ArrayLike) -> tuple[float, ...]:
    """Return the quaternion x y z w, of a length within 1 % of one, scaled to one."""
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


def positive_integer(name: str, value: int | np.integer) -> int:
    """Return `value` if it is an integer above zero, else raise InvalidValueError."""
    return _integer(name, value, 1)


def non_negative_integer(name: str, value: int | np.integer) -> int:
    """Return `value` if it is an integer, zero or above, else raise InvalidValueError."""
    return _integer(name, value, 0)


def one_of(name: str, value: str, allowed: Collection[str]) -> str:
    """Return `value` if it is among `allowed`, else raise InvalidValueError."""
    if value not in allowed:
        raise InvalidValueError(name, value, "one of " + ", ".join(sorted(allowed)))
    return value


def _integer(name: str, value: object, lowest: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < lowest:
        raise InvalidValueError(name, value, f"an integer >= {lowest}")
    return int(value)


def _is_finite_number(value: object) -> bool:
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer beyond the range of floats
        return False
