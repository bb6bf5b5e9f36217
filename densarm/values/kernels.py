"""The one way in which numerical kernels are compiled, and how a caller hears of it."""

import hashlib
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
from numba.core import event
from numba.core.registry import CPUDispatcher as Dispatcher


def _kernels_text() -> str:
    """Return a digest of all files with kernels or parts of them."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        if b"kernels import" in (text := path.read_bytes()):
            digest.update(text)
    return digest.hexdigest()


_KERNELS_TEXT = _kernels_text()


if TYPE_CHECKING:  # numba's stubs do not know the options
    compiled = compiled_beside = numba.njit(cache=True, error_model="numpy")
    compiled_part = compiled_lean_part = compiled
else:

    def compiled(function, **options):
        """Compile a kernel at its first call, and keep the code on disk.

        Division follows IEEE 754 instead of raising. The Python function stays reachable as
        `py_func`. Numba keeps code until the kernel's own file changes; here until any does that it
        may be made of, since a kernel with constants or parts of another version would compute
        something else.
        """
        kernel = numba.njit(cache=True, error_model="numpy", **options)(function)
        if cache := getattr(kernel, "_cache", None):  # none where compiling is switched off
            file = cache._cache_file
            file._source_stamp = (file._source_stamp, _KERNELS_TEXT)
        return kernel

    def compiled_beside(function):
        """Compile a long kernel as `compiled` does, which lets other threads go on meanwhile."""
        return compiled(function, nogil=True)

    _PART = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    compiled_part = numba.njit(**_PART)
    compiled_lean_part = numba.njit(**_PART, _nrt=False)
"""`compiled_part` is the decorator of functions that kernels alone call, and are compiled into.

Without an entry from Python, and without a file of its own, a part takes less time to compile.
`compiled_lean_part` is for those that make no arrays, nor call what does: without counting of
references, an atomic operation each time that a row of an array is looked at, they take less time.
"""


def entry_point(kernel: Callable[..., Any], *arguments: object) -> Callable[..., Any]:
    """Return a kernel as it is for arguments of the types that these have, loaded or compiled.

    Half the time of a short call goes into finding out the types of its arguments. This one does
    not look: an array of another type of numbers, or of rows elsewhere than told, would be taken
    for what it is not. `any_vector` stands for a vector that may lie in memory as it likes.
    """
    if not isinstance(kernel, Dispatcher):  # compiling is switched off
        return kernel
    return _entry_point(kernel, tuple(map(_kind_of, arguments)))


_Kind = tuple[Any, ...]  # what determines the type of an argument, found and compared in no time


def _kind_of(argument: object) -> _Kind:
    """Return what determines numba's type of an argument, of matrices by their strides.

    A view of but one row or column lies in memory as a C array does. Numba would take it for one,
    and compile a kernel anew for an arm of one joint, or a world of one pair.
    """
    if isinstance(argument, tuple):
        return type(argument), *map(_kind_of, argument)
    if not isinstance(argument, np.ndarray):
        return (type(argument),)
    flags, size = argument.flags, argument.itemsize
    is_c, is_f = flags.c_contiguous, flags.f_contiguous
    if argument.ndim == 2:
        is_c = argument.strides in ((size * argument.shape[1], size), (0, 0))  # or new, and empty
        is_f = is_f and argument.strides[0] == size
    layout = "C" if is_c else "F" if is_f else "A"
    return np.ndarray, argument.dtype, argument.ndim, layout, flags.writeable


@cache
def _entry_point(kernel: Any, kinds: tuple[_Kind, ...]) -> Callable[..., Any]:
    signature = tuple(map(_type_of, kinds))
    kernel.compile(signature)
    entry: Callable[..., Any] = kernel.overloads[signature].entry_point
    return entry


def _type_of(kind: _Kind) -> Any:
    known: Any = numba
    of, *parts = kind
    if issubclass(of, tuple):
        return known.types.BaseTuple.from_types(list(map(_type_of, parts)), of)
    if of is not np.ndarray:
        return known.typeof(of())
    dtype, ndim, layout, is_writeable = parts
    found = known.typeof(np.empty((0,) * ndim, dtype))
    return found.copy(layout=layout, readonly=not is_writeable)


any_vector = np.zeros(4)[::2]
"""A vector whose numbers do not follow each other."""


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
