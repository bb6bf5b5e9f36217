"""The one way in which numerical kernels are compiled, and how a caller hears of it."""

import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

import numba
from numba.core import event

compiled = numba.njit(cache=True, error_model="numpy")
"""Decorator of kernels: compile at the first call, and keep the code on disk.

Division follows IEEE 754 instead of raising. The Python function stays reachable as `py_func`.
"""

if TYPE_CHECKING:  # numba's stubs do not know the options
    compiled_part = compiled
else:
    compiled_part = numba.njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Decorator of functions that kernels alone call: they are compiled into them.

Without an entry from Python, and without a file of its own, a part takes less time to compile.
"""


class CompileTime(event.Listener):
    """How long compiling has taken so far, as numba tells of it."""

    def __init__(self, tell: Callable[[bool], object]) -> None:
        self.seconds = 0.0
        """Wall-clock time [s]."""
        self._tell = tell
        self._depth = 0  # of kernels that are compiled for others
        self._began = 0.0

    def on_start(self, event: event.Event) -> None:  # noqa: ARG002
        """Tell that a compilation begins, unless it is for another."""
        self._depth += 1
        if self._depth == 1:
            self._began = time.perf_counter()
            self._tell(True)

    def on_end(self, event: event.Event) -> None:  # noqa: ARG002
        """Tell that it has ended."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._began
            self._tell(False)


def on_compiling(tell: Callable[[bool], object]) -> AbstractContextManager[CompileTime]:
    """Call `tell` with True before each compilation, not mere loading, and with False after it."""
    return event.install_listener("numba:compile", CompileTime(tell))
