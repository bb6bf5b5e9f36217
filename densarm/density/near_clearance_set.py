"""NearClearanceSet: the unsafe sets of geometry pairs, of which only near ones are queried."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.near_pairs import NearPairs
from densarm.pair_gradients import add_pair_gradient
from densarm.validation import non_negative, positive_array


class NearClearanceSet:
    r"""As `ClearanceSet`, at a cost that grows with the pairs near their sensing regions.

    .. math:: \ln\Psi_k = \ln(1 + \theta), \quad \nabla\ln\Psi_k = 0 \qquad (d_k \ge m + \sigma_k)

    so that a pair known to be that far needs no query. The sums are the same, to the last bit.

    Args:
        pairs: which pairs are near; for this set alone.
        margin: m ≥ 0 [m].
        sensing_distance: σ > 0 [m], one for all pairs or shape (K,).

    Attributes:
        pairs: as given.
        sensing_distance: σ_k [m], shape (K,), which may be changed in place.

    Raises:
        InvalidValueError: a negative margin, or a sensing distance that is not positive.
    """

    def __init__(self, pairs: NearPairs, margin: float, sensing_distance: ArrayLike) -> None:
        self.pairs = pairs
        self.margin = non_negative("margin", margin)
        self.sensing_distance = pairs.sensing_distance
        self.sensing_distance[:] = positive_array(
            "sensing_distance", sensing_distance, pairs.clearance.n_pairs
        )

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Act as `UnsafeSet.add_log_bump`."""
        pairs = self.pairs
        pairs.update(q, self.margin)
        return _accumulate_near_log_bumps(
            pairs.state,
            pairs.rows,
            pairs.jacobian,
            pairs.sign,
            self.margin,
            self.sensing_distance,
            theta,
            out_gradient,
        )


@compiled
def _accumulate_near_log_bumps(
    state: NDArray[np.int64],
    rows: Array,
    jacobian: Array,
    sign: Array,
    margin: float,
    width: Array,
    theta: float,
    out_gradient: Array,
) -> float:
    total, far = 0.0, math.log1p(theta)
    for k in range(state.shape[0]):
        if state[k] == 0:
            total += far
            continue
        value, slope = log_inverse_bump(rows[k, 0] - margin, width[k], theta)
        total += value
        if slope != 0.0:
            add_pair_gradient(rows[k], jacobian, sign[k], slope, out_gradient)
    return total
