"""ActivePairs: the pairs of bodies that may be near, the only ones whose distances are queried."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.dynamics import Kinematics
from densarm.arms.joint_space import joint_error, sliding_joints
from densarm.values.arrays import Array
from densarm.values.kernels import any_vector, compiled, compiled_part, entry_point
from densarm.world.pair_blocks import (
    BLOCK,
    block_left,
    number_of_blocks,
    pair_blocks,
    rows_of,
    write_block,
)
from densarm.world.pair_queries import BodyBalls, PairQueries, ball_gap
from densarm.world.world import DISTANCE_TOLERANCE, World

_ASLEEP, _AWAKE = 0, 1
_NEVER = 0  # seen, of a pair that must be queried
_LONGEST_WAY = 1e4  # [rad or m], beyond which sums of small steps would round off too much


class DistanceBounds(Protocol):
    """Lower bounds of the distances of all pairs at one configuration, any to be made exact."""

    @property
    def distance(self) -> Array:
        """Distances or lower bounds of them (K,) [m]; `query` overwrites it."""
        ...

    def query(self, pair: int) -> bool:
        """Put the distance of a pair in the place of its bound; return False if it was there."""
        ...


@dataclass(frozen=True, eq=False)
class ExactDistances:
    """`DistanceBounds` of distances that are all known."""

    distance: Array
    """As `DistanceBounds.distance`."""

    def query(self, pair: int) -> bool:  # noqa: ARG002
        """Act as `DistanceBounds.query`."""
        return False


def longest_travel(
    bounds: DistanceBounds, need: float | Array, rate: Array, enough: float = np.inf
) -> float:
    r"""Return how far along a motion the first pair has used its distance up.

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
        travel, pair = _first(bounds.distance - need, rate)
        if travel > enough or pair < 0 or not bounds.query(pair):
            return travel


def all_exceed(bounds: DistanceBounds, need: Array) -> bool:
    """Return whether d_k > n_k [m] (K,) for every pair, d_k those of the bounds."""
    return longest_travel(bounds, need, np.ones_like(need), enough=0.0) > 0.0


