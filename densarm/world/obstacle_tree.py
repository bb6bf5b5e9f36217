"""ObstacleTree: which of very many pairs may touch on a motion, without a look at all."""

import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from densarm.scene.point_tree import (
    DEEPEST,
    PointTree,
    leaf_points,
    point_tree,
    square_from_box,
)
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_lean_part
from densarm.world.bodies import BALL, LIPSCHITZ, Bodies, bodies_of
from densarm.world.pair_slots import N_SLOTS
from densarm.world.simplex import Integers
from densarm.world.world import World

_LARGEST = 10.0  # [m], radius of a ball around an obstacle of the tree
_ROUNDING = 1e-9  # [m]


class ObstacleTree(NamedTuple):
    """Balls around obstacles, in a tree of their middles; empty where there are not very many."""

    middles: PointTree
    """Middles of the balls, and boxes around them."""
    reach: Array
    """Largest radius of the balls of each node (M,) [m]."""
    bodies: Integers
    """For each ball its body, its first pair and that after the last (N, 3)."""
    links: Integers
    """Bodies that are paired with them."""
    found: Integers
    """Pairs: first those that are always looked at, then room for others (K,)."""
    n_always: int
    """How many of the former."""
    kept: Array
    """Distance that each pair must exceed, beside what is due to joints off their way (K,) [m]."""
    most: float
    """The largest of these [m]."""
    lipschitz: Array
    """`World.lipschitz`."""
    least: Array
    """Room for what each pair must exceed in all (K,) [m]."""
    waiting: Integers
    """Room for nodes that wait in a search (DEEPEST,)."""
    middle: Array
    """Room for the middle of a ball (3,) [m]."""


def obstacle_tree(world: World, kept: Array) -> ObstacleTree:
    """Return the tree of a world's obstacles as they are now, kept until one changes.

    Args:
        world: the pairs.
        kept: distance that each of them must exceed (K,) [m].
    """
    version, made = _MADE.get(world, (0, None))
    if made is None or version != world.version:
        made = _tree(bodies_of(world)[0], np.flatnonzero(world.changes > 0), world.lipschitz)
        _MADE[world] = (world.version, made)
    most = float(kept.max(initial=0.0))
    return made._replace(found=made.found.copy(), kept=kept, most=most, least=kept.copy())


_MADE: WeakKeyDictionary[World, tuple[int, ObstacleTree]] = WeakKeyDictionary()


def _tree(bodies: Bodies, order: Integers, lipschitz: Array) -> ObstacleTree:
    is_in = np.zeros(len(bodies.pairs), np.bool_)
    if len(order) > N_SLOTS:  # fewer are all looked at
        is_in[order] = True
        one, other, joint = bodies.pairs.T
        is_in &= (joint == 0) & (bodies.joint[other] == 0) & (bodies.joint[one] > 0)
        is_in &= (bodies.cloud[other] < 0) & (bodies.shapes[other, BALL] < _LARGEST)
    there = np.flatnonzero(is_in)
    body, first, count = np.unique(bodies.pairs[there, 1], return_index=True, return_counts=True)
    rows = np.column_stack([body, there[first], there[first] + count]).astype(np.int64)
    middles = bodies.shapes[body, 9:12]
    tree = point_tree(middles) if len(body) else PointTree(np.zeros((0, 3)), np.zeros((0, 6)))
    # The tree has the middles in an order of its own; equal ones are alike.
    at = np.empty(len(body), np.int64)
    at[np.lexsort(tree.points.T)] = np.lexsort(middles.T)
    always = order[~is_in[order]]
    found = np.concatenate([always, np.zeros(len(there), np.int64)])
    links = np.unique(bodies.pairs[there, 0])
    radius = bodies.shapes[body[at], BALL]
    own, none = (_reach(tree, radius), rows[at], links, found, len(always)), np.zeros(0)
    room = np.zeros(DEEPEST, np.int64), np.zeros(3)
    return ObstacleTree(tree, *own, none, 0.0, lipschitz, none, *room)


def _reach(tree: PointTree, radius: Array) -> Array:
    """Return the largest radius below each node, of radii in the order of the tree's points."""
    reach = np.zeros(len(tree.boxes))
    n_leaves = (len(tree.boxes) + 1) // 2
    for node in reversed(range(len(reach))):
        leaf = node - n_leaves + 1
        if leaf >= 0:
            begin, end = leaf * len(radius) // n_leaves, (leaf + 1) * len(radius) // n_leaves
            reach[node] = radius[begin:end].max(initial=0.0)
        else:
            reach[node] = reach[2 * node + 1 : 2 * node + 3].max()
    return reach


@compiled_lean_part
def write_found(
    tree: ObstacleTree, bodies: Bodies, pose: Array, motion: Array, radius: Array
) -> int:
    """Write which pairs are not apart by their balls, after those that are always looked at.

    How many there are in all is returned.

    Args:
        tree: the obstacles.
        bodies: the bodies.
        pose: poses of links in the middle of a motion (S, 12).
        motion: how far they go on it, seen from each joint (S, njoints) [m].
        radius: by which joints may be off it (nv,) [rad or m].
    """
    shapes, points, boxes = bodies.shapes, tree.middles.points, tree.middles.boxes
    waiting, middle, count = tree.waiting, tree.middle, tree.n_always
    for i in tree.links:
        needed = tree.most + shapes[i, BALL] + 0.5 * motion[i, 0] + _ROUNDING
        for axis in range(3):
            middle[axis] = pose[i, 9 + axis]
        for j in range(radius.size):
            needed += shapes[i, LIPSCHITZ + j] * radius[j]
        n_waiting, waiting[0] = 1, 0
        while n_waiting > 0:
            n_waiting -= 1
            node = waiting[n_waiting]
            if math.sqrt(square_from_box(boxes[node], middle)) > needed + tree.reach[node]:
                continue
            begin, end = leaf_points(tree.middles, node)
            if begin == end:
                waiting[n_waiting], waiting[n_waiting + 1] = 2 * node + 1, 2 * node + 2
                n_waiting += 2
            for n in range(begin, end):
                if _apart(points[n], middle) <= needed + shapes[tree.bodies[n, 0], BALL]:
                    count = _add_pairs(tree, bodies, n, i, count)
    return count


@compiled_lean_part
def _add_pairs(tree: ObstacleTree, bodies: Bodies, ball: int, link: int, count: int) -> int:
    """Add the pairs of a ball and a link to those that were found; return how many there are."""
    for k in range(tree.bodies[ball, 1], tree.bodies[ball, 2]):
        if bodies.pairs[k, 0] == link:
            tree.found[count] = k
            count += 1
    return count


@compiled_lean_part
def write_least(tree: ObstacleTree, pairs: Integers, radius: Array) -> None:
    """Write what pairs must exceed, with joints off their way by a radius (nv,) [rad or m]."""
    for k in pairs:
        tree.least[k] = tree.kept[k]
        for j in range(radius.size):
            tree.least[k] += tree.lipschitz[k, j] * radius[j]


@compiled_lean_part
def _apart(x: Array, y: Array) -> float:
    square = 0.0
    for a in range(3):
        square += (x[a] - y[a]) ** 2
    return math.sqrt(square)
