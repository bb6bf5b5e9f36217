"""coal's results of all pairs as one array, and their gradients, without a Python loop per pair.

Pinocchio keeps a `coal.DistanceResult` per pair in one C++ vector. Its fields distance, normal
and the two nearest points are ten consecutive doubles, a layout that coal does not document:
it is compared with the documented getters on some of the arm's own pairs when the view is made, and
where it differs the getters are used instead. This file alone looks into that memory. A method
of Pinocchio's `GeometryData` that returns these (K, 10) numbers as an array would end that.
"""

import ctypes
import math
from collections.abc import Iterable

import coal
import numpy as np
import pinocchio as pin

from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part

_FIELDS = 10  # distance 1, normal 3, nearest point on body 1 and on body 2, 3 each
_COMPARED = 20  # pairs at most, evenly spread, of which both layouts are compared


class DistanceView:
    """Distances [m], unit normals from body 1 to 2 and nearest points [m] of all pairs.

    Args:
        geometry_data: Pinocchio's data, all pairs present, distances computed at least once.
    """

    def __init__(self, geometry_data: pin.GeometryData) -> None:
        self._geometry_data = geometry_data  # owns the memory that the view reads
        self._results = list(geometry_data.distanceResults)
        strided = self._strided()
        self.is_direct = strided is not None
        """Whether `read` costs no copy."""
        self._copies = empty_rows(len(self._results))
        self._rows = self._copies.view() if strided is None else strided
        self._rows.flags.writeable = False  # alike, for kernels, however they are read

    def read(self) -> Array:
        """Return rows [distance, normal, point 1, point 2], shape (K, 10), of the last query."""
        if not self.is_direct:
            self._copies[:] = self._by_getters(self._results)
        return self._rows

    def _strided(self) -> Array | None:
        count = len(self._results)
        if not count:
            return None
        first, some = self._address(0), np.unique(np.linspace(0, count - 1, _COMPARED).astype(int))
        stride = self._address(1) - first if count > 1 else 2 * _FIELDS * 8
        even = all(self._address(k) - first == stride * k for k in some)
        if not even or stride < _FIELDS * 8 or stride % 8 != 0:
            return None
        size = (stride // 8) * (count - 1) + _FIELDS
        memory = (ctypes.c_double * size).from_address(first - 8)
        rows = np.lib.stride_tricks.as_strided(
            np.ctypeslib.as_array(memory), (count, _FIELDS), (stride, 8), writeable=False
        )
        known = self._by_getters(self._results[k] for k in some)
        return rows if np.array_equal(rows[some], known, equal_nan=True) else None

    def _address(self, pair: int) -> int:
        return int(self._results[pair].normal.__array_interface__["data"][0])

    @staticmethod
    def _by_getters(results: Iterable[coal.DistanceResult]) -> Array:
        rows = [
            [r.min_distance, *r.normal, *r.getNearestPoint1(), *r.getNearestPoint2()]
            for r in results
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, _FIELDS)


def empty_rows(count: int) -> Array:
    """Return rows for as many pairs, laid out alike for kernels."""
    return np.zeros((count + 1, 2 * _FIELDS))[:count, :_FIELDS]


def shape_positions(geometry_data: pin.GeometryData) -> Array:
    """Return the positions of all shapes' frames (S, 3) [m] as a view, to be read and written.

    They are members of the elements of one C++ vector.
    """
    return _members(geometry_data.oMg, "translation")


def shape_rotations(geometry_data: pin.GeometryData) -> Array:
    """Return the rotations of all shapes' frames (S, 3, 3) likewise."""
    return _members(geometry_data.oMg, "rotation")


def _members(placements: pin.StdVec_SE3, name: str) -> Array:
    count = len(placements)
    views = [getattr(placements[k], name) for k in range(min(count, 2))]
    begin = [view.__array_interface__["data"][0] for view in views]
    strides = (begin[-1] - begin[0], *views[0].strides)
    return np.lib.stride_tricks.as_strided(views[0], (count, *views[0].shape), strides)


@compiled
def add_pair_gradients(rows: Array, jacobian: Array, sign: Array, out: Array) -> None:
    """Add the gradients of all distances to `out` (K, nv), with rows (K, 10) and S_2 - S_1 (K, nv).

    The world-frame joint Jacobian is (6, nv).
    """
    for k in range(rows.shape[0]):
        add_pair_gradient(rows[k], jacobian, sign[k], 1.0, out[k])


@compiled_part
def add_pair_gradient(row: Array, jacobian: Array, sign: Array, factor: float, out: Array) -> None:
    """Add a multiple of the gradient of one distance in place.

    Args:
        row: [distance, normal, point 1, point 2], as `DistanceView` has it (10,).
        jacobian: world-frame joint Jacobian (6, nv).
        sign: S_2 - S_1 (nv,).
        factor: of the gradient.
        out: added to (nv,).
    """
    nx, ny, nz = row[1], row[2], row[3]
    px, py, pz = row[4], row[5], row[6]
    mx, my, mz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
    for j in range(sign.shape[0]):
        if sign[j] != 0.0:
            slope = nx * jacobian[0, j] + ny * jacobian[1, j] + nz * jacobian[2, j]
            slope += mx * jacobian[3, j]
            slope += my * jacobian[4, j]
            slope += mz * jacobian[5, j]
            out[j] += factor * (sign[j] * slope)


@compiled
def pair_rates(rows: Array, twist: Array) -> Array:
    r"""Return how fast each distance changes by the motion of its obstacle (K,) [m/s].

    .. math:: \partial d_k / \partial t = n_k \cdot w_k

    Args:
        rows: as `DistanceView` has them (K, 10).
        twist: `ChangingObstacles.twist` (K, 6).
    """
    rates = np.empty(rows.shape[0])
    for k in range(rows.shape[0]):
        rates[k] = pair_rate(rows[k], twist[k])
    return rates


@compiled_part
def pair_rate(row: Array, twist: Array) -> float:
    """Return n · w of one pair [m/s], w the velocity of body 2, an obstacle, at its nearest point.

    Args:
        row: [distance, normal, point 1, point 2], as `DistanceView` has it (10,).
        twist: velocity of the obstacle's point at the origin, and angular (6,).
    """
    nx, ny, nz, px, py, pz = row[1], row[2], row[3], row[7], row[8], row[9]
    rate: float = nx * twist[0] + ny * twist[1] + nz * twist[2]
    rate += (py * nz - pz * ny) * twist[3] + (pz * nx - px * nz) * twist[4]
    rate += (px * ny - py * nx) * twist[5]
    return rate


@compiled_part
def obstacle_speed(twist: Array) -> float:
    """Return how fast points of an obstacle are at most [m/s], infinite where it turns."""
    if twist[3] != 0.0 or twist[4] != 0.0 or twist[5] != 0.0:
        return math.inf
    return math.sqrt(twist[0] ** 2 + twist[1] ** 2 + twist[2] ** 2)
