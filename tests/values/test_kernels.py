"""Whoever asks is told when a kernel is compiled, and how long that took."""

import numba
import numpy as np
import pytest

from densarm.values.arrays import Array
from densarm.values.kernels import any_vector, compiled, entry_point, on_compiling


@pytest.mark.slow
def test_compiling_is_told_of_and_timed() -> None:
    inner = numba.njit(lambda x: x + 1)
    outer = numba.njit(lambda x: 2 * inner(x))
    told: list[bool] = []
    with on_compiling(told.append) as taken:
        assert taken.seconds == 0.0
        assert outer(1) == 4
        assert told == [True, False]
        first = taken.seconds
        assert first > 0.0
        assert outer(2) == 6
        assert taken.seconds == first
        assert outer(1.5) == 5.0
        assert told == [True, False, True, False]
        assert taken.seconds > first
    outer(True)
    assert told == [True, False, True, False]


def test_a_kernel_that_cannot_be_compiled_ends_the_telling() -> None:
    told: list[bool] = []
    kernel = numba.njit(lambda x: x.nothing)
    with on_compiling(told.append), pytest.raises(numba.TypingError):
        kernel(1)
    assert told == [True, False]


@compiled
def _weighted_sum(x: Array, weight: float) -> float:
    total = 0.0
    for i in range(x.shape[0]):
        total += weight * x[i]
    return total


def test_an_entry_point_is_the_kernel_wherever_a_vector_lies() -> None:
    entry, numbers = entry_point(_weighted_sum, any_vector, 1.0), np.arange(12.0).reshape(3, 4)
    for x in (numbers[1], numbers[:, 1], numbers[::-1, 2]):
        assert entry(x, 2) == _weighted_sum(x, 2.0) == pytest.approx(2.0 * x.sum())


@pytest.mark.parametrize("wrong", [[1.0, 2.0], np.zeros(2, np.float32)])
def test_an_entry_point_refuses_what_is_no_such_array(wrong: object) -> None:
    with pytest.raises(TypeError):
        entry_point(_weighted_sum, any_vector, 1.0)(wrong, 1.0)
