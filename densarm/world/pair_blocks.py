"""Blocks of pairs, and groups of blocks, that are passed over together where none can be near.

What is left of the least distance of each is a row of one array (B + G, 1 + 2 nv), of all blocks
and then of all groups: that distance [m], minus infinity where nothing is known, the largest of
each Lipschitz constant, and the way that the joints had gone when it was known.
"""

import numpy as np

from densarm.values.arrays import Array
from densarm.values.kernels import compiled_part

BLOCK = 32
"""Pairs of a block, and blocks of a group."""


def pair_blocks(lipschitz: Array) -> Array:
    """Return blocks and groups of which nothing is known, given Lipschitz constants (K, nv)."""
    blocks = _largest(lipschitz)
    rows = np.vstack([blocks, _largest(blocks)])
    return np.hstack([np.full((len(rows), 1), -np.inf), rows, 0.0 * rows])


def _largest(lipschitz: Array) -> Array:
    """Return the largest of each constant (N, nv) in blocks of rows."""
    starts = np.arange(0, len(lipschitz), BLOCK)
    return np.asarray(np.maximum.reduceat(lipschitz, starts) if len(starts) else lipschitz)


def rows_of(pair: int, n_pairs: int) -> list[int]:
    """Return the rows of the block and of the group of a pair."""
    return [pair // BLOCK, -(-n_pairs // BLOCK) + pair // BLOCK // BLOCK]


@compiled_part
def number_of_blocks(n_pairs: int) -> int:
    """Return how many rows are of blocks, the others being of groups."""
    return (n_pairs + BLOCK - 1) // BLOCK


@compiled_part
def forget_pair(blocks: Array, pair: int, n_pairs: int) -> None:
    """Know nothing of a pair."""
    blocks[pair // BLOCK, 0] = -np.inf
    blocks[number_of_blocks(n_pairs) + pair // BLOCK // BLOCK, 0] = -np.inf


@compiled_part
def block_left(blocks: Array, row: int, way: Array) -> float:
    """Return what is left of a row's least distance after the joints have gone a way (nv,)."""
    left: float = blocks[row, 0]
    for j in range(way.shape[0]):
        left -= blocks[row, 1 + j] * (way[j] - blocks[row, 1 + way.shape[0] + j])
    return left


@compiled_part
def write_block(blocks: Array, row: int, left: float, way: Array) -> None:
    """Write what is left of a row's least distance [m] after the joints have gone a way (nv,)."""
    blocks[row, 0] = left
    for j in range(way.shape[0]):
        blocks[row, 1 + way.shape[0] + j] = way[j]
