"""Whoever asks is told when a kernel is compiled, and how long that took."""

import numba
import numpy as np
import pytest

from densarm.arms.dynamics import by_columns
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


@compiled
def _sum_of_all(matrices: tuple[Array, Array, Array]) -> float:
    first, second, third = matrices
    return first.sum() + second.sum() + third.sum()  # type: ignore[no-any-return]


@pytest.mark.slow
def test_a_kernel_is_compiled_once_however_few_rows_and_columns_there_are() -> None:
    for rows, columns in ((3, 4), (1, 1), (0, 1), (1, 3), (2, 1)):
        memory = np.arange(8.0 * (rows + 2) * (columns + 2))
        strided = np.lib.stride_tricks.as_strided(memory, (rows, 10), (160, 8), writeable=False)
        square = by_columns(memory[: columns**2].reshape(columns, columns).T, (columns, columns))
        matrices = strided, square, np.ones((rows, columns))
        entry = entry_point(_sum_of_all, matrices)
        assert entry(matrices) == sum(matrix.sum() for matrix in matrices)
    assert len(_sum_of_all.signatures) == 1


@pytest.mark.parametrize("wrong", [[1.0, 2.0], np.zeros(2, np.float32)])
def test_an_entry_point_refuses_what_is_no_such_array(wrong: object) -> None:
    with pytest.raises(TypeError):
        entry_point(_weighted_sum, any_vector, 1.0)(wrong, 1.0)
