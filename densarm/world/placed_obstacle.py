"""PlacedObstacle: where an obstacle of a geometry model is, and how fast it moves."""

import math
from dataclasses import fields, replace
from typing import Any, TypeGuard

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Capsule, Obstacle, Sphere, pose_fields
from densarm.scene.point_cloud import PointCloud
from densarm.scene.shapes import FARTHEST
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector
from densarm.values.kernels import compiled, compiled_part

_FADING = 0.05  # [s], in which a pose counts for the velocity by a factor e less
_PRIOR = 2.5e-5  # [s²], by poses that err by 5 mm and velocities of 1 m/s


class PlacedObstacle:
    """The shapes of an obstacle in the geometry model, and the pairs that they are part of.

    Args:
        shapes: its shapes.
        pairs: where the pairs are among all.
        ways: their part of `ChangingObstacles.obstacle_way`, written to.
        twists: and of `ChangingObstacles.twist`.
        balls: and of `ChangingObstacles.balls`.
    """

    obstacle: Obstacle

    def __init__(
        self,
        shapes: list[pin.GeometryObject],
        pairs: slice,
        ways: Array,
        twists: Array,
        balls: Array,
    ) -> None:
        self.shapes = shapes
        self.pairs = pairs
        self._ways, self._twists, self._balls = ways, twists, balls
        self.gone = 0.0
        """As the ways [m]."""
        self.pose = np.zeros(7)
        """x y z [m] and quaternion, seen from the model's origin."""
        self.velocity = np.zeros(6)
        self.told: Array | None = None
        """Pose in the world that it was moved to; None if it is that of the obstacle."""
        self._track = np.zeros(_TRACK)

    def can_hold(self, obstacle: Obstacle) -> bool:
        """Return whether another obstacle may take the place of this one."""
        if type(obstacle) is not type(self.obstacle):
            return False
        sizes = {item.name for item in fields(obstacle)} - {item.name for item in fields(Obstacle)}
        return isinstance(obstacle, Sphere | Capsule | PointCloud) or all(
            getattr(obstacle, size) == getattr(self.obstacle, size) for size in sizes
        )

    def hold(self, obstacle: Obstacle, origin: Array) -> None:
        """Become an obstacle, seen from a point of the world, as a pose (7,)."""
        self.become(obstacle)
        self.told = None
        is_one = len(self.shapes) == 1 or isinstance(obstacle, PointCloud)
        for k, shape in enumerate(self.shapes):
            shape.name = obstacle.name if is_one else f"{obstacle.name}.{k}"
            if isinstance(obstacle, Sphere | Capsule | PointCloud):
                shape.geometry.radius = obstacle.radius
            if isinstance(obstacle, Capsule):
                shape.geometry.halfLength = 0.5 * obstacle.length
            self._balls[k] = enclosing_ball(shape.geometry)
        if isinstance(obstacle, PointCloud):
            self._balls[:, 3] = math.inf
        pose = np.array([*obstacle.position, *obstacle.orientation_xyzw])
        self.put(pose - origin, obstacle.velocity_at(0.0), None)
        self.gone = self._ways[:] = 0.0

    def become(self, obstacle: Obstacle) -> None:
        """Take another of the same shapes' place, at the pose that it has."""
        self.obstacle, self._reach = obstacle, obstacle.reach

    @property
    def seen_at(self) -> float:
        """Time of the last move that had one [s]; not a number where that had none."""
        return float(self._track[_TIME]) if self._track[_COUNT] > 0.0 else math.nan

    def present(self) -> Obstacle:
        """Return the obstacle where it was moved to."""
        if self.told is not None:
            *position, x, y, z, w = self.told.tolist()
            pose = {"position": position, "orientation_xyzw": (x, y, z, w)}
            self.obstacle, self.told = replace(self.obstacle, **pose, motion=None), None
        return self.obstacle

    def after(self, duration: float, origin: Array) -> Obstacle:
        """Return the obstacle at rest where its velocity leads it, seen from a point as `hold`."""
        if self.obstacle.motion is None and not self.velocity.any():
            return self.present()
        goes_on = ConstantVelocity(linear=self.velocity[:3], angular=self.velocity[3:])
        there = goes_on.pose(duration, pin.XYZQUATToSE3(self.pose + origin))
        return replace(self.obstacle, **pose_fields(there), motion=None)

    def checked_pose(self, position: ArrayLike, orientation_xyzw: ArrayLike | None) -> Array:
        """Return a pose (7,) in the world, turned as it is if by None; errors as of an obstacle."""
        turned: Any = self.pose[3:] if orientation_xyzw is None else orientation_xyzw
        if _is_vector(position, 3) and _is_vector(turned, 4):  # as a control loop has them
            pose = np.empty(7)
            pose[:3], pose[3:] = position, turned
            if _is_pose(pose):
                return pose
        there = {"position": position, "orientation_xyzw": turned, "motion": None}
        obstacle = replace(self.obstacle, **there)
        return np.array([*obstacle.position, *obstacle.orientation_xyzw])

    def put(self, pose: Array, velocity: Array | None, time: float | None) -> float:
        """Go to a pose, seen from the model's origin; return how far a point goes at most [m]."""
        way = _go(pose, self.pose, self._reach, self._ways)
        if way > 0.0:
            self.gone += way
            placement = pin.XYZQUATToSE3(pose)
            for shape in self.shapes:
                shape.placement = placement
        if velocity is None and time is not None:
            _follow(pose, time, self._track, self.velocity)
        else:
            self.velocity[:] = 0.0 if velocity is None else velocity
            self._track[_COUNT] = 0.0
        _write_twists(pose, self.velocity, self._twists)
        return way


