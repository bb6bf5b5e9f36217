"""The nearest point of a box by soft rows: its conditions of optimality, and daqp's answer."""

import daqp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.control.soft_rows import nearest_in_box

WEIGHT = 1e4


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 10**6), rows=st.integers(0, 80), size=st.sampled_from([0.1, 1.0, 5.0]))
def test_no_other_point_of_the_box_is_better(seed: int, rows: int, size: float) -> None:
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 9))
    slopes = random.normal(size=(rows, n)) * np.where(random.random(n) < 0.4, 1e-3, 1.0)
    slopes /= np.linalg.norm(slopes, axis=1, keepdims=True)
    least, wanted = size * random.normal(size=rows), random.normal(size=n)
    low, high = -random.uniform(0.0, 0.6, n), random.uniform(0.0, 0.6, n)
    x = np.empty(n)
    assert nearest_in_box(wanted, slopes, least, low, high, WEIGHT, x)
    assert ((low <= x) & (x <= high)).all()
    lack = np.maximum(least - slopes @ x, 0.0)
    gradient = x - wanted - WEIGHT * lack @ slopes
    outward = np.where(gradient > 0.0, x > low, x < high)
    assert np.abs(gradient[outward]).max(initial=0.0) < 1e-5
    upper, lower = np.append(high, np.full(rows, 1e30)), np.append(low, least)
    sense = np.repeat([0, 8], [n, rows]).astype(np.int32)
    known, _, flag, _ = daqp.solve(
        np.eye(n), -wanted, slopes, upper, lower, sense, rho_soft=1.0 / WEIGHT
    )
    if flag > 0:
        np.testing.assert_allclose(x, known, atol=1e-6)
