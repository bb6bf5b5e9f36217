"""What a controller takes for a state."""

import numpy as np
import pytest

from densarm.arm import load_arm
from densarm.control.controller import checked_state

ARM = load_arm("two_link")
Q, V = ARM.configuration([0.3, -2.0]), np.array([0.5, -0.25])


def read_only(vector):
    vector = vector.copy()
    vector.flags.writeable = False
    return vector


def strided(vector):
    return np.stack([vector, vector], axis=-1)[:, 0]


def reversed_view(vector):
    return vector[::-1].copy()[::-1]


def test_arrays_that_kernels_are_compiled_for_are_taken_as_they_are():
    q, v = checked_state(ARM, Q, V)
    assert q is Q
    assert v is V


@pytest.mark.parametrize("form", [list, tuple, read_only, strided, reversed_view, np.longdouble])
@pytest.mark.parametrize("both", [True, False])
def test_others_become_such_arrays(form, both):
    """Kernels would be compiled for them in the middle of a control loop, which takes seconds."""
    q, v = checked_state(ARM, form(Q), form(V) if both else V)
    for vector, expected in ((q, Q), (v, V)):
        np.testing.assert_array_equal(vector, expected)
        assert vector.dtype == np.float64
        assert vector.flags.carray
