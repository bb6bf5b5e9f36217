"""PointTree: points in space, ordered so that what is near to a body is found fast."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from densarm.values.arrays import Array
from densarm.values.kernels import compiled_beside, compiled_lean_part

_LEAF = 8  # points of a leaf at most


class PointTree(NamedTuple):
    """Points, and boxes around more and more of them: a complete binary tree.

    Node k has the nodes 2k + 1 and 2k + 2 below it. Node i of the nodes at a depth L has the points
    from iN/2^L up to (i + 1)N/2^L, rounded down. The last nodes are leaves of 8 points at most.
    """

    points: Array
    """The points (N, 3) [m]."""
    boxes: Array
    """Least and largest coordinates of the points of each node (M, 6) [m]."""


DEEPEST = 64
"""Nodes that wait at most in a search, of a tree of up to 2^60 points."""


@compiled_lean_part
def put_nearer_last(
    first: int,
    first_bound: float,
    second: int,
    second_bound: float,
    waiting: NDArray[np.int64],
    bounds: Array,
    count: int,
) -> int:
    """Let two nodes wait, at given distances; return how many wait.

    The nearer, or of equals the first, is put last: the one to be looked at next.
    """
    if second_bound < first_bound:
        first, second, first_bound, second_bound = second, first, second_bound, first_bound
    waiting[count], waiting[count + 1] = second, first
    bounds[count], bounds[count + 1] = second_bound, first_bound
    return count + 2


@compiled_lean_part
def square_from_box(box: Array, x: Array) -> float:
    """Return the square of the distance of a place (3,) from a box (6,) [m²]."""
    square = 0.0
    for axis in range(3):
        square += max(box[axis] - x[axis], x[axis] - box[3 + axis], 0.0) ** 2
    return square


@compiled_lean_part
def leaf_points(tree: PointTree, node: int) -> tuple[int, int]:
    """Return the first point of a node and that after the last; none of a node that is no leaf."""
    n, n_leaves = tree.points.shape[0], (tree.boxes.shape[0] + 1) // 2
    leaf = node - n_leaves + 1
    return ((leaf * n) // n_leaves, ((leaf + 1) * n) // n_leaves) if leaf >= 0 else (0, 0)


def point_tree(points: Array) -> PointTree:
    """Return the tree of finite points (N, 3) [m], N >= 1.

    Nodes are split at the median across their longest side. Other threads go on meanwhile.
    """
    ordered, depth = np.array(points, dtype=np.float64, order="C"), 0
    while (len(ordered) >> depth) > _LEAF or len(ordered) > _LEAF << depth:
        depth += 1
    boxes = np.empty(((2 << depth) - 1, 6))
    _order(ordered, boxes, depth)
    return PointTree(ordered, boxes)


@compiled_beside
def _order(points: Array, boxes: Array, depth: int) -> None:
    n, node = points.shape[0], 0
    for level in range(depth + 1):
        for i in range(1 << level):
            begin, end = (i * n) >> level, ((i + 1) * n) >> level
            axis, widest = 0, -1.0
            for a in range(3):
                low = high = points[begin, a]
                for k in range(begin + 1, end):
                    low, high = min(low, points[k, a]), max(high, points[k, a])
                boxes[node, a], boxes[node, 3 + a] = low, high
                if high - low > widest:
                    axis, widest = a, high - low
            if level < depth:
                _split(points, begin, end, ((2 * i + 1) * n) >> (level + 1), axis)
            node += 1


@compiled_lean_part
def _split(points: Array, begin: int, end: int, middle: int, axis: int) -> None:
    """Reorder points from `begin` to `end` so that none before `middle` lies beyond one after it.

    Source: Hoare, Algorithm 65: Find, Communications of the ACM 1961.
    """
    first, last = begin, end - 1
    while first < last:
        pivot, i, j = points[middle, axis], first, last
        while i <= j:
            while points[i, axis] < pivot:
                i += 1
            while pivot < points[j, axis]:
                j -= 1
            if i <= j:
                for a in range(3):
                    held = points[i, a]
                    points[i, a] = points[j, a]
                    points[j, a] = held
                i, j = i + 1, j - 1
        if j < middle:
            first = i
        if middle < i:
            last = j
