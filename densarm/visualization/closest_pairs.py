"""ClosestPairs: which two bodies are closest at each instant of a motion, and where."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance


@dataclass(frozen=True)
class ClosestPairs:
    """The closest pair at each of N configurations; N = 0 where there are no pairs."""

    distance: Array
    """Signed distance (N,) [m]."""
    points: Array
    """The point of each body nearest to the other (N, 2, 3), in the world frame [m]."""
    names: tuple[tuple[str, str], ...]
    """The two bodies at each configuration."""

    @classmethod
    def along(cls, clearance: Clearance, q: Array) -> "ClosestPairs":
        """Return the closest pairs at configurations (N, nq)."""
        distance, points, names = [], [], []
        for configuration in q if clearance.n_pairs else q[:0]:
            all_distances = clearance.distances(configuration)
            k = int(all_distances.argmin())
            result = clearance.geometry_data.distanceResults[k]
            distance.append(all_distances[k])
            points.append([result.getNearestPoint1(), result.getNearestPoint2()])
            names.append(clearance.pairs[k])
        return cls(np.array(distance), np.reshape(points, (-1, 2, 3)), tuple(names))
