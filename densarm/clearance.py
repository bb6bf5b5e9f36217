"""Clearance: signed distances of all geometry pairs and their joint-space gradients."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.changing_obstacles import ChangingObstacles
from densarm.distance_view import DistanceView
from densarm.errors import InvalidValueError, SceneChangedError
from densarm.obstacles import Obstacle, geometry_objects
from densarm.pair_gradients import write_pair_gradients
from densarm.scene import Scene

COAL_TOLERANCE = 1e-10
"""GJK and EPA tolerance [m]; at coal's default of 1e-6 gradients err by up to 4e-3."""

DISTANCE_TOLERANCE = 1e-7
"""Bound on the error of a computed distance that certificates subtract [m].

Above it the largest error measured, between hulls with faces nearly parallel, is 2e-8 m.
"""


@dataclass(frozen=True)
class ClearanceSample:
    """Clearance at one configuration."""

    distance: Array
    """Signed distance d_k of each pair (K,) [m]; negative in penetration."""
    gradient: Array
    """Gradient of each distance in the joint tangent space (K, nv) [m/rad or m/m]."""
    pairs: tuple[tuple[str, str], ...]
    """Names of the two bodies of each pair."""


class Clearance:
    """Signed distances d_k(q) between an arm and a scene, and of the arm to itself.

    With n_k the unit normal from body 1 to body 2 and p_k a nearest point, the gradient is

        ∂d_k/∂q = [n_k, p_k × n_k] · J(q) (S_2 - S_1),

    J the world-frame joint Jacobian and S_b the joints that move body b.

    Obstacles can be moved, added and removed between queries, at a cost that does not grow with
    the scene. Room for those to come is made beforehand: a spare obstacle stands for any of its
    shape and size, a spare sphere or capsule for those of any size. What finds no spare one needs
    a new clearance with more room and a new controller, which take milliseconds: made apart from
    the control loop, `change_to` brings them up to date between two steps.

    Args:
        arm: the arm; its collision model holds the self-collision pairs.
        scene: the obstacles. Shapes that no joint moves are not paired with them.
        spare: obstacles that are not there yet, at infinite distance until they are added.

    Raises:
        InvalidValueError: an obstacle is named like a shape of the arm or another obstacle, or
            the scene attaches bodies that the arm does not hold.
    """

    def __init__(self, arm: Arm, scene: Scene, spare: Iterable[Obstacle] = ()) -> None:
        self.arm = arm
        reserve = Scene([*scene, *spare], scene.attachments)
        self.geometry_model = _geometry_model(arm, reserve)
        self.geometry_data = self.geometry_model.createData()
        self._data = arm.model.createData()
        # A view that follows the data; Pinocchio drops the second axis of a single column.
        self._jacobian = self._data.J.reshape(6, arm.nv)
        for request in self.geometry_data.distanceRequests:
            request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE
        self.pair_shapes: NDArray[np.int64] = np.array(
            [(pair.first, pair.second) for pair in self.geometry_model.collisionPairs],
            dtype=np.int64,
        ).reshape(-1, 2)
        self.n_pairs = len(self.pair_shapes)
        self._obstacles = ChangingObstacles(self.geometry_model, self.pair_shapes, reserve)
        for obstacle in reserve.obstacles[len(scene) :]:
            self._obstacles.remove(obstacle.name)
        self.sign = self._joint_signs()
        """S_2 - S_1 (K, nv): how each joint moves body 2 of a pair against body 1."""
        self.distance: Array = np.zeros(self.n_pairs)
        """Distances that the last `update` found (K,) [m]; overwritten by the next."""
        self.gradient: Array = np.zeros((self.n_pairs, arm.nv))
        """Their gradients (K, nv); overwritten by the next `update`."""
        self._query(pin.neutral(arm.model))
        self._view = DistanceView(self.geometry_data)
        self._is_spare = np.zeros(self.n_pairs, bool)
        self._skip_spare_pairs()

    @property
    def scene(self) -> Scene:
        """The obstacles as they are now."""
        return self._obstacles.scene

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the two bodies of each pair; a spare obstacle goes by its last name."""
        return self._obstacles.pairs

    @property
    def changes(self) -> NDArray[np.int64]:
        """For each pair, the `version` that its obstacle is of, negative if it is spare (K,)."""
        return self._obstacles.changes

    @property
    def version(self) -> int:
        """Number of changes to the obstacles so far."""
        return self._obstacles.version

    def require_version(self, version: int) -> None:
        """Refuse what was computed before a change to the obstacles.

        Raises:
            SceneChangedError: `version` is not the present one.
        """
        if version != self._obstacles.version:
            raise SceneChangedError

    def move_obstacle(
        self, name: str, position: ArrayLike, orientation_xyzw: ArrayLike | None = None
    ) -> None:
        """Put an obstacle elsewhere.

        Args:
            name: of the obstacle.
            position: origin of its frame (3,) [m].
            orientation_xyzw: unit quaternion of its frame; None to leave it.

        Raises:
            UnknownNameError: no such obstacle.
            InvalidValueError: no pose.
        """
        self._obstacles.move(name, position, orientation_xyzw)

    def add_obstacle(self, obstacle: Obstacle) -> None:
        """Put an obstacle in the place of a spare one.

        Args:
            obstacle: of the shape and size of a spare one, or a sphere or capsule of any size.

        Raises:
            InvalidValueError: its name is taken, or there is no spare one for it.
        """
        self._obstacles.add(obstacle)
        self._skip_spare_pairs()

    def remove_obstacle(self, name: str) -> None:
        """Take an obstacle away; it is spare from then on.

        Args:
            name: of the obstacle.

        Raises:
            UnknownNameError: no such obstacle.
        """
        self._obstacles.remove(name)
        self._skip_spare_pairs()

    def change_to(self, scene: Scene) -> None:
        """Move, add and remove obstacles until they are those of a scene.

        It brings a clearance with more room, which was made meanwhile, up to date with the one
        that a control loop uses.

        Args:
            scene: the obstacles; its attached bodies are those of the clearance.

        Raises:
            InvalidValueError: other attached bodies, or no spare obstacle for one that is new;
                nothing is changed then.
        """
        self._obstacles.change_to(scene)
        self._skip_spare_pairs()

    def _skip_spare_pairs(self) -> None:
        is_spare = self.changes < 0
        for k in np.flatnonzero(is_spare != self._is_spare).tolist():
            if is_spare[k]:
                self.geometry_data.deactivateCollisionPair(k)
            else:
                self.geometry_data.activateCollisionPair(k)
        self._is_spare, self._has_spare = is_spare, bool(is_spare.any())

    def evaluate(self, q: ArrayLike) -> ClearanceSample:
        """Return distances and gradients at q.

        Args:
            q: configuration (nq,).

        Raises:
            InvalidValueError: q is not a configuration of the arm.
        """
        self.update(self.arm.check_configuration("configuration", q))
        return ClearanceSample(self.distance.copy(), self.gradient.copy(), self.pairs)

    def update(self, q: Array) -> None:
        """Compute `distance` and `gradient` in place at q (nq,), without checks or copies."""
        pin.computeJointJacobians(self.arm.model, self._data, q)
        pin.updateGeometryPlacements(
            self.arm.model, self._data, self.geometry_model, self.geometry_data
        )
        if self.n_pairs:
            pin.computeDistances(self.geometry_model, self.geometry_data)
            write_pair_gradients(
                self._view.read(), self._jacobian, self.sign, self.distance, self.gradient
            )
        if self._has_spare:
            self.distance[self._is_spare] = np.inf
            self.gradient[self._is_spare] = 0.0

    def distances(self, q: Array, pairs: NDArray[np.int64] | None = None) -> Array:
        """Return a new array of distances [m] at q (nq,), without gradients or checks.

        Args:
            q: configuration (nq,).
            pairs: indices of the pairs to compute; None for all, (K,).
        """
        self._query(q, pairs)
        distance = self._view.read()[:, 0]
        if self._has_spare:
            distance = np.where(self._is_spare, np.inf, distance)
        return distance.copy() if pairs is None else distance[pairs]

    def _query(self, q: Array, pairs: NDArray[np.int64] | None = None) -> None:
        model, data = self.geometry_model, self.geometry_data
        pin.updateGeometryPlacements(self.arm.model, self._data, model, data, q)
        if pairs is not None and len(pairs) < self.n_pairs:
            for k in pairs.tolist():
                pin.computeDistance(model, data, k)
        elif self.n_pairs:
            pin.computeDistances(model, data)

    def _joint_signs(self) -> Array:
        """Return S_2 - S_1 (K, nv): how each joint moves body 2 against body 1."""
        support = joint_support(self.arm.model)
        parents = np.array(
            [item.parentJoint for item in self.geometry_model.geometryObjects], dtype=np.int64
        )
        first, second = parents[self.pair_shapes[:, 0]], parents[self.pair_shapes[:, 1]]
        return support[second] - support[first]


def joint_support(model: pin.Model) -> Array:
    """Return S (njoints, nv): 1 where a velocity index moves a joint's frame, else 0."""
    support = np.zeros((model.njoints, model.nv))
    for joint in range(1, model.njoints):
        support[joint] = support[model.parents[joint]]
        support[joint, model.joints[joint].idx_v] = 1.0
    return support


def _geometry_model(arm: Arm, scene: Scene) -> pin.GeometryModel:
    for attachment in scene.attachments:
        if attachment not in arm.description.attachments:
            name, allowed = attachment.body.name, "held by the arm: arm.holding(*scene.attachments)"
            raise InvalidValueError("attached body", name, allowed)
    model = arm.collision_model.copy()
    moving = [k for k, item in enumerate(model.geometryObjects) if item.parentJoint > 0]
    for item in [item for obstacle in scene for item in geometry_objects(obstacle)]:
        if model.existGeometryName(item.name):
            allowed = f"other than the names of the shapes of {arm.name!r}"
            raise InvalidValueError("obstacle name", item.name, allowed)
        index = model.addGeometryObject(item)
        for k in moving:
            model.addCollisionPair(pin.CollisionPair(int(k), int(index)))
    return model
