"""DistanceView: coal's results of all pairs as one array, without a Python loop per pair.

Pinocchio keeps a `coal.DistanceResult` per pair in one C++ vector. Its fields distance, normal
and the two nearest points are ten consecutive doubles, a layout that coal does not document:
it is compared with the documented getters on the arm's own pairs when the view is made, and
where it differs the getters are used instead.
"""

import ctypes

import numpy as np
import pinocchio as pin

from densarm.arrays import Array

_FIELDS = 10  # distance 1, normal 3, nearest point on body 1 and on body 2, 3 each


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
        self._rows = np.zeros((len(self._results), _FIELDS)) if strided is None else strided

    def read(self) -> Array:
        """Return rows [distance, normal, point 1, point 2], shape (K, 10), of the last query."""
        if not self.is_direct:
            self._rows[:] = self._by_getters()
        return self._rows

    def _strided(self) -> Array | None:
        if not self._results:
            return None
        addresses = [result.normal.__array_interface__["data"][0] for result in self._results]
        steps = np.diff(addresses)
        stride = int(steps[0]) if len(steps) else _FIELDS * 8
        if (steps != stride).any() or stride < _FIELDS * 8 or stride % 8 != 0:
            return None
        count = (stride // 8) * (len(addresses) - 1) + _FIELDS
        memory = (ctypes.c_double * count).from_address(addresses[0] - 8)
        rows = np.lib.stride_tricks.as_strided(
            np.ctypeslib.as_array(memory), (len(addresses), _FIELDS), (stride, 8), writeable=False
        )
        return rows if np.array_equal(rows, self._by_getters()) else None

    def _by_getters(self) -> Array:
        rows = [
            [r.min_distance, *r.normal, *r.getNearestPoint1(), *r.getNearestPoint2()]
            for r in self._results
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, _FIELDS)
