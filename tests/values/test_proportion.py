"""Proportions: the interval is Wilson's."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from densarm.errors import InvalidValueError
from densarm.values.proportion import Proportion


@given(st.integers(1, 5000), st.floats(0.0, 1.0))
def test_agrees_with_scipy(total: int, share: float) -> None:
    count = round(share * total)
    expected = binomtest(count, total).proportion_ci(0.95, method="wilson")
    assert Proportion(count, total).interval == pytest.approx((expected.low, expected.high))


def test_reads_as_a_percentage() -> None:
    assert str(Proportion(1000, 1000)) == "100.0 % [99.6, 100.0]"


@pytest.mark.parametrize(("count", "total"), [(-1, 5), (6, 5), (0, 0)])
def test_impossible_counts_are_refused(count: int, total: int) -> None:
    with pytest.raises(InvalidValueError):
        Proportion(count, total)
