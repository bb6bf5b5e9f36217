"""SmallestDistance: the smallest distance at each sample of a motion, without asking for all."""

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.kernels import compiled
from densarm.world.active_pairs import go, joint_numbers, pair_motion
from densarm.world.world import DISTANCE_TOLERANCE, World

_SLACK = 0.02  # [m] beyond the smallest distance, up to which pairs are asked that may soon have it


class SmallestDistance:
    r"""The smallest of all distances, exactly, at one configuration after the other.

    A pair whose distance was d_k is at least :math:`d_k - \sum_j r_{kj} s_j` apart after joints
    have gone ways of s_j, r_kj the Lipschitz constants of the world. So only pairs are asked that
    may be nearer than the nearest of those asked.

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

    def at(self, q: Array) -> tuple[float, int]:
        """Return the smallest distance [m] at q (nq,) and the index of the first pair that has it.

        Without pairs that is infinity and -1.
        """
        world, (level, gone) = self._world, self._numbers
        if self._version != world.version:
            self._version, level[:] = world.version, -np.inf
        _let_go(q, *self._arrays)
        bound = level - gone - 2.0 * DISTANCE_TOLERANCE
        limit, nearest = self._smallest + _SLACK, (np.inf, -1)
        while True:
            asked = np.flatnonzero(bound < limit)
            if asked.size:
                distance = world.distances(q, asked)
                level[asked], bound[asked] = distance + gone[asked], np.inf
                k = int(distance.argmin())
                nearest = min(nearest, (float(distance[k]), int(asked[k])))
            if nearest[0] <= limit:
                self._smallest = nearest[0]
                return nearest
            limit = nearest[0]


def smallest_distances(world: World, q: Array) -> Array:
    """Return the smallest distance of all pairs at configurations (N, nq), (N,) [m]."""
    smallest = SmallestDistance(world)
    return np.array([smallest.at(row)[0] for row in q])


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
