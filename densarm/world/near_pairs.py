"""NearPairs: the distances of the pairs that may be near, at one configuration after another."""

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.kernels import compiled
from densarm.world.active_pairs import go, joint_numbers, pair_motion
from densarm.world.world import DISTANCE_TOLERANCE, Pairs, World

_SLACK = 0.02  # [m] beyond the smallest distance, up to which pairs are asked that may soon have it


class NearPairs:
    r"""Asks the pairs alone that may be nearer than a limit, along a motion.

    A pair whose distance was d_k is at least :math:`d_k - \sum_j r_{kj} s_j` apart after the joints
    have gone ways of s_j, r_kj the Lipschitz constants of the world.

    Unlike `ActivePairs` it returns the very numbers of `World.distances`.

    Args:
        world: the pairs; its obstacles may change.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._version = 0
        self._smallest = np.inf
        # Rows: after ways of s the distance is at least level - lipschitz @ s; the latter alone.
        self._numbers = np.zeros((2, world.n_pairs))
        rest = world.arm.configurations(np.zeros(world.arm.nv))
        index, joints = world.arm.joint_index, joint_numbers(world.arm)
        self._arrays = rest, index, world.lipschitz, joints, self._numbers

    def below(self, q: Array, limit: float) -> tuple[Pairs, Array]:
        """Return pairs (P,) and their distances (P,) [m] at q (nq,).

        All that are nearer than the limit [m] are among them.
        """
        return self._ask(q, self._bounds(q) < limit)

    def smallest(self, q: Array) -> tuple[float, int]:
        """Return the smallest distance [m] at q (nq,) and the index of the first pair that has it.

        Without pairs that is infinity and -1.
        """
        bound = self._bounds(q)
        limit, nearest = self._smallest + _SLACK, (np.inf, -1)
        while True:
            asked, distance = self._ask(q, bound < limit)
            bound[asked] = np.inf
            if asked.size:
                k = int(distance.argmin())
                nearest = min(nearest, (float(distance[k]), int(asked[k])))
            if nearest[0] <= limit:
                self._smallest = nearest[0]
                return nearest
            limit = nearest[0]

    def _bounds(self, q: Array) -> Array:
        """Go on to q (nq,), and return what distances are there at least (K,) [m]."""
        level, gone = self._numbers
        if self._version != self._world.version:
            self._version, level[:] = self._world.version, -np.inf
        _let_go(q, *self._arrays)
        return np.asarray(level - gone - 2.0 * DISTANCE_TOLERANCE)

    def _ask(self, q: Array, which: NDArray[np.bool_]) -> tuple[Pairs, Array]:
        asked, (level, gone) = np.flatnonzero(which), self._numbers
        distance = self._world.distances(q, asked)
        level[asked] = distance + gone[asked]
        return asked, distance


def least_distances(world: World, q: Array, limit: float) -> Array:
    """Return the least distance of each pair at configurations (N, nq), (K,) [m].

    Of pairs that stay beyond a limit [m] it is the least that was met, or infinity.
    """
    near, least = NearPairs(world), np.full(world.n_pairs, np.inf)
    for row in q:
        pairs, distance = near.below(row, limit)
        least[pairs] = np.minimum(least[pairs], distance)
    return least


def smallest_distances(world: World, q: Array) -> Array:
    """Return the smallest distance of all pairs at configurations (N, nq), (N,) [m]."""
    pairs = NearPairs(world)
    return np.array([pairs.smallest(row)[0] for row in q])


@compiled
def _let_go(
    q: Array,
    q_last: Array,
    joint_index: NDArray[np.int64],
    lipschitz: Array,
    joints: Array,
    numbers: Array,
) -> None:
    """Go on to q; write by how much bodies have moved, and forget bounds that no longer hold."""
    if not go(q, q_last, joint_index, joints):
        for k in range(numbers.shape[1]):
            numbers[0, k] = -np.inf
    for k in range(numbers.shape[1]):
        numbers[1, k] = pair_motion(lipschitz, k, joints[0])
