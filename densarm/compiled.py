"""The one way in which numerical kernels are compiled."""

import numba

compiled = numba.njit(cache=True, error_model="numpy")
"""Decorator of functions of floats and arrays: compile at the first call, keep the code on disk.

Division follows IEEE 754 instead of raising. The Python function stays reachable as `py_func`.
"""
