"""DistanceBounds: distances of geometry pairs, queried no more than what is asked of them needs."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from densarm.arrays import Array
from densarm.compiled import compiled


class DistanceBounds(Protocol):
    """Lower bounds of the distances of all pairs at one configuration, any to be made exact."""

    @property
    def distance(self) -> Array:
        """Distances or lower bounds of them (K,) [m]; `query` overwrites it."""
        ...

    def query(self, pair: int) -> bool:
        """Put the distance of a pair in the place of its bound.

        Args:
            pair: its index.

        Returns:
            False if it was the distance already.
        """
        ...


@dataclass(frozen=True, eq=False)
class ExactDistances:
    """`DistanceBounds` of distances that are all known."""

    distance: Array
    """As `DistanceBounds.distance`."""

    def query(self, pair: int) -> bool:  # noqa: ARG002
        """Act as `DistanceBounds.query`."""
        return False


def least_room(
    bounds: DistanceBounds, need: float | Array, rate: Array, enough: float = np.inf
) -> float:
    r"""Return how far along a motion the first pair runs out of room.

    .. math:: \min_{k:\, r_k > 0} (d_k - n_k) / r_k

    A pair is queried where its bound alone makes it the first, so that the result is that of the
    distances, to the last bit.

    Args:
        bounds: d_k.
        need: n_k [m], one for all pairs or shape (K,).
        rate: r_k ≥ 0 (K,), the motion of a pair per length of the way.
        enough: length that needs no exact result: what exceeds it may be too short.

    Returns:
        A length, infinite where no pair moves.
    """
    while True:
        room, pair = _first(bounds.distance - need, rate)
        if room > enough or pair < 0 or not bounds.query(pair):
            return room


def all_exceed(bounds: DistanceBounds, need: Array) -> bool:
    """Return whether d_k > n_k for every pair.

    Args:
        bounds: d_k.
        need: n_k (K,) [m].
    """
    return least_room(bounds, need, np.ones_like(need), enough=0.0) > 0.0


@compiled
def _first(room: Array, rate: Array) -> tuple[float, int]:
    least, pair = np.inf, -1
    for k in range(room.shape[0]):
        if rate[k] > 0.0 and room[k] / rate[k] < least:
            least, pair = room[k] / rate[k], k
    return least, pair
