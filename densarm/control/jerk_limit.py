"""JerkLimit: lets the acceleration change at a bounded rate."""

import math

import numpy as np

from densarm.arrays import Array


class JerkLimit:
    r"""Follows a wanted acceleration, no joint's changing by more than its limit within a time T.

    .. math::

        a_k = a_{k-1} + s\,(a^* - a_{k-1}), \qquad
        s = \min\Big\{1, \min_i \frac{a_i^{max} \Delta t / T}{|a^*_i - a_{k-1,i}|}\Big\}

    a_k is between a_{k-1} and a*: within any convex limits that both keep. The feedback a* =
    K_v (k - q̇) settles from its largest acceleration by K_v a^max per second: T = 1 / K_v lets that
    pass, and spreads the jumps of k.

    After a pause of more than a period and a half the arm counts as unaccelerated.

    Args:
        limit: a^max (nv,) [rad/s² or m/s²]; infinity limits nothing.
        time: T [s].
        period: Δt, the time between two calls [s].
    """

    def __init__(self, limit: Array, time: float, period: float) -> None:
        self._step = limit * (period / time)
        self._longest_gap = 1.5 * period
        self._time = math.nan
        self.last: Array = np.zeros_like(limit)
        """a_{k-1} (nv,) [rad/s² or m/s²], to be set after each step; zero at first."""

    def limited(self, t: float, wanted: Array) -> Array:
        """Return a_k (nv,) at a time t [s], for a wanted a* (nv,): a* itself where s is one."""
        if not abs(t - self._time) <= self._longest_gap:
            self.last = np.zeros_like(wanted)
        self._time = t
        change = wanted - self.last
        excess = float((np.abs(change) / self._step).max())
        return wanted if excess <= 1.0 else self.last + change / excess
