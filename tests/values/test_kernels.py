"""Whoever asks is told when a kernel is compiled, and how long that took."""

import numba
import pytest

from densarm.values.kernels import on_compiling


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
