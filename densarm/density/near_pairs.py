"""NearPairs: the geometry pairs that may be near, the only ones whose distances are queried."""

import warnings
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import COAL_TOLERANCE, DISTANCE_TOLERANCE
from densarm.compiled import compiled
from densarm.density.joint_error import joint_error
from densarm.distance_view import DistanceView
from densarm.proof.swept_bound import SweptBound

_WORLD = pin.Convention.WORLD
_ASLEEP, _AWAKE = 0, 1
_NEVER = 0  # seen, of a pair that must be queried
_LONGEST_WAY = 1e4  # [rad or m], beyond which sums of small steps would round off too much


class NearPairs:
    r"""Queries pairs that may be near, and bounds the distances of the others from below.

    A pair whose distance was d_k at a query is at least

    .. math:: d_k - \sum_j r_{kj} s_j

    apart since, s_j being the way that joint j has gone, in steps along straight segments, and
    r_kj the levers of the swept bound. It sleeps, at no cost but this, until that falls to its
    reach. All pairs wake while a slide is beyond its limits, where the levers do not hold; pairs
    of an obstacle wake when it is moved.

    Queried distances do not depend on what was queried before, to the last bit. These are
    `DistanceBounds`: a sleeping pair can be woken by asking for its distance.

    Args:
        bound: the pairs and r_kj.
    """

    def __init__(self, bound: SweptBound) -> None:
        self.clearance = clearance = bound.clearance
        arm, geometry = clearance.arm, clearance.geometry_model
        self._model = arm.model
        self.data: pin.Data = arm.model.createData()
        """Holds placements, Jacobian and mass matrix (upper triangle) of the last update."""
        self._geometry, self._geometry_data = geometry, geometry.createData()
        for item in geometry.geometryObjects:
            item.geometry.computeLocalAABB()
        with warnings.catch_warnings():
            # Pinocchio asks for guesses from the last query, by a flag that coal calls deprecated.
            warnings.simplefilter("ignore", DeprecationWarning)
            for request in self._geometry_data.distanceRequests:
                request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE
                request.enable_cached_gjk_guess = False
                request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
        pin.updateGeometryPlacements(
            arm.model, self.data, geometry, self._geometry_data, pin.neutral(arm.model)
        )
        pin.computeDistances(geometry, self._geometry_data)
        self._view = DistanceView(self._geometry_data)
        self._lever = bound.lever
        n = clearance.n_pairs
        self.rows: Array = self._view.read()
        """[distance, normal, point 1, point 2] (K, 10) [m]; old where a pair is asleep."""
        self.jacobian: Array = self.data.J.reshape(6, arm.nv)
        """World-frame joint Jacobian (6, nv) at the last update."""
        self.sign = clearance.sign
        """S_2 - S_1 of `Clearance` (K, nv)."""
        # Rows: awake, the version of `Clearance.changes` that was queried, and a workspace.
        self._pair_states = np.array([[_AWAKE], [_NEVER], [0]]).repeat(n, axis=1)
        self.state: NDArray[np.int64] = self._pair_states[0]
        """Nonzero where a pair is awake (K,)."""
        self._changed = self._pair_states[2]
        self._pair_numbers = np.ones((2, n))
        self.sensing_distance: Array = self._pair_numbers[0]
        """σ_k > 0 (K,) [m], which may be changed in place."""
        # After the joints have gone a way s a pair is at least level - lever @ s apart.
        self._level = self._pair_numbers[1]
        self._bounds: Array | None = None
        # Rows: the way gone, its last step, and the least and largest position of slides.
        self._joint_numbers = np.zeros((4, arm.nv))
        self._joint_numbers[2] = np.where(bound.slides, arm.limits.lower, -np.inf)
        self._joint_numbers[3] = np.where(bound.slides, arm.limits.upper, np.inf)
        self._arrays: tuple[Any, ...] = (
            pin.neutral(arm.model),
            arm.idx_q,
            arm.is_circle,
            bound.lever,
            self.rows,
            self._joint_numbers,
            self._pair_numbers,
            self._pair_states,
            clearance.changes,
        )

    @property
    def distance(self) -> Array:
        """Distances at the last update (K,) [m]: exact for pairs awake, else lower bounds."""
        if self._bounds is None:
            gone = self._lever @ self._joint_numbers[0]
            asleep = self._level - gone - DISTANCE_TOLERANCE
            self._bounds = np.where(self.state == _ASLEEP, asleep, self.rows[:, 0])
        return self._bounds

    def query(self, pair: int) -> bool:
        """Act as `DistanceBounds.query`, at the configuration of the last update."""
        if self.state[pair] == _AWAKE:
            return False
        geometry, data = self._geometry, self._geometry_data
        if not self.state.any():  # shapes were left where they were
            pin.updateGeometryPlacements(self._model, self.data, geometry, data)
        data.activateCollisionPair(pair)
        pin.computeDistance(geometry, data, pair)
        if not self._view.is_direct:
            self._view.read()
        self.state[pair] = _AWAKE
        self.distance[pair] = self.rows[pair, 0]
        return True

    def wake_all(self) -> None:
        """Query every pair at the next update."""
        self._pair_states[1] = _NEVER

    def update(self, q: Array, margin: float) -> None:
        """Query the pairs that may be within reach at q (nq,), and some others.

        Args:
            q: configuration (nq,).
            margin: m [m]; the reach of a pair is m + σ_k.
        """
        geometry, data = self._geometry, self._geometry_data
        n_awake, n_changed = _wake(q, margin, *self._arrays)
        self._bounds = None
        for k in self._changed[:n_changed].tolist() if n_changed else ():
            if k >= 0:
                data.activateCollisionPair(k)
            else:
                data.deactivateCollisionPair(~k)
        # One pass for placements, Jacobian and M, which costs little more than the first two.
        pin.crba(self._model, self.data, q, _WORLD)
        if n_awake:
            pin.updateGeometryPlacements(self._model, self.data, geometry, data)
            pin.computeDistances(geometry, data)
            if not self._view.is_direct:
                self._view.read()