class ActivePairs:
    r"""Queries pairs that may be near, and bounds the distances of the others from below.

    A pair whose distance was d_k at a query is at least

    .. math:: d_k - \sum_j r_{kj} s_j - w_k

    apart since, s_j being the way that joint j has gone, in steps along straight segments, r_kj
    the Lipschitz constants of the world, and w_k the way that its obstacle has been moved. It
    sleeps, at no cost but this, until that falls to its reach. All pairs wake while a slide is
    beyond its limits, where the constants do not hold.

    Queried distances do not depend on what was queried before, to the last bit. These are
    `DistanceBounds`: a sleeping pair can be woken by asking for its distance.

    Args:
        world: the pairs.
        kinematics: placements that its owner updates before each `update` of the pairs, to the
            same configuration; None for ones of their own.
    """

    def __init__(self, world: World, kinematics: Kinematics | None = None) -> None:
        self.world = world
        arm = world.arm
        self._updates_kinematics = kinematics is None
        self.kinematics = kinematics or Kinematics(arm)
        """Placements and Jacobian at the last update."""
        self._queries = PairQueries(arm.model, world, remembers=False)
        self.rows: Array = self._queries.rows
        """[distance, normal, point 1, point 2] (K, 10) [m]; old where a pair is asleep."""
        # Rows: awake, the version of `World.changes` that was queried, a workspace, awake pairs.
        self._pair_states = np.array([[_AWAKE], [_NEVER], [0], [0]]).repeat(world.n_pairs, axis=1)
        self.state: NDArray[np.int64] = self._pair_states[0]
        """Nonzero where a pair is awake (K,)."""
        # Second row: after the joints have gone a way s and the obstacle w, the distance is at
        # least level - lipschitz @ s - w. Third row: w at the last update.
        self._pair_numbers = np.zeros((3, world.n_pairs))
        self.reach: Array = self._pair_numbers[0]
        """Distance up to which each pair is awake (K,) [m]; after writing to it, `look_again`."""
        self.slept: Array = self._pair_numbers[1:]
        """Of pairs asleep, what `least_distance` reads (2, K) [m]."""
        self.listed: NDArray[np.int64] = self._pair_states[3]
        """The pairs that were awake at the last update, in their order; as many as `n_awake`."""
        self.n_awake = 0
        self._blocks = pair_blocks(world.lipschitz)
        self._version = 0
        self._bounds: Array | None = None
        self._joint_numbers, rest = joint_numbers(arm), pin.neutral(arm.model)
        self.way: Array = self._joint_numbers[0]
        """How far each joint has gone since this was made (nv,) [rad or m]."""
        self._arrays: tuple[Any, ...] = (
            rest.copy(),
            arm.joint_index,
            world.lipschitz,
            self.rows,
            self._joint_numbers,
            self._pair_numbers,
            self._pair_states,
            world.changes,
            world.obstacle_way,
            self._blocks,
            self._queries.body_balls if self._queries.is_large else None,
        )
        self._wake = entry_point(_wake, any_vector, *self._arrays)
        self.update(rest)  # kernels are loaded, or compiled, before a control loop
        self.wake_all()

    @property
    def distance(self) -> Array:
        """Distances at the last update (K,) [m]: exact for pairs awake, else lower bounds."""
        if self._bounds is None:
            gone = self.world.lipschitz @ self._joint_numbers[0] + self._pair_numbers[2]
            asleep = self._pair_numbers[1] - gone - DISTANCE_TOLERANCE
            self._bounds = np.where(self.state == _ASLEEP, asleep, self.rows[:, 0])
        return self._bounds

    def query(self, pair: int) -> bool:
        """Act as `DistanceBounds.query`, at the configuration of the last update."""
        if self.state[pair] == _AWAKE:
            return False
        self._queries.activate(pair, True)
        self._queries.ask(np.array([pair]))
        self.state[pair] = _AWAKE
        self._blocks[rows_of(pair, self.world.n_pairs), 0] = -np.inf
        self.distance[pair] = self.rows[pair, 0]
        return True

    def set_reach(self, reach: float | Array) -> None:
        """Let pairs be awake up to other distances from now on, one for all or (K,) [m]."""
        self.reach[:] = reach
        self.look_again()

    def look_again(self) -> None:
        """Look at every pair at the next update, as after reach was written to."""
        self._blocks[:, 0] = -np.inf

    def wake_all(self) -> None:
        """Query every pair at the next update."""
        self._pair_states[1] = _NEVER
        self.look_again()

    def update(self, q: Array) -> None:
        """Query the pairs that may be within reach at q (nq,), and some others."""
        if self._updates_kinematics:
            self.kinematics.update(q)
        self._queries.place(self.kinematics.data)
        if self._version != self.world.version:
            self._version = self.world.version
            self.look_again()
        n_awake, n_changed = self._wake(np.asarray(q, np.float64), *self._arrays)
        self.n_awake = n_awake
        self._bounds = None
        for k in self._pair_states[2, :n_changed].tolist() if n_changed else ():
            self._queries.activate(k if k >= 0 else ~k, k >= 0)
        if n_awake:
            self._queries.ask_active(self.listed[:n_awake])


def joint_numbers(arm: Arm) -> Array:
    """Return rows for `go` (4, nv): zeros, zeros, and the least and largest position of slides."""
    slides, limits = sliding_joints(arm.model), arm.limits
    low, high = np.where(slides, limits.lower, -np.inf), np.where(slides, limits.upper, np.inf)
    return np.array([np.zeros(arm.nv), np.zeros(arm.nv), low, high])


@compiled
def _first(margin: Array, rate: Array) -> tuple[float, int]:
    least, pair = np.inf, -1
    for k in range(margin.shape[0]):
        if rate[k] > 0.0 and margin[k] / rate[k] < least:
            least, pair = margin[k] / rate[k], k
    return least, pair


