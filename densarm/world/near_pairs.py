"""NearPairs: the distances of the pairs that may be near, at one configuration after another."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.kernels import any_vector, compiled, entry_point
from densarm.world.active_pairs import go, joint_numbers, pair_motion
from densarm.world.pair_blocks import (
    BLOCK,
    block_left,
    forget_pair,
    number_of_blocks,
    pair_blocks,
    write_block,
)
from densarm.world.pair_slots import N_SLOTS
from densarm.world.world import DISTANCE_TOLERANCE, Pairs, World

_SLACK = 0.02  # [m] beyond the smallest distance, up to which pairs are asked that may soon have it


class NearPairs:
    r"""Asks the pairs alone that may be nearer than a limit, along a motion.

    A pair whose distance was d_k is at least :math:`d_k - \sum_j r_{kj} s_j - w_k` apart after the
    joints have gone ways of s_j and its obstacle was moved by w_k, r_kj the Lipschitz constants of
    the world.

    Unlike `ActivePairs` it returns the very numbers of `World.distances`.

    Args:
        world: the pairs; its obstacles may change.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._smallest = np.inf
        self._limit = np.empty(world.n_pairs)
        # Rows: after ways of s and w the distance is at least level - (lipschitz @ s + w); the
        # latter alone.
        self._numbers = np.full((2, world.n_pairs), -np.inf)
        # Rows: which question each pair was asked for last; a workspace; `World.changes` then.
        self._asked = np.zeros((3, world.n_pairs), np.int64)
        rest = world.arm.configurations(np.zeros(world.arm.nv))
        index, joints = world.arm.joint_index, joint_numbers(world.arm)
        self._blocks, self._version = pair_blocks(world.lipschitz), 0
        self._arrays: tuple[Any, ...] = (
            *(self._blocks, rest, index, world.lipschitz, joints, self._numbers, self._asked),
            *(world.changes, world.obstacle_way),
        )
        self._question, some = 0, self._asked[1, :0]
        types = any_vector, self._limit, 0.0, 0, *self._arrays
        self._may_be_below = entry_point(_may_be_below, *types)
        known = world.query(rest, some), some, self._numbers, self._blocks
        self._learn = entry_point(_learn, *known)

    def below(self, q: Array, limit: float | Array) -> tuple[Pairs, Array]:
        """Return pairs (P,) and their distances (P,) [m] at q (nq,).

        All that are nearer than the limit, or their own of (K,) limits [m], are among them.
        """
        self._question += 1
        pairs, rows, _ = self._ask(q, limit)
        return pairs.copy(), rows[pairs, 0]

    def smallest(self, q: Array) -> tuple[float, int]:
        """Return the smallest distance [m] at q (nq,) and the index of the first pair that has it.

        Without pairs that is infinity and -1.
        """
        self._question += 1
        limit, nearest = self._smallest + _SLACK, (np.inf, -1)
        while True:
            nearest = min(nearest, self._ask(q, limit)[2])
            if nearest[0] <= limit:
                self._smallest = nearest[0]
                return nearest
            limit = nearest[0]

    def _ask(self, q: Array, limit: float | Array) -> tuple[Pairs, Array, tuple[float, int]]:
        """Ask pairs that may be below a limit [m]; return them, all rows, and the nearest."""
        world, numbers = self._world, self._numbers
        self._limit[:] = limit
        if self._version != world.version:
            self._version = world.version
            self._blocks[:, 0] = -np.inf
        most = limit if isinstance(limit, float) else float(np.max(limit, initial=-np.inf))
        count = self._may_be_below(q, self._limit, most, self._question, *self._arrays)
        pairs = self._asked[1, :count]
        if count > N_SLOTS:  # of which is found out first which are far
            bounds = world.bounds(q, pairs)
            n_near = _learn_far(bounds, self._asked, self._limit, numbers, self._blocks)
            pairs = pairs[:n_near]
        rows = world.query(q, pairs)
        return pairs, rows, self._learn(rows, pairs, numbers, self._blocks)