@compiled
def _wake(
    q: Array,
    margin: float,
    q_last: Array,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    lever: Array,
    rows: Array,
    joint_numbers: Array,
    pair_numbers: Array,
    pair_states: NDArray[np.int64],
    changes: NDArray[np.int64],
) -> tuple[int, int]:
    """Decide which pairs are awake at q; return how many, and how many changed.

    Into the last row of `pair_states` go the indices of pairs that wake, and the complements of
    those that fall asleep.
    """
    sensing_distance, level = pair_numbers[0], pair_numbers[1]
    state, seen, changed = pair_states[0], pair_states[1], pair_states[2]
    wakes_all = not _go(q, q_last, idx_q, is_circle, joint_numbers)
    n_awake, n_changed = 0, 0
    for k in range(state.shape[0]):
        before = state[k]
        if changes[k] < 0:  # spare
            state[k], level[k] = _ASLEEP, np.inf
        elif changes[k] != seen[k] or wakes_all:
            state[k] = _AWAKE
        else:
            gone = _motion(lever[k], joint_numbers[0])
            reach = margin + sensing_distance[k] + 2.0 * DISTANCE_TOLERANCE
            if before == _AWAKE:
                level[k] = rows[k, 0] + (gone - _motion(lever[k], joint_numbers[1]))
            # A sleep of a few steps saves nothing, but pairs that close to their reach are few.
            state[k] = _ASLEEP if level[k] - gone > reach else _AWAKE
        seen[k] = changes[k]
        n_awake += state[k]
        if (before == _ASLEEP) != (state[k] == _ASLEEP):
            changed[n_changed] = ~k if state[k] == _ASLEEP else k
            n_changed += 1
    return n_awake, n_changed


@compiled
def _go(
    q: Array,
    q_last: Array,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    joint_numbers: Array,
) -> bool:
    """Add the last step to the way gone; return whether bounds hold that are older than it."""
    way, step, low, high = joint_numbers[0], joint_numbers[1], joint_numbers[2], joint_numbers[3]
    joint_error(q_last, q, idx_q, is_circle, step)
    holds = True
    for j in range(way.shape[0]):
        step[j] = abs(step[j])
        way[j] += step[j]
        x, y = q[idx_q[j]], q_last[idx_q[j]]
        holds &= low[j] <= x <= high[j] and low[j] <= y <= high[j] and way[j] < _LONGEST_WAY
    # Entry by entry: a slice would compile, for seconds, the words of errors that cannot occur.
    for j in range(way.shape[0]):
        way[j] = way[j] if holds else 0.0
    for i in range(q.shape[0]):
        q_last[i] = q[i]
    return holds


@compiled
def _motion(lever: Array, way: Array) -> float:
    motion = 0.0
    for j in range(way.shape[0]):
        motion += lever[j] * way[j]
    return motion