def enclosing_ball(shape: coal.CollisionGeometry) -> Array:
    """Return the middle in its frame and the radius of a ball around a shape (4,) [m]."""
    shape.computeLocalAABB()
    ball = np.array([*shape.aabb_center, shape.aabb_radius])
    return ball if ball[3] < FARTHEST else np.array([0.0, 0.0, 0.0, math.inf])


def _is_vector(value: object, size: int) -> TypeGuard[Array]:
    return isinstance(value, np.ndarray) and value.shape == (size,) and value.dtype == np.float64


def checked_velocity(value: ArrayLike) -> Array:
    """Return a linear velocity, or one that is linear and angular, as the latter (6,)."""
    out = np.zeros(6)
    if _is_vector(value, 3):
        out[:3] = value
        if _are_finite(out):
            return out
    size = 6 if np.size(value) == 6 else 3
    out[:size] = finite_vector("velocity", value, size)
    return out


_TIME, _COUNT, _POSE, _TURNED, _SUMS, _TRACK = 0, 1, 4, 11, 14, 26  # parts of a track; its length


@compiled
def _is_pose(pose: Array) -> bool:
    near, square = True, 0.0
    for i in range(3):
        near &= abs(pose[i]) < FARTHEST
    for i in range(3, 7):
        square += pose[i] * pose[i]
    return near and abs(square - 1.0) < 1e-12


@compiled
def _are_finite(values: Array) -> bool:
    total = 0.0
    for value in values:
        total += abs(value)
    return math.isfinite(total)


@compiled
def _go(pose: Array, before: Array, reach: float, ways: Array) -> float:
    """Overwrite a pose by another; add to ways how far a point moves at most, and return it."""
    shift, turn = 0.0, 0.0
    for i in range(3):
        shift += (pose[i] - before[i]) ** 2
        turn += _turn(before, pose, i) ** 2
    way = math.sqrt(shift)
    if turn > 0.0:  # what has no end goes no way without it
        way += 2.0 * math.sqrt(turn) * reach
    for i in range(7):
        before[i] = pose[i]
    for k in range(ways.size):
        ways[k] += way
    return way


@compiled_part
def _turn(before: Array, pose: Array, i: int) -> float:
    """Return entry i of the vector part of the quaternion that leads from one pose to another."""
    j, k = (i + 1) % 3, (i + 2) % 3
    a, b = before[3:], pose[3:]
    entry: float = a[3] * b[i] - b[3] * a[i] - (b[j] * a[k] - b[k] * a[j])
    return entry


@compiled
def _follow(pose: Array, time: float, track: Array, velocity: Array) -> None:
    r"""Write the slope of the weighted least squares through the poses up to now.

    .. math:: \min_{x, \dot x} \sum_i e^{(t_i - t)/\tau} |x_i - x - (t_i - t) \dot x|^2
        + \sigma^2 |\dot x|^2

    Args:
        pose: position and quaternion (7,).
        time: t [s].
        track: time of the last one; sums of weights, of them times t_i - t, and its square; the
            last pose; how far it has turned; sums of weighted positions and turns, and of them
            times t_i - t.
        velocity: overwritten (6,).
    """
    step, turn, w = time - track[_TIME], np.empty(3), 0.0
    if track[_COUNT] == 0.0 or step < 0.0:
        track[:] = 0.0
        track[_POSE : _POSE + 7] = pose
        step = 0.0
    elif step == 0.0:
        return
    before = track[_POSE : _POSE + 7]
    for i in range(4):
        w += before[3 + i] * pose[3 + i]
    for i in range(3):
        turn[i] = _turn(before, pose, i)
    half = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    angle = 2.0 * math.atan2(half if w > 0.0 else -half, abs(w))
    track[_TIME] = time
    fade = math.exp(-step / _FADING)
    count, age, square = track[_COUNT], track[_COUNT + 1], track[_COUNT + 2]
    track[_COUNT + 2] = fade * (square - 2.0 * step * age + step * step * count)
    track[_COUNT + 1] = fade * (age - step * count)
    track[_COUNT] = fade * count + 1.0
    count, age, square = track[_COUNT], track[_COUNT + 1], track[_COUNT + 2]
    spread = square - age * age / count + _PRIOR
    for i in range(6):
        if i < 3:
            x = pose[i]
        else:
            if half > 0.0:
                track[_TURNED + i - 3] += angle / half * turn[i - 3]
            x = track[_TURNED + i - 3]
        both = track[_SUMS + i]
        track[_SUMS + 6 + i] = fade * (track[_SUMS + 6 + i] - step * both)
        track[_SUMS + i] = fade * both + x
        velocity[i] = (track[_SUMS + 6 + i] - age / count * track[_SUMS + i]) / spread
    for i in range(7):
        before[i] = pose[i]


@compiled
def _write_twists(pose: Array, velocity: Array, twists: Array) -> None:
    """Write for each pair the velocity (6,) of the body's point at the origin, and angular."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        moved = velocity[i] - (velocity[3 + j] * pose[k] - velocity[3 + k] * pose[j])
        for pair in range(twists.shape[0]):
            twists[pair, i], twists[pair, 3 + i] = moved, velocity[3 + i]
