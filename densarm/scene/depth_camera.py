"""Depth cameras: points of an image, and the image that a camera would have of a scene."""

from collections.abc import Iterable

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Obstacle, obstacle_pose
from densarm.scene.point_cloud import PointCloud
from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive_integer, unit_quaternion

_PARALLELS, _MERIDIANS = 17, 32  # of the polyhedron that a ball is seen as


def depth_points(depth: ArrayLike, intrinsics: ArrayLike) -> Array:
    r"""Return what a depth image saw, a row a pixel, in the frame of the camera.

    .. math:: x = (u - c_x) z / f_x, \qquad y = (v - c_y) z / f_y

    u counts columns and v rows; z points into the picture, x to the right and y down. The pose of
    that frame is the one to give a `PointCloud` of these points.

    Args:
        depth: z of each pixel (rows, columns) [m]; zero or not finite where nothing came back.
        intrinsics: [[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]] [pixels].

    Returns:
        Points (rows · columns, 3) [m], not a number where nothing came back.

    Raises:
        InvalidValueError: no image, or no such matrix.
    """
    z = np.asarray(depth, dtype=np.float64)
    if z.ndim != 2:
        raise InvalidValueError("depth", z.shape, "of shape (rows, columns)")
    z = np.where(np.isfinite(z) & (z > 0.0), z, np.nan)
    return np.asarray((_rays(intrinsics, z.shape) * z[..., np.newaxis]).reshape(-1, 3))


def depth_image(
    scene: Iterable[Obstacle],
    intrinsics: ArrayLike,
    shape: tuple[int, int],
    position: ArrayLike,
    orientation_xyzw: ArrayLike,
) -> Array:
    """Return the depth image that a camera would have of obstacles, without noise.

    Each pixel is the z of where a ray through its middle meets the first convex shape; balls and
    the ends of capsules are polyhedra, and clouds are not seen.

    Args:
        scene: the obstacles, where they are at time zero.
        intrinsics: as of `depth_points`.
        shape: numbers of rows and columns.
        position: of the camera's frame in the world (3,) [m]; z points into the picture.
        orientation_xyzw: unit quaternion of that frame.

    Returns:
        z [m] (rows, columns); zero where nothing is seen.

    Raises:
        InvalidValueError: no such matrix, shape or pose.
    """
    rows, columns = (positive_integer("shape", size) for size in shape)
    place = finite_vector("position", position, 3)
    turned = unit_quaternion("orientation_xyzw", orientation_xyzw)
    pose = pin.XYZQUATToSE3(np.array([*place, *turned]))
    rays = _rays(intrinsics, (rows, columns)).reshape(-1, 3)
    depth = np.full(len(rays), np.inf)
    for obstacle in (item for item in scene if not isinstance(item, PointCloud)):
        seen = pose.inverse() * obstacle_pose(obstacle)
        for convex in obstacle.convex_shapes():
            faces, middle, radius = _faces(convex)
            x = seen.act(middle)
            off = np.linalg.norm(np.cross(rays, x), axis=1)  # of the ray from the middle
            near = np.flatnonzero(off <= radius * np.linalg.norm(rays, axis=1))
            some, enters, leaves = rays[near], np.zeros(len(near)), np.full(len(near), np.inf)
            for normal, height in faces:
                turned = seen.rotation @ normal
                rate, above = some @ turned, height + float(turned @ seen.translation)
                with np.errstate(divide="ignore", invalid="ignore"):
                    at = above / rate
                enters = np.where(rate < 0.0, np.maximum(enters, at), enters)
                leaves = np.where(rate > 0.0, np.minimum(leaves, at), leaves)
                leaves = np.where((rate == 0.0) & (above < 0.0), -1.0, leaves)
            hit = (enters < leaves) & (enters > 0.0)
            depth[near] = np.where(hit, np.minimum(depth[near], enters), depth[near])
    return np.where(np.isfinite(depth), depth, 0.0).reshape(rows, columns)


def seen_points(
    scene: Iterable[Obstacle],
    intrinsics: ArrayLike,
    shape: tuple[int, int],
    position: ArrayLike,
    target: ArrayLike,
) -> Array:
    """Return the points that an upright camera would see of obstacles, in the world (N, 3) [m].

    Args:
        scene: the obstacles, as for `depth_image`.
        intrinsics: as of `depth_points`.
        shape: numbers of rows and columns.
        position: of the camera (3,) [m].
        target: what it looks at (3,) [m].

    Raises:
        InvalidValueError: as `depth_image`, or the camera looks at itself.
    """
    place, into = finite_vector("position", position, 3), finite_vector("target", target, 3)
    if not (far := float(np.linalg.norm(into - place))) > 0.0:
        raise InvalidValueError("target", target, "another place than the camera's")
    z = (into - place) / far
    right = np.cross(z, [0.0, 0.0, 1.0])
    if not right.any():
        right = np.array([0.0, -1.0, 0.0])
    x = right / np.linalg.norm(right)
    camera = pin.SE3(np.column_stack([x, np.cross(z, x), z]), place)
    depth = depth_image(scene, intrinsics, shape, place, pin.SE3ToXYZQUAT(camera)[3:])
    points = depth_points(depth, intrinsics)
    points = points[np.isfinite(points).all(axis=1)]
    return np.asarray(points @ camera.rotation.T + place)


def _rays(intrinsics: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Return the direction of each pixel, of which z is one (rows, columns, 3)."""
    k = finite_vector("intrinsics", np.ravel(intrinsics), 9).reshape(3, 3)
    rest = np.array([[k[0, 0], 0.0, k[0, 2]], [0.0, k[1, 1], k[1, 2]], [0.0, 0.0, 1.0]])
    if not (k[0, 0] > 0.0 and k[1, 1] > 0.0 and np.array_equal(k, rest)):
        raise InvalidValueError("intrinsics", k, "[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    v, u = np.indices(shape)
    return np.stack([(u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1], np.ones(shape)], axis=-1)


def _faces(shape: coal.CollisionGeometry) -> tuple[list[tuple[Array, float]], Array, float]:
    """Return normals out of a convex shape and n · x on its faces, and a ball around it."""
    from scipy.spatial import ConvexHull

    if isinstance(shape, coal.Halfspace):
        return [(np.array(shape.n), float(shape.d))], np.zeros(3), np.inf
    points, radius = extreme_points(shape)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    around = radius + float(np.linalg.norm(points - middle, axis=1).max())
    if radius > 0.0:
        points = (points[:, np.newaxis] + radius * _ball()).reshape(-1, 3)
    equations = np.unique(ConvexHull(points).equations, axis=0)
    return [(row[:3], -float(row[3])) for row in equations], middle, around


def _ball() -> Array:
    polar = np.linspace(0.0, np.pi, _PARALLELS)
    around = 2.0 * np.pi * np.arange(_MERIDIANS) / _MERIDIANS
    polar, around = (axis.ravel() for axis in np.meshgrid(polar, around))
    flat = np.sin(polar)
    return np.column_stack([flat * np.cos(around), flat * np.sin(around), np.cos(polar)])
