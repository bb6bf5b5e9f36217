import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.visualization.palette import ClearanceScale


@given(st.lists(st.floats(-0.5, 5.0), max_size=5))
def test_scale_ends_at_a_round_number_that_fits(clearance: list[float]) -> None:
    top = ClearanceScale.fitting(np.array(clearance)).top
    assert float(f"{top:.0e}") == top
    assert str(top).strip("0.e-")[0] in "125"
    largest = max(clearance, default=0.0)
    assert min(largest, 0.1) <= top * (1.0 + 1e-6)
    assert top <= max(0.1, 1e-3)


def test_close_is_red_and_far_is_blue() -> None:
    scale = ClearanceScale(0.1)
    contact, far, farther = scale.colors(np.array([-0.1, 0.1, np.inf]))
    assert contact.argmax() == 0
    assert far.argmax() == 2
    assert farther == pytest.approx(far)
