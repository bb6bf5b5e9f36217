"""Barriers: every unsafe set of an arm as one vector of functions h_k."""

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.validation import non_negative


class Barriers:
    r"""Functions that are positive where an arm is safe: geometry pairs, then joint limits.

    .. math::

        h_k = d_k(q) - m, \qquad h = q_i - q_i^{\min}, \quad h = q_i^{\max} - q_i

    Args:
        clearance: signed distances of K pairs; `update` leaves it at its configuration.
        margin: safety margin m ≥ 0 of the pairs [m].

    Attributes:
        value: h (K + L,) [m, or rad at a revolute joint's limit], overwritten by `update`.
        gradient: its gradients (K + L, nv), overwritten by `update`.

    Raises:
        InvalidValueError: a negative margin.
    """

    def __init__(self, clearance: Clearance, margin: float) -> None:
        arm = clearance.arm
        self.clearance = clearance
        self.margin = non_negative("margin", margin)
        bounds = np.concatenate([arm.limits.lower, -arm.limits.upper])
        members = np.flatnonzero(np.isfinite(bounds))
        joint = members % arm.nv
        self._index_q = arm.idx_q[joint]
        self._side = np.where(members < arm.nv, 1.0, -1.0)
        self._bound = bounds[members]
        self.value: Array = np.zeros(clearance.n_pairs + len(members))
        self.gradient: Array = np.zeros((len(self.value), arm.nv))
        self.gradient[clearance.n_pairs + np.arange(len(members)), joint] = self._side

    def spread(self, pair: float, limit: float) -> Array:
        """Return a vector (K + L,) with one number for every pair and one for every limit."""
        n_pairs = self.clearance.n_pairs
        return np.repeat([pair, limit], [n_pairs, len(self.value) - n_pairs])

    def update(self, q: Array) -> None:
        """Compute `value` and `gradient` in place at q (nq,)."""
        clearance, n_pairs = self.clearance, self.clearance.n_pairs
        clearance.update(q)
        np.subtract(clearance.distance, self.margin, out=self.value[:n_pairs])
        self.gradient[:n_pairs] = clearance.gradient
        self.value[n_pairs:] = self._side * q[self._index_q] - self._bound
