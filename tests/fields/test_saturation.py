import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.fields.saturation import saturate

controls = arrays(np.float64, (5, 3), elements=st.floats(-1e6, 1e6, allow_subnormal=False))


@given(controls, st.floats(1e-3, 1e3))
def test_keeps_the_direction_and_the_bound(u, u_max):
    bounded = saturate(u, u_max)
    assert np.abs(bounded).max() <= u_max * (1.0 + 1e-12)
    largest = np.abs(u).max(axis=1, keepdims=True)
    scaled = bounded * np.maximum(largest, u_max)
    # Below the normal doubles there is no relative accuracy.
    np.testing.assert_allclose(scaled, u * u_max, rtol=1e-12, atol=1e-300)
    inside = largest[:, 0] <= u_max
    np.testing.assert_array_equal(bounded[inside], u[inside])


def test_infinity_bounds_nothing():
    u = np.array([1e300, -1.0])
    np.testing.assert_array_equal(saturate(u, np.inf), u)
