"""Camera: where to look from so that given points fill the picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import coal
import numpy as np
import pinocchio as pin

from densarm.values.arrays import Array

FIELD_OF_VIEW = 35.0
"""Vertical opening angle of the camera [deg]."""

_ASPECT = 1.3  # width over height of the narrowest window that still shows everything
_FILL = 0.76  # part of the picture that the points may take; words stand above and below
_BEFORE = 0.1  # least depth of the nearest point, as a part of what the points extend
_SLANTS = ((1.0, 1.0, 0.7), (0.4, 1.0, 0.6), (1.0, 0.4, 0.6))  # in front, aside, above
_SIDES = tuple(product((1.0, -1.0), (-1.0, 1.0)))  # signs of x and y, the usual ones first
_SIGHT = 2e-3  # thickness of a line of sight [m]


@dataclass(frozen=True)
class Sight:
    """A point that is to be seen, and what may stand before it."""

    point: Array
    """(3,), in the world frame [m]."""
    before: Sequence[tuple[coal.CollisionGeometry, pin.SE3, float]]
    """Shapes, their poses, and their opacities, 0 to 1."""

    def visibility(self, eye: Array) -> float:
        """Return how much of the point comes through to an eye (3,) [m], 0 to 1."""
        way = eye - self.point
        rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), way).matrix()
        line = coal.Capsule(_SIGHT / 2.0, float(np.linalg.norm(way)))
        at = coal.Transform3s(rotation, self.point + way / 2.0)
        request, share = coal.CollisionRequest(), 1.0
        for shape, pose, opacity in self.before:
            place = coal.Transform3s(pose.rotation, pose.translation)
            if coal.collide(line, at, shape, place, request, coal.CollisionResult()):
                share *= 1.0 - opacity
        return share


@dataclass(frozen=True)
class Camera:
    """A camera with z upwards.

    `target` (3,) is the point it looks at and `offset` (3,) leads from there to the camera, both
    in the world frame [m].
    """

    target: Array
    offset: Array

    @classmethod
    def facing(cls, points: Array, watched: Sequence[Sight] = ()) -> "Camera":
        """Return a camera that sees points (N, 3) [m], and those watched as well as can be.

        It looks along the directions in which the points extend least: straight at the plane of a
        planar arm, and from a corner at an arm that moves in space.
        """
        cameras = [cls._along(points, slant, side) for side in _SIDES for slant in _SLANTS]
        return max(
            cameras,
            key=lambda camera: sum(
                each.visibility(camera.target + camera.offset) for each in watched
            ),
        )

    @property
    def axes(self) -> Array:
        """Unit vectors (3, 3) in rows: to the right, upwards and towards the camera."""
        back = self.offset / np.linalg.norm(self.offset)
        right = np.cross([0.0, 0.0, 1.0], back)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(back, right), back])

    @classmethod
    def _along(cls, points: Array, slant: tuple[float, ...], side: tuple[float, ...]) -> "Camera":
        low, high = points.min(axis=0), points.max(axis=0)
        target = (low + high) / 2.0
        extent = np.maximum(high - low, 0.05 * np.max(high - low) + 1e-6)
        direction = np.array([*side, 1.0]) * slant / extent
        camera = cls(target, direction / np.linalg.norm(direction))
        # A camera at depth D and m aside sees the point at (x, depth) if |x - m| <= w (D - depth).
        seen = (points - target) @ camera.axes.T
        width = np.array([_ASPECT, 1.0]) * _FILL * np.tan(np.radians(FIELD_OF_VIEW) / 2.0)
        from_right = (seen[:, 2:] + seen[:, :2] / width).max(axis=0)
        from_left = (seen[:, 2:] - seen[:, :2] / width).max(axis=0)
        aside = width * (from_right - from_left) / 2.0
        nearest = seen[:, 2].max() + _BEFORE * np.max(high - low)
        distance = max(float((from_right + from_left).max() / 2.0), float(nearest))
        return cls(target + aside @ camera.axes[:2], distance * camera.offset)
