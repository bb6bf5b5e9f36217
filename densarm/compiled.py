"""The one way in which numerical kernels are compiled."""

from collections.abc import Callable
from typing import Any

import numba

compiled = numba.njit(cache=True, error_model="numpy")
"""Decorator of functions of floats and arrays: compile at the first call, keep the code on disk.

Division follows IEEE 754 instead of raising. The Python function stays reachable as `py_func`.
"""


def compiled_for(signature: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that compiles at once, as `compiled` does, for one signature.

    Args:
        signature: types of the result and the arguments, as Numba writes them. The function
            raises a TypeError for arguments of other types.
    """
    decorator: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(
        signature, cache=True, error_model="numpy"
    )
    return decorator
