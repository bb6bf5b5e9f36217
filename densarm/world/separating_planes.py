"""SeparatingPlanes: a fast proof that straight joint-space segments touch nothing."""

from typing import NamedTuple

import numpy as np

from densarm.values.arrays import Array
from densarm.values.checks import non_negative
from densarm.values.kernels import compiled, compiled_lean_part, entry_point
from densarm.world.arc_separation import (
    NOTHING,
    ArcSpace,
    Memory,
    is_met_again,
    new_arc_space,
    write_unproved,
)
from densarm.world.bodies import Bodies, bodies_of, place, write_motion_bounds
from densarm.world.cloud_field import fields_of
from densarm.world.cloud_separation import PLANES
from densarm.world.obstacle_tree import ObstacleTree, obstacle_tree, write_found, write_least
from densarm.world.world import DISTANCE_TOLERANCE, World

_FLOOR = 1e-4  # [rad or m], length of a segment at which one not proved clear counts as not clear
_FIRST = 8  # pairs that were not clear lately, which are looked at before all others


class Tube(NamedTuple):
    """All joint positions within a radius per joint of a segment; a convex set."""

    begin: Array
    """One end of the segment (nv,) [rad or m]."""
    step: Array
    """From there to the other end (nv,) [rad or m]."""
    radius: Array
    """How far each joint may be off the segment (nv,) [rad or m]."""


@compiled
def configuration_tube(points: Array, step: Array) -> Tube:
    """Return a tube along a step (nv,) from the first of some points that holds them all.

    Being convex it holds the segments between the points (N, nv) [rad or m] as well.
    """
    square, nv = 0.0, step.size
    low, high = np.zeros(nv), np.zeros(nv)
    for j in range(nv):
        square += step[j] * step[j]
    for n in range(points.shape[0]):
        along = 0.0
        for j in range(nv):
            along += (points[n, j] - points[0, j]) * step[j]
        share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
        for j in range(nv):
            off = points[n, j] - points[0, j] - share * step[j]
            low[j], high[j] = min(low[j], off), max(high[j], off)
    for j in range(nv):
        low[j], high[j] = points[0, j] + 0.5 * (low[j] + high[j]), 0.5 * (high[j] - low[j])
    return Tube(low, step, high)


class SeparatingPlanes:
    r"""Proves segments as `SweptCheck` does, but by planes between bodies, in compiled code.

    Let a plane that moves with the last joint of both bodies of a pair leave a gap of f_a, f_b
    beyond the margin at both ends of a segment. The points of the bodies leave straight lines with
    accelerations of β at most, hence the gap on the segment, at s in [0, 1], is

    .. math:: f(s) \ge (1 - s) f_a + s f_b - \tfrac{1}{2} \beta s (1 - s) > 0
        \iff \beta < 2 (\sqrt{f_a} + \sqrt{f_b})^2.

    Where neither this nor the distances at both ends prove a pair, the segment is halved.

    Obstacles that are moved afterwards ask for a new object; questions to the old one raise
    `SceneChangedError`.

    Args:
        world: the pairs.
        margin: distance that must be exceeded for a pair to count as apart [m].
        kept: how much more that is for each pair (K,), or for all [m].

    Raises:
        InvalidValueError: a negative margin.
    """

    def __init__(self, world: World, margin: float = 0.0, kept: float | Array = 0.0) -> None:
        self._world = world
        self._version = world.version
        self._bodies, some_corner = bodies_of(world)
        least = non_negative("margin", margin) + DISTANCE_TOLERANCE
        self._least = np.full(world.n_pairs, least) + kept
        corners = np.full((world.n_pairs, 4, 2), -1)
        corners[:, 0] = some_corner
        order = np.flatnonzero(world.changes > 0)
        planes = np.full((world.n_pairs if world.clouds else 0, *PLANES), np.inf)
        tree = obstacle_tree(world, self._least)
        self._is_large = len(tree.bodies) > 0
        if self._is_large:
            order = tree.found[: min(_FIRST, tree.n_always)].copy()
        gaps = np.empty((world.n_pairs, 4))
        self._memory = Memory(corners, order, planes, gaps, fields_of(world), tree)
        # Loaded, or compiled, here rather than where a plan's time is taken.
        rest, still = np.zeros((2, world.arm.nv)), np.zeros(world.arm.nv)
        types = self._bodies, self._memory, self._least, still, rest
        self._kernel = entry_point(_polyline_is_clear, *types)
        self.asked = 0
        """How many questions it was asked."""

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether every distance at q (nq,) is proved above the margin."""
        return self.segment_is_clear(q, q)

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether every distance is proved above the margin on the whole segment.

        Args:
            q_a: one end (nq,).
            q_b: the other end (nq,), reached the short way round on continuous joints.
        """
        arm = self._world.arm
        return self._is_clear(_ends(arm.angles(q_a), arm.difference(q_a, q_b)))

    def polyline_is_clear(self, angles: Array) -> bool:
        """Return whether every distance is proved above the margin on a whole polyline.

        Args:
            angles: joint positions that it goes through (N, nv) [rad or m], N >= 2; continuous
                joints count their turns.
        """
        return self._is_clear(np.ascontiguousarray(angles, np.float64))

    def tube_is_clear(self, tube: Tube) -> bool:
        """Return whether every distance is proved above the margin in all of a tube."""
        return self._is_clear(_ends(tube.begin, tube.step), tube.radius)

    def _is_clear(self, angles: Array, radius: Array | None = None) -> bool:
        self._world.require_version(self._version)
        self.asked += 1
        off = np.zeros(angles.shape[1]) if radius is None else radius
        least = self._memory.tree.least if self._is_large else self._least
        if radius is not None and not self._is_large:
            least = least + self._world.lipschitz @ radius
        return bool(self._kernel(self._bodies, self._memory, least, off, angles))


