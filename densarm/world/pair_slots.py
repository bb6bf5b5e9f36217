"""PairSlots: room in Pinocchio's data for few of very many pairs, which take turns in it."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

N_SLOTS = 2048
"""Pairs that have room at a time; each takes 11 kB and 8 µs to make."""


class PairSlots:
    """Gives pairs of a geometry model slots, from those that have not been asked for longest.

    Args:
        geometry: all shapes and pairs.
        pair_shapes: indices of the two shapes of each pair (K, 2), K > `N_SLOTS`.
    """

    def __init__(self, geometry: pin.GeometryModel, pair_shapes: NDArray[np.int64]) -> None:
        self._shapes, self._pair_shapes = list(geometry.geometryObjects), pair_shapes
        self.geometry: pin.GeometryModel = geometry.copy()
        """All shapes, and the pairs that have slots."""
        del self.geometry.collisionPairs[N_SLOTS:]
        self.data: pin.GeometryData = self.geometry.createData()
        """Pinocchio's data of these pairs, and of all shapes."""
        self.slot: NDArray[np.int64] = np.full(len(pair_shapes), -1)
        """Slot of each pair, or -1 (K,)."""
        self.slot[:N_SLOTS] = np.arange(N_SLOTS)
        self._pair, self._used = np.arange(N_SLOTS), np.zeros(N_SLOTS, np.int64)
        self._pairs, self._functors = self.geometry.collisionPairs, self.data.distance_functors
        self._turn, self._question = 0, 0

    def take(self, pairs: NDArray[np.int64]) -> list[int]:
        """Return the slots of at most `N_SLOTS` pairs (P,), given to those that have none."""
        self._question += 1
        slots = self.slot[pairs]
        self._used[slots[slots >= 0]] = self._question
        if (slots < 0).any():
            for k in pairs[slots < 0].tolist():
                while self._used[self._turn] == self._question:
                    self._turn = (self._turn + 1) % N_SLOTS
                self._give(self._turn, k)
            slots = self.slot[pairs]
        found: list[int] = slots.tolist()
        return found

    def _give(self, slot: int, pair: int) -> None:
        first, second = self._pair_shapes[pair].tolist()
        self.slot[self._pair[slot]] = -1
        self.slot[pair], self._pair[slot], self._used[slot] = slot, pair, self._question
        self._pairs[slot] = pin.CollisionPair(first, second)
        self._functors[slot] = pin.ComputeDistance(self._shapes[first], self._shapes[second])
