"""PairQueries: coal's distances of pairs of bodies, asked for again where it has found none."""

import math
import warnings
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.scene.shapes import FARTHEST
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part
from densarm.world.cloud_balls import CloudBalls
from densarm.world.distance_view import (
    DistanceView,
    empty_rows,
    shape_positions,
    shape_rotations,
)
from densarm.world.obstacle_slots import ChangingObstacles
from densarm.world.pair_slots import N_SLOTS, PairSlots

COAL_TOLERANCE = 1e-10
"""GJK and EPA tolerance [m]; at coal's default of 1e-6 gradients err by up to 4e-3."""

_LARGE = 10.0  # [m], radius of bodies of which a remembered guess may end at a wrong distance
_LOOSEST = 1e-6  # tolerance [m]
_FEW = 1000  # times as many pairs sleep as are awake where those are asked one by one
_ROUNDING = 1e-9  # [m], of balls
_FAR = 10.0 * FARTHEST  # [m], beyond all distances that there are


class BodyBalls(NamedTuple):
    """Balls around all bodies, by which pairs are known to be far."""

    pair_shapes: NDArray[np.int64]
    """`ChangingObstacles.pair_shapes` (K, 2)."""
    balls: Array
    """`ChangingObstacles.balls` (S, 4)."""
    positions: Array
    """Where the frames of all shapes are (S, 3) [m], a view of Pinocchio's data."""
    rotations: Array
    """Their rotation matrices (S, 3, 3), likewise."""


class PairQueries:
    """Distances of the pairs of a geometry model, by coal.

    Where coal cannot be as precise as it is told to be it may say -1.8e308 m, mostly
    of pairs far apart. Such a pair is asked for again, from another guess and at looser
    tolerances, before anybody reads it.

    Args:
        model: moves the shapes.
        obstacles: the pairs, all present, and the clouds among them.
        remembers: whether each search begins where the pair's last one ended, unless a body is
            large. The last digits of distances depend on earlier queries then.
    """

    def __init__(
        self,
        model: pin.Model,
        obstacles: ChangingObstacles,
        remembers: bool,
    ) -> None:
        self._model, self._obstacles, self._placed = model, obstacles, 0
        geometry, pair_shapes = obstacles.geometry_model, obstacles.pair_shapes
        self._shapes, self._links = geometry, obstacles.links
        self._slots = PairSlots(geometry, pair_shapes) if len(pair_shapes) > N_SLOTS else None
        self._geometry = self._slots.geometry if self._slots else geometry
        self.data: pin.GeometryData = self._slots.data if self._slots else geometry.createData()
        """Pinocchio's data; a query is of the placements that it has."""
        frames = shape_positions(self.data), shape_rotations(self.data)
        self.body_balls = BodyBalls(pair_shapes, obstacles.balls, *frames)
        """Balls around all bodies, where the data has them."""
        self._requests = list(self.data.distanceRequests)
        for request in self._requests:
            request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE
        radius = np.array([item.geometry.aabb_radius for item in geometry.geometryObjects])
        is_large = (radius[pair_shapes[: len(self._requests)]] > _LARGE).any(axis=1)
        forgets = is_large | (self._slots is not None or not remembers)
        _forget([self._requests[k] for k in np.flatnonzero(forgets)])
        rest = pin.neutral(model)
        pin.computeDistances(model, model.createData(), self._geometry, self.data, rest)
        self._balls = CloudBalls(obstacles, self.data) if obstacles.clouds else None
        self._view = DistanceView(self.data)
        self._copies = empty_rows(len(pair_shapes) if self._slots else 0)
        self.rows: Array = self._copies.view() if self._slots else self._view.read()
        """[distance, normal, point 1, point 2] (K, 10) [m], each of the pair's last query."""
        self.rows.flags.writeable = False
        self._ask_again()
        self.ask(np.zeros(0, np.int64))  # its kernel is loaded before a control loop

    @property
    def is_large(self) -> bool:
        """Whether to ask for all pairs would take half a second: balls tell which are far."""
        return self._slots is not None

    def bounds(self, pairs: NDArray[np.int64]) -> Array:
        """Return lower bounds of the distances of some pairs (P,), by balls around bodies [m]."""
        return np.asarray(_bounds(self.body_balls, pairs))

    def place(self, data: pin.Data) -> None:
        """Put all shapes where the data has the joints; obstacles only once they have changed."""
        geometry, version = self._links, self._obstacles.version
        if self._placed != version:
            geometry, self._placed = self._shapes, version
        pin.updateGeometryPlacements(self._model, data, geometry, self.data)

    def activate(self, pair: int, is_active: bool) -> None:
        """Let `ask_active` ask for a pair or not."""
        if self._slots:
            return
        if is_active:
            self.data.activateCollisionPair(pair)
        else:
            self.data.deactivateCollisionPair(pair)

    def ask(self, pairs: NDArray[np.int64]) -> None:
        """Query some pairs (P,)."""
        geometry, data = self._geometry, self.data
        if self._balls:
            self._balls.place(pairs)
        if self._slots:
            for begin in range(0, len(pairs), N_SLOTS):
                self._ask_in_turns(self._slots, pairs[begin : begin + N_SLOTS])
            return
        for k in pairs.tolist():
            pin.computeDistance(geometry, data, k)
        if not _are_known(self._view.read(), pairs):
            self._ask_again()

    def ask_active(self, pairs: NDArray[np.int64]) -> None:
        """Query some pairs (P,), which are all that are active."""
        if self._slots or _FEW * len(pairs) < len(self._requests):
            self.ask(pairs)  # passing over those that sleep would take longer
            return
        if self._balls:
            self._balls.place(pairs)
        nearest = pin.computeDistances(self._geometry, self.data)
        # What stands for no distance is less than all others.
        if not self._view.read()[nearest, 0] > -_FAR:
            self._ask_again()

    def _ask_in_turns(self, slots: PairSlots, pairs: NDArray[np.int64]) -> None:
        geometry, data = self._geometry, self.data
        for k in slots.take(pairs):
            pin.computeDistance(geometry, data, k)
        if not _are_known(self._view.read(), slots.slot[pairs]):
            self._ask_again()
        _copy_rows(self._view.read(), slots.slot, pairs, self._copies)

    def _ask_again(self) -> None:
        """Replace what is no distance or has no normal."""
        rows = self._view.read()
        known = (np.abs(rows[:, 0]) < _FAR) & np.isfinite(rows).all(axis=1)
        for k in np.flatnonzero(~known).tolist():
            request = self._requests[k]
            _forget([request])
            for tolerance in np.geomspace(COAL_TOLERANCE, _LOOSEST, 5).tolist():
                request.gjk_tolerance = request.epa_tolerance = tolerance
                pin.computeDistance(self._geometry, self.data, k)
                if np.isfinite(row := self._view.read()[k]).all() and abs(row[0]) < _FAR:
                    break
            request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE


