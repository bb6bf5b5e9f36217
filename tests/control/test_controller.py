"""What a controller takes for a state, and its gains."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.control.controller import Gains, checked_state
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array

ARM = load_arm("two_link")
Q, V = ARM.configuration([0.3, -2.0]), np.array([0.5, -0.25])


def read_only(vector: Array) -> Array:
    vector = vector.copy()
    vector.flags.writeable = False
    return vector


def strided(vector: Array) -> Array:
    return np.stack([vector, vector], axis=-1)[:, 0]


def reversed_view(vector: Array) -> Array:
    return vector[::-1].copy()[::-1]


def test_arrays_that_kernels_are_compiled_for_are_taken_as_they_are() -> None:
    q, v = checked_state(ARM, Q, V)
    assert q is Q
    assert v is V


@pytest.mark.parametrize("form", [list, tuple, read_only, strided, reversed_view, np.longdouble])
@pytest.mark.parametrize("both", [True, False])
def test_others_become_such_arrays(form: Callable[[Array], Any], both: bool) -> None:
    """Kernels would be compiled for them in the middle of a control loop, which takes seconds."""
    q, v = checked_state(ARM, form(Q), form(V) if both else V)
    for vector, expected in ((q, Q), (v, V)):
        np.testing.assert_array_equal(vector, expected)
        assert vector.dtype == np.float64
        assert vector.flags.carray


@pytest.mark.parametrize("key", ["position", "velocity"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "high"])
def test_gains_are_checked(key: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        Gains(**{key: value})


def test_the_rate_is_that_of_the_gains() -> None:
    assert Gains(position=100.0, velocity=20.0).rate == 5.0
