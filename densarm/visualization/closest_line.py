"""The line between the closest pair, as meshes and where they are at each frame."""

from itertools import product

import numpy as np
import pinocchio as pin

from densarm.arrays import Array
from densarm.visualization.closest_pairs import ClosestPairs
from densarm.visualization.triangle_mesh import TriangleMesh, rounded_hull

_SHORTEST = 1e-6  # [m], so that the line has a direction
_END = 2.0  # radius of the ends over half the width of the line


def closest_line(closest: ClosestPairs, radius: float) -> dict[str, tuple[TriangleMesh, Array]]:
    """Return a rod and its two ends, each with its transforms (N, 4, 4); nothing without pairs.

    Args:
        closest: the pairs at N frames.
        radius: half width of the line [m].
    """
    if len(closest.distance) == 0:
        return {}
    rod = rounded_hull(np.array(list(product((-1.0, 1.0), (-1.0, 1.0), (0.0, 1.0)))), 0.0)
    ball = rounded_hull(np.zeros((1, 3)), 1.0)
    first, second = closest.points[:, 0], closest.points[:, 1]
    return {
        "line": (rod, np.array([_rod(a, b, radius) for a, b in closest.points])),
        "first": (ball, _balls(first, _END * radius)),
        "second": (ball, _balls(second, _END * radius)),
    }


def _rod(start: Array, end: Array, radius: float) -> Array:
    """Return the transform that leads the unit rod along z from start to end."""
    length = max(float(np.linalg.norm(end - start)), _SHORTEST)
    up = np.array([0.0, 0.0, 1.0])
    rotation = pin.Quaternion.FromTwoVectors(up, end - start + 1e-12 * up).matrix()
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * [radius, radius, length]
    matrix[:3, 3] = start
    return matrix


def _balls(centres: Array, radius: float) -> Array:
    matrices = np.tile(np.diag([radius, radius, radius, 1.0]), (len(centres), 1, 1))
    matrices[:, :3, 3] = centres
    return matrices