@compiled
def _bounds(balls: BodyBalls, pairs: NDArray[np.int64]) -> Array:
    found = np.empty(pairs.size)
    for n in range(pairs.size):
        found[n] = ball_gap(balls, pairs[n])
    return found


@compiled_part
def ball_gap(balls: BodyBalls, pair: int) -> float:
    """Return how far the balls around the bodies of a pair are apart, a bound of theirs [m]."""
    i, j = balls.pair_shapes[pair]
    middle, turn, square = balls.balls, balls.rotations, 0.0
    for axis in range(3):
        along = balls.positions[i, axis] - balls.positions[j, axis]
        for c in range(3):
            along += turn[i, axis, c] * middle[i, c] - turn[j, axis, c] * middle[j, c]
        square += along * along
    gap: float = math.sqrt(square) - middle[i, 3] - middle[j, 3] - _ROUNDING
    return gap


@compiled
def _copy_rows(rows: Array, slot: NDArray[np.int64], pairs: NDArray[np.int64], out: Array) -> None:
    for k in pairs:
        for i in range(rows.shape[1]):
            out[k, i] = rows[slot[k], i]


@compiled
def _are_known(rows: Array, pairs: NDArray[np.int64]) -> bool:
    known = True
    for k in pairs:
        known &= abs(rows[k, 0]) < _FAR
    return known


def _forget(requests: list[coal.DistanceRequest]) -> None:
    """Let searches begin in the middle of the bodies."""
    with warnings.catch_warnings():
        # Pinocchio asks for guesses from the last query, by a flag that coal calls deprecated.
        warnings.simplefilter("ignore", DeprecationWarning)
        for request in requests:
            request.enable_cached_gjk_guess = False
            request.gjk_initial_guess = coal.GJKInitialGuess.BoundingVolumeGuess
