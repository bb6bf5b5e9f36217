"""FittedCapsule: the smallest capsule around a body, for distances that are cheap and smooth."""

from itertools import product
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array

# Per size of the body: by which the solver may miss a point, and the capsule exceeds the farthest.
_TIGHTNESS = 1e-6

_ROUNDS = 100
_SMALL = 1e-12  # keeps quotients of zero by zero at zero


class FittedCapsule(NamedTuple):
    """The points within a radius of a segment."""

    start: Array
    """One end of the segment (3,) [m]."""
    end: Array
    """The other end (3,) [m]."""
    radius: float
    """[m]."""

    @property
    def volume(self) -> float:
        """Volume of the capsule [m³]."""
        length = float(np.linalg.norm(self.end - self.start))
        return np.pi * self.radius**2 * (length + 4.0 / 3.0 * self.radius)

    def shape(self) -> tuple[coal.Capsule, pin.SE3]:
        """Return coal's capsule, whose axis is z, and its placement."""
        axis = self.end - self.start
        # Closed forms for capsules divide by the length.
        length = max(float(np.linalg.norm(axis)), 1e-3 * self.radius)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis / length).matrix()
        return coal.Capsule(self.radius, length), pin.SE3(turn, 0.5 * (self.start + self.end))


def fitted_capsule(points: Array) -> FittedCapsule:
    """Return a smallest capsule around points, and so around their convex hull.

    The volume π r² (‖b - a‖ + 4r/3) is minimised over the ends a, b of the axis and the radius
    r, with every point within r of the axis, from one start along each principal axis. The starts
    compete on the points farthest along some directions; then the best is made to enclose all.

    Args:
        points: (N, 3) [m], not all in one plane.
    """
    centre = points.mean(axis=0)
    scale = float(np.abs(points - centre).max())
    unit = (points - centre) / scale
    chosen = _farthest_along_directions(unit)
    best = min(
        (_smallest(unit[chosen], start, end) for start, end in _starts(unit)),
        key=lambda capsule: capsule.volume,
    )
    best = _enclosing(unit, chosen, best)
    return FittedCapsule(
        centre + scale * best.start, centre + scale * best.end, scale * best.radius
    )


def _farthest_along_directions(points: Array) -> NDArray[np.bool_]:
    directions = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    length = np.maximum(np.linalg.norm(directions, axis=1), 1.0)
    chosen = np.zeros(len(points), dtype=bool)
    chosen[(points @ (directions / length[:, np.newaxis]).T).argmax(axis=0)] = True
    return chosen


def _starts(points: Array) -> list[tuple[Array, Array]]:
    """Return a segment along each principal axis, shortened by half the width across it."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    segments = []
    for axis in axes:
        along = points @ axis
        across = np.linalg.norm(points - np.outer(along, axis), axis=1).max()
        half = max(0.5 * np.ptp(along) - 0.5 * across, 0.05 * np.ptp(along))
        middle = 0.5 * (along.max() + along.min()) * axis
        segments.append((middle - half * axis, middle + half * axis))
    return segments


def _enclosing(points: Array, chosen: NDArray[np.bool_], capsule: FittedCapsule) -> FittedCapsule:
    """Return the optimum around all points; few touch it, so few are given to the solver."""
    for _ in range(_ROUNDS):
        distance = _distances(points, capsule.start, capsule.end)
        outside = (distance > capsule.radius + _TIGHTNESS) & ~chosen
        if not outside.any():
            break
        chosen = chosen | (distance >= np.sort(distance[outside])[-5:][0])
        capsule = _smallest(points[chosen], capsule.start, capsule.end)
    distance = _distances(points, capsule.start, capsule.end)
    return capsule._replace(radius=float(distance.max()) + _TIGHTNESS)


def _smallest(points: Array, start: Array, end: Array) -> FittedCapsule:
    """Return a locally smallest capsule around few points."""
    from scipy.optimize import minimize

    def volume(x: Array) -> float:
        return float(x[6] ** 2 * (np.linalg.norm(x[3:6] - x[:3]) + 4.0 / 3.0 * x[6]))

    def volume_gradient(x: Array) -> Array:
        axis, radius = x[3:6] - x[:3], x[6]
        length = float(np.linalg.norm(axis))
        along = radius**2 * axis / max(length, _SMALL)
        return np.array([*-along, *along, 2.0 * radius * length + 4.0 * radius**2])

    def slack(x: Array) -> Array:
        return np.asarray(x[6] - _distances(points, x[:3], x[3:6]))

    def slack_gradient(x: Array) -> Array:
        fraction, offset = _nearest(points, x[:3], x[3:6])
        normal = offset / np.maximum(np.linalg.norm(offset, axis=1), _SMALL)[:, np.newaxis]
        share = fraction[:, np.newaxis]
        return np.hstack([normal * (1.0 - share), normal * share, np.ones_like(share)])

    result = minimize(
        volume,
        np.array([*start, *end, _distances(points, start, end).max()]),
        jac=volume_gradient,
        constraints={"type": "ineq", "fun": slack, "jac": slack_gradient},
        method="SLSQP",
        options={"ftol": 1e-8},
    )
    return FittedCapsule(result.x[:3], result.x[3:6], float(result.x[6]))


def _nearest(points: Array, a: Array, b: Array) -> tuple[Array, Array]:
    """Return the fraction (N,) of the segment nearest to each point, and the way (N, 3) from it."""
    axis = b - a
    fraction = np.clip((points - a) @ axis / max(float(axis @ axis), _SMALL), 0.0, 1.0)
    return fraction, points - a - np.outer(fraction, axis)


def _distances(points: Array, a: Array, b: Array) -> Array:
    return np.asarray(np.linalg.norm(_nearest(points, a, b)[1], axis=1))