def least_distances(world: World, q: Array, limit: float) -> Array:
    """Return the least distance of each pair at configurations (N, nq), (K,) [m].

    Of pairs that stay beyond a limit [m] it is the least that was met, or infinity.
    """
    near, least = NearPairs(world), np.full(world.n_pairs, np.inf)
    for row in q:
        pairs, distance = near.below(row, np.minimum(least, limit))
        least[pairs] = np.minimum(least[pairs], distance)
    return least


def smallest_distances(world: World, q: Array, time: Array | None = None) -> Array:
    """Return the smallest distance of all pairs at configurations (N, nq), (N,) [m].

    Obstacles with a motion are where it has them at times (N,) [s], or None for as they are.
    """
    pairs, smallest = NearPairs(world), np.empty(len(q))
    for k, row in enumerate(q):
        if time is not None:
            world.set_time(float(time[k]))
        smallest[k] = pairs.smallest(row)[0]
    return smallest


@compiled
def _may_be_below(
    q: Array,
    limit: Array,
    most: float,
    question: int,
    blocks: Array,
    q_last: Array,
    joint_index: NDArray[np.int64],
    lipschitz: Array,
    joints: Array,
    numbers: Array,
    asked: NDArray[np.int64],
    changes: NDArray[np.int64],
    obstacle_way: Array,
) -> int:
    """Go on to q; write which pairs have not been asked for a question, and are to be: how many."""
    level, gone, count = numbers[0], numbers[1], 0
    holds, way = go(q, q_last, joint_index, joints), joints[0]
    n_blocks = number_of_blocks(level.shape[0])
    for group in range(blocks.shape[0] - n_blocks):
        if holds and block_left(blocks, n_blocks + group, way) - 2.0 * DISTANCE_TOLERANCE >= most:
            continue
        group_least = np.inf
        for block in range(group * BLOCK, min((group + 1) * BLOCK, n_blocks)):
            least = block_left(blocks, block, way)
            if not holds or least - 2.0 * DISTANCE_TOLERANCE < most:
                least = np.inf
                for k in range(block * BLOCK, min((block + 1) * BLOCK, level.shape[0])):
                    if changes[k] < 0:  # spare
                        level[k] = np.inf
                    elif not holds or changes[k] != asked[2, k]:
                        level[k] = -np.inf
                    asked[2, k] = changes[k]
                    gone[k] = pair_motion(lipschitz, k, way) + obstacle_way[k]
                    bound = level[k] - gone[k]
                    least = min(least, bound)
                    if asked[0, k] != question and bound - 2.0 * DISTANCE_TOLERANCE < limit[k]:
                        asked[0, k], asked[1, count] = question, k
                        count += 1
                write_block(blocks, block, least, way)
            group_least = min(group_least, least)
        write_block(blocks, n_blocks + group, group_least, way)
    return count


@compiled
def _learn_far(
    bounds: Array,
    asked: NDArray[np.int64],
    limit: Array,
    numbers: Array,
    blocks: Array,
) -> int:
    """Bound distances of pairs by balls around their bodies; keep and count those that are near."""
    count = 0
    for n in range(bounds.size):
        k = asked[1, n]
        forget_pair(blocks, k, numbers.shape[1])  # to be found anew
        if bounds[n] < limit[k]:
            asked[1, count] = k
            count += 1
        else:
            asked[0, k], numbers[0, k] = 0, bounds[n] + numbers[1, k]
    return count


@compiled
def _learn(rows: Array, pairs: Pairs, numbers: Array, blocks: Array) -> tuple[float, int]:
    """Bound distances of pairs from now on; return the smallest and the pair that has it."""
    smallest, nearest = np.inf, -1
    for k in pairs:
        numbers[0, k] = rows[k, 0] + numbers[1, k]
        forget_pair(blocks, k, numbers.shape[1])  # to be found anew
        if rows[k, 0] < smallest:
            smallest, nearest = rows[k, 0], k
    return smallest, nearest
