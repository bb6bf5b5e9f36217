"""Saturation: the bound on control of the paper, in the maximum norm."""

import numpy as np

from densarm.arrays import Array


def saturate(u: Array, u_max: float) -> Array:
    r"""Shorten controls that exceed a bound, keeping their direction.

    .. math:: \bar u = \frac{u}{\|u\|_\infty} u_{max} \quad \text{where}
        \quad \|u\|_\infty > u_{max}

    Args:
        u: controls (..., n).
        u_max: bound > 0 on every component, in the unit of `u`; infinity bounds nothing.

    Returns:
        Shape (..., n).

    Source: [ZNV] eq. 13-14.
    """
    largest = np.abs(u).max(axis=-1, keepdims=True)
    return u * (u_max / np.maximum(largest, u_max)) if np.isfinite(u_max) else u
