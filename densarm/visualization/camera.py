"""Camera: where to look from so that given points fill the picture."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array

FIELD_OF_VIEW = 35.0
"""Vertical opening angle of the camera [deg]."""

_ASPECT = 1.3  # width over height of the narrowest window that still shows everything
_FILL = 0.8  # part of the picture that the points may take
_SIDE = np.array([1.0, -1.0, 0.7])  # octant of the camera: in front, to the right, above


@dataclass(frozen=True)
class Camera:
    """A camera with z upwards.

    `target` (3,) is the point it looks at and `offset` (3,) leads from there to the camera, both
    in the world frame [m].
    """

    target: Array
    offset: Array

    @classmethod
    def facing(cls, points: Array) -> "Camera":
        """Return the nearest camera that sees all points.

        It looks along the directions in which the points extend least: straight at the plane of a
        planar arm, and from a corner at an arm that moves in space.

        Args:
            points: (N, 3) in the world frame [m], N ≥ 1.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        target = (low + high) / 2.0
        direction = _SIDE / np.maximum(high - low, 0.05 * np.max(high - low) + 1e-6)
        direction /= np.linalg.norm(direction)
        right = np.cross([0.0, 0.0, 1.0], direction)
        right /= np.linalg.norm(right)
        up = np.cross(direction, right)
        slope = _FILL * np.tan(np.radians(FIELD_OF_VIEW) / 2.0)
        offset = points - target
        width = np.maximum(np.abs(offset @ up) / slope, np.abs(offset @ right) / (slope * _ASPECT))
        distance = float(np.max(offset @ direction + width))
        return cls(target, distance * direction)
