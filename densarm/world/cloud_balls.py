"""CloudBalls: the balls that stand for clouds, each where its cloud is nearest to a link."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.scene.point_cloud import PointCloud
from densarm.world.cloud_search import place_balls
from densarm.world.distance_view import shape_positions, shape_rotations
from densarm.world.hulls import hulls_of
from densarm.world.obstacle_slots import ChangingObstacles


class CloudBalls:
    """Puts a ball where a cloud is nearest, for the pair of a cloud and a link.

    With the ball there, the pair's distance is that of the cloud, and so is its gradient where one
    point alone is nearest.

    Args:
        obstacles: the pairs and the clouds.
        data: placements of the shapes, written to.
    """

    def __init__(self, obstacles: ChangingObstacles, data: pin.GeometryData) -> None:
        self._clouds, self._pair_shapes = obstacles.clouds, obstacles.pair_shapes
        self._hulls = obstacles.link_hulls
        self._data = data  # owns the memory that the views write to
        self._views = shape_positions(data), shape_rotations(data)

    def place(self, pairs: NDArray[np.int64]) -> None:
        """Place the balls of some of all pairs (P,), where the data has the links."""
        for slot in self._clouds:
            cloud, pose = slot.obstacle, slot.pose
            if isinstance(cloud, PointCloud):
                own = (slot.pairs.start, slot.pairs.stop or 0)
                place_balls(
                    cloud.tree, pose, self._hulls, self._pair_shapes, pairs, own, *self._views
                )


def nearest_ball(cloud: PointCloud, pose: pin.SE3, body: pin.GeometryObject) -> pin.SE3:
    """Return where the ball of a cloud at a pose is that is nearest to a body that stands."""
    places, turns = np.zeros((2, 3)), np.zeros((2, 3, 3))
    places[0], turns[0] = body.placement.translation, body.placement.rotation
    hull, pair = hulls_of([body.geometry]), np.array([[0, 1]])
    place_balls(
        cloud.tree, pin.SE3ToXYZQUAT(pose), hull, pair, np.zeros(1, np.int64), (0, 1), places, turns
    )
    return pin.SE3(np.eye(3), places[1])
