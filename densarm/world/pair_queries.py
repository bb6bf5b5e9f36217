"""PairQueries: coal's distances of pairs of bodies, asked for again where it has found none."""

import warnings

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.scene.shapes import FARTHEST
from densarm.values.arrays import Array
from densarm.values.kernels import compiled
from densarm.world.cloud_balls import CloudBalls
from densarm.world.distance_view import DistanceView
from densarm.world.obstacle_slots import ChangingObstacles

COAL_TOLERANCE = 1e-10
"""GJK and EPA tolerance [m]; at coal's default of 1e-6 gradients err by up to 4e-3."""

_LARGE = 10.0  # [m], radius of bodies of which a remembered guess may end at a wrong distance
_LOOSEST = 1e-6  # tolerance [m]
_FEW = 1000  # times as many pairs sleep as are awake where those are asked one by one
_FAR = 10.0 * FARTHEST  # [m], beyond all distances that there are


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
        geometry, pair_shapes = obstacles.geometry_model, obstacles.pair_shapes
        self._geometry = geometry
        self.data: pin.GeometryData = geometry.createData()
        """Pinocchio's data, whose placements are to be updated before a query."""
        shapes = [item.geometry for item in geometry.geometryObjects]
        for shape in shapes:
            shape.computeLocalAABB()
        radius = np.array([shape.aabb_radius for shape in shapes])
        forgets = (radius[pair_shapes] > _LARGE).any(axis=1) | (not remembers)
        self._requests = list(self.data.distanceRequests)
        for request in self._requests:
            request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE
        _forget([self._requests[k] for k in np.flatnonzero(forgets)])
        pin.computeDistances(model, model.createData(), geometry, self.data, pin.neutral(model))
        self._balls = CloudBalls(obstacles, self.data) if obstacles.clouds else None
        self._view = DistanceView(self.data)
        self.rows: Array = self._view.read()
        """[distance, normal, point 1, point 2] (K, 10) [m], each of the pair's last query."""
        self._ask_again()
        self.ask(np.zeros(0, np.int64))  # its kernel is loaded before a control loop

    def ask(self, pairs: NDArray[np.int64]) -> None:
        """Query some pairs (P,)."""
        geometry, data = self._geometry, self.data
        if self._balls:
            self._balls.place(pairs)
        for k in pairs.tolist():
            pin.computeDistance(geometry, data, k)
        if not _are_known(self._view.read(), pairs):
            self._ask_again()

    def ask_active(self, pairs: NDArray[np.int64]) -> None:
        """Query some pairs (P,), which are all that are active in the data."""
        if _FEW * len(pairs) < len(self._requests):
            self.ask(pairs)  # passing over those that sleep would take longer
            return
        if self._balls:
            self._balls.place(pairs)
        nearest = pin.computeDistances(self._geometry, self.data)
        # What stands for no distance is less than all others.
        if not self._view.read()[nearest, 0] > -_FAR:
            self._ask_again()

    def _ask_again(self) -> None:
        """Replace what is no distance or has no normal."""
        known = (np.abs(self.rows[:, 0]) < _FAR) & np.isfinite(self.rows).all(axis=1)
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