@compiled
def _wake(  # noqa: C901  # what is called at each level is compiled once more
    q: Array,
    q_last: Array,
    joint_index: NDArray[np.int64],
    lipschitz: Array,
    rows: Array,
    joint_numbers: Array,
    pair_numbers: Array,
    pair_states: NDArray[np.int64],
    changes: NDArray[np.int64],
    obstacle_way: Array,
    blocks: Array,
    balls: BodyBalls | None,
) -> tuple[int, int]:
    """Decide which pairs are awake at q; return how many, and how many changed.

    Into the last rows of `pair_states` go the indices of pairs that wake, and the complements of
    those that fall asleep, and then all that are awake. Pairs that are not awake sleep on where
    balls around their bodies, if those are told, are far apart.
    """
    state, seen, changed, listed = pair_states[0], pair_states[1], pair_states[2], pair_states[3]
    reach, level, moved = pair_numbers[0], pair_numbers[1], pair_numbers[2]
    wakes_all = not go(q, q_last, joint_index, joint_numbers)
    way, step = joint_numbers[0], joint_numbers[1]
    n_awake, n_changed, n_blocks = 0, 0, number_of_blocks(state.shape[0])
    for group in range(blocks.shape[0] - n_blocks):
        if block_left(blocks, n_blocks + group, way) > 0.0 and not wakes_all:
            continue
        group_left = np.inf
        for block in range(group * BLOCK, min((group + 1) * BLOCK, n_blocks)):
            left = block_left(blocks, block, way)
            if not left > 0.0 or wakes_all:
                # What is left of all of them is found anew where that ran out.
                is_spent, left = left > -np.inf, np.inf
                for k in range(block * BLOCK, min((block + 1) * BLOCK, state.shape[0])):
                    before, now, change = state[k], _AWAKE, changes[k]
                    by_joints = pair_motion(lipschitz, k, way)
                    gone, enough = by_joints + obstacle_way[k], reach[k] + 2.0 * DISTANCE_TOLERANCE
                    if change < 0:  # spare
                        level[k] = np.inf
                    elif change != seen[k] or wakes_all:
                        level[k] = -np.inf
                    elif before == _AWAKE:
                        last = pair_motion(lipschitz, k, step)
                        level[k] = rows[k, 0] + (by_joints - last) + moved[k]
                    is_low = is_spent or not level[k] - gone > enough
                    is_exact = before == _AWAKE and level[k] > -np.inf
                    if balls is not None and is_low and not is_exact:
                        level[k] = max(level[k], ball_gap(balls, k) + gone)
                    # A sleep of a few steps saves nothing, but pairs so close to it are few.
                    if change < 0 or level[k] - gone > enough:
                        now = _ASLEEP
                    state[k], seen[k], moved[k] = now, change, obstacle_way[k]
                    if now == _AWAKE:
                        listed[n_awake], left = k, -np.inf
                        n_awake += 1
                    else:
                        left = min(left, level[k] - gone - enough)
                    if now != before:
                        changed[n_changed] = k if now == _AWAKE else ~k
                        n_changed += 1
                write_block(blocks, block, left, way)
            group_left = min(group_left, left)
        write_block(blocks, n_blocks + group, group_left, way)
    return n_awake, n_changed


@compiled_part
def go(q: Array, q_last: Array, joint_index: NDArray[np.int64], joint_numbers: Array) -> bool:
    """Add the last step to the way gone; return whether bounds hold that are older than it.

    Args:
        q: configuration (nq,).
        q_last: the one before (nq,), overwritten.
        joint_index: `Arm.joint_index` (2, nv).
        joint_numbers: the way gone, its last step, both overwritten, and as `joint_numbers` has
            them the least and largest position of slides (4, nv) [rad or m].
    """
    way, step, low, high = joint_numbers[0], joint_numbers[1], joint_numbers[2], joint_numbers[3]
    joint_error(q_last, q, joint_index, step)
    holds = True
    for j in range(way.shape[0]):
        step[j] = abs(step[j])
        way[j] += step[j]
        x, y = q[joint_index[0, j]], q_last[joint_index[0, j]]
        inside = (low[j] <= x) & (x <= high[j]) & (low[j] <= y) & (y <= high[j])
        holds &= inside & (way[j] < _LONGEST_WAY)
    # Entry by entry: a slice would compile, for seconds, the words of errors that cannot occur.
    if not holds:
        for j in range(way.shape[0]):
            way[j] = 0.0
    for i in range(q.shape[0]):
        q_last[i] = q[i]
    return holds


@compiled_part
def least_distance(lipschitz: Array, pair: int, way: Array, slept: Array) -> float:
    """Return a lower bound of the distance [m] of a pair that is asleep, at the last update.

    Args:
        lipschitz: of the world (K, nv).
        pair: its index.
        way: `ActivePairs.way` (nv,).
        slept: `ActivePairs.slept` (2, K).
    """
    bound: float = slept[0, pair] - slept[1, pair] - pair_motion(lipschitz, pair, way)
    return bound


@compiled_part
def pair_motion(lipschitz: Array, pair: int, way: Array) -> float:
    """Return how far a pair's bodies move against each other at most [m] on a way (nv,)."""
    motion = 0.0
    for j in range(way.shape[0]):
        motion += lipschitz[pair, j] * way[j]
    return motion
