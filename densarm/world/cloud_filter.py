"""CloudFilter: takes out of a cloud what is the arm's own, or known already."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.arms.joint_space import pose_row
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import HalfSpace, Obstacle, obstacle_pose
from densarm.scene.point_cloud import PointCloud
from densarm.values.arrays import Array
from densarm.values.checks import non_negative
from densarm.values.kernels import compiled_beside
from densarm.world.hulls import Hulls, hulls_of, new_search, point_gap


class CloudFilter:
    """Takes points away that are near to the arm, what it holds, or in regions.

    A camera sees the arm too, and objects that stand for themselves in the scene, such as what is
    to be grasped or the table. Other threads go on while it works.

    Args:
        arm: its own shapes, bodies that it holds included, as distances are of.
        distance: from them, up to which a point is taken for one of the arm [m].
        regions: bodies, in the world frame, whose inside is left out.
        around: how far beyond the surface of a region that reaches [m].

    Raises:
        InvalidValueError: a negative distance, or a region that is a cloud.
    """

    def __init__(
        self,
        arm: Arm,
        distance: float = 0.03,
        regions: Sequence[Obstacle] = (),
        around: float = 0.0,
    ) -> None:
        self._arm = arm
        shapes = arm.collision_model.geometryObjects
        self._joints = [item.parentJoint for item in shapes]
        self._placements = [item.placement for item in shapes]
        self._names, self._reach = [arm.name] * len(shapes), list[float]()
        reach, geometry = non_negative("distance", distance), [item.geometry for item in shapes]
        self._reach += [reach] * len(shapes)
        self._floors: list[tuple[str, Array, float]] = []
        around = non_negative("around", around)
        for region in regions:
            if isinstance(region, PointCloud) or not isinstance(region, Obstacle):
                raise InvalidValueError("region", region, "an obstacle that is no cloud")
            pose = obstacle_pose(region)
            if isinstance(region, HalfSpace):
                normal = pose.rotation @ np.array(region.normal)
                height = region.offset + float(normal @ pose.translation) + around
                self._floors.append((region.name, normal, height))
                continue
            for shape in region.convex_shapes():
                geometry.append(shape)
                self._joints.append(-1)
                self._placements.append(pose)
                self._names.append(region.name)
                self._reach.append(around)
        self._hulls = hulls_of(geometry)
        self._data = arm.model.createData()
        self.taken: Mapping[str, int] = MappingProxyType({})
        """How many points the arm and each region took away from the last cloud, by name."""
        self.kept(arm.configurations(np.zeros(arm.nv)), np.zeros((1, 3)))  # compiled beforehand

    def kept(self, q: ArrayLike, points: ArrayLike, pose: pin.SE3 | None = None) -> Array:
        """Return the points that stay, and those alone that are finite.

        Args:
            q: configuration that the arm had when they were seen (nq,).
            points: in the cloud's frame (N, 3) [m].
            pose: of that frame in the world; None for the world's own.

        Raises:
            InvalidValueError: q is no configuration, or no points.
        """
        arm = self._arm
        q = arm.check_configuration("configuration", q)
        points = np.ascontiguousarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise InvalidValueError("points", points.shape, "of shape (N, 3)")
        pin.forwardKinematics(arm.model, self._data, q)
        base = pin.SE3(np.eye(3), arm.origin)
        rows = np.array(
            [
                pose_row(base * self._data.oMi[joint] * placement if joint >= 0 else placement)
                for joint, placement in zip(self._joints, self._placements, strict=True)
            ]
        )
        seen = pose or pin.SE3.Identity()
        taker = _takers(points, pose_row(seen), self._hulls, rows, np.array(self._reach))
        taken = dict.fromkeys([*self._names, *(name for name, _, _ in self._floors)], 0)
        for k, name in enumerate(self._names):
            taken[name] += int(np.count_nonzero(taker == k))
        for name, normal, height in self._floors:
            heights = points @ (seen.rotation.T @ normal) + normal @ seen.translation
            below = (taker == _NONE) & (heights <= height)
            taken[name] += int(np.count_nonzero(below))
            taker[below] = len(self._names)
        self.taken = MappingProxyType(taken)
        return np.asarray(points[taker == _NONE])


_NONE, _LOST = -1, -2


@compiled_beside
def _takers(
    points: Array, cloud: Array, hulls: Hulls, poses: Array, reach: Array
) -> NDArray[np.int64]:
    """Return which hull is the first to take each point (N,), -1 for none, -2 where not finite.

    Args:
        points: in the frame of their cloud (N, 3) [m].
        cloud: its pose in the world (12,).
        hulls: the hulls.
        poses: of them in the world (S, 12).
        reach: of each hull (S,) [m].
    """
    takers, search = np.full(points.shape[0], _NONE), new_search()
    world, x = np.empty(3), np.empty(3)
    for n in range(points.shape[0]):
        if not abs(points[n, 0]) + abs(points[n, 1]) + abs(points[n, 2]) < np.inf:
            takers[n] = _LOST
            continue
        for r in range(3):
            world[r] = cloud[9 + r]
            for c in range(3):
                world[r] += cloud[3 * r + c] * points[n, c]
        for body in range(poses.shape[0]):
            far, limit = 0.0, reach[body] + hulls.radius[body]
            for c in range(3):
                x[c] = 0.0
                for r in range(3):
                    x[c] += poses[body, 3 * r + c] * (world[r] - poses[body, 9 + r])
                low, high = hulls.boxes[body, c], hulls.boxes[body, 3 + c]
                far = max(far, low - x[c], x[c] - high)
            if far > limit:
                continue
            start = hulls.first[body, 0]
            gap, _ = point_gap(hulls.points, hulls.edges, start, x, limit, 0.0, search)
            if gap <= limit:
                takers[n] = body
                break
    return takers