def _ends(begin: Array, step: Array) -> Array:
    return np.array([begin, begin + step])


@compiled
def _polyline_is_clear(
    bodies: Bodies, memory: Memory, least: Array, radius: Array, points: Array
) -> bool:
    """Prove all pairs on a polyline, on all of it those first that were not clear lately.

    Args:
        bodies: the bodies.
        memory: which pairs to prove, and what helps.
        least: distance that each pair must exceed (K,) [m]; of very many that of the tree.
        radius: how far each joint may be off the polyline (nv,) [rad or m].
        points: joint positions that it goes through (N, nv) [rad or m].
    """
    space = new_arc_space(bodies.parent.size, bodies.joint.size, memory.gaps)
    step = space.step
    n_segments, first = points.shape[0] - 1, memory.order[:_FIRST]
    is_large = memory.tree.links.size > 0
    if is_large:
        write_least(memory.tree, first, radius)
    for part in range(3 * n_segments):
        stage, off = part // n_segments, part % n_segments
        # From the middle on: what is new about a way is clear at its ends as a rule.
        segment = (n_segments - 1) // 2 + (off + 1) // 2 * (2 * (off % 2) - 1)
        angles, longest = points[segment], 0.0
        for j in range(step.size):
            step[j] = points[segment + 1, j] - angles[j]
            longest = max(longest, abs(step[j]))
        if stage == 0:
            if is_met_again(bodies, memory, least, angles, first, space):
                return False
            continue
        order = first if stage == 1 else memory.order[_FIRST:]
        if is_large and stage == 2:
            order = memory.tree.found[: _find(bodies, memory.tree, radius, angles, space)]
            write_least(memory.tree, order, radius)
        # Pairs, arcs on which they are not proved, and what is known of them there.
        waiting = np.empty((order.size, 3), np.int64)
        for n in range(order.size):
            waiting[n, 0], waiting[n, 1], waiting[n, 2] = order[n], 0, NOTHING
        share = 1.0  # of the segment that an arc is
        while waiting.shape[0] > 0:
            halves = np.empty((2 * waiting.shape[0], 3), np.int64)
            written = write_unproved(bodies, memory, least, angles, share, waiting, halves, space)
            if written < 0 or (written > 0 and longest * share <= _FLOOR):
                return False
            waiting = halves[:written]
            share *= 0.5
    return True


@compiled_lean_part
def _find(bodies: Bodies, tree: ObstacleTree, radius: Array, angles: Array, space: ArcSpace) -> int:
    """Write which of very many pairs may touch on a segment, and return how many do."""
    joint_pose, pose, is_asked = space.joint_poses[1], space.poses[1], space.is_asked
    for body in range(is_asked.size):
        is_asked[body] = bodies.joint[body] > 0
    place(bodies, angles, space.step, 0.5, is_asked, joint_pose, pose)
    write_motion_bounds(bodies, space.step, 1.0, is_asked, joint_pose, pose, space.bounds)
    return write_found(tree, bodies, pose, space.bounds[0], radius)
