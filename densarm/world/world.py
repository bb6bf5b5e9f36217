"""World: an arm among obstacles, the distances of all pairs of bodies, and how far they move."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.arms.dynamics import by_columns, holding_ratios, holding_torque
from densarm.arms.inverse_kinematics import InverseKinematics
from densarm.arms.pose import Pose
from densarm.errors import DensarmError, InvalidValueError
from densarm.scene.obstacles import Obstacle, geometry_objects
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, non_negative_integer, positive_integer
from densarm.values.documented import documented
from densarm.world.cloud_balls import nearest_ball
from densarm.world.distance_view import add_pair_gradients, pair_rates
from densarm.world.geometry_model import geometry_model
from densarm.world.lipschitz import joint_support, shape_lipschitz
from densarm.world.obstacle_slots import ChangingObstacles
from densarm.world.pair_queries import PairQueries

DISTANCE_TOLERANCE = 1e-7
"""Bound on the error of a computed distance that certificates subtract [m].

Above it the largest error measured, between hulls with faces nearly parallel, is 2e-8 m.
"""

_OVERLAP = 5e-3  # [m], above which a base does not just stand on something; UR's meshes go 3 mm in

_ENOUGH = 6  # times as many solutions as are asked for, after which no more are looked for
_APART = 0.1  # [rad or m] of some joint, between two ways to reach a pose

Pairs = NDArray[np.int64]
"""Indices of pairs (P,)."""


@documented
@dataclass(frozen=True)
class ClearanceSample:
    """Clearance at one configuration."""

    distance: Array
    """Signed distance d_k of each pair (K,) [m]; negative in penetration."""
    gradient: Array
    """Gradient of each distance in the joint tangent space (K, nv) [m/rad or m/m]."""
    rate: Array
    """∂d_k/∂t = n_k · w_k (K,) [m/s], by the velocity w_k of an obstacle's nearest point."""
    pairs: tuple[tuple[str, str], ...]
    """Names of the two bodies of each pair."""


@documented
@dataclass(frozen=True)
class NearestPair:
    """The two bodies that are nearest to each other at one configuration."""

    distance: float
    """Signed distance [m]."""
    points: Array
    """The point of each body nearest to the other (2, 3), in the world frame [m]."""
    names: tuple[str, str]
    """Names of the bodies."""


class World(ChangingObstacles):
    """An arm among obstacles: signed distances d_k(q) of every pair of bodies, itself included.

    With n_k the unit normal from body 1 to body 2 and p_k a nearest point, the gradient is

        ∂d_k/∂q = [n_k, p_k × n_k] · J(q) (S_2 - S_1),

    J the world-frame joint Jacobian and S_b the joints that move body b.

    Obstacles can be moved, added and removed between queries, at a cost that does not grow with
    the scene; `set_time` moves those with a motion, as `simulate` asks for. Room for those to come
    is made beforehand: a spare obstacle stands for any of its shape and size, a spare sphere or
    capsule for those of any size. What finds no spare one needs a new world with more of them and
    a new controller, which take milliseconds: made apart from the control loop, `change_to` brings
    them up to date between two steps.

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
        model, counts = geometry_model(arm, reserve)
        pair_shapes = [(pair.first, pair.second) for pair in model.collisionPairs]
        indices = np.array(pair_shapes, dtype=np.int64).reshape(-1, 2)
        super().__init__(model, arm.collision_model, indices, reserve, counts, arm.origin)
        self.n_pairs = len(pair_shapes)
        self._queries = PairQueries(arm.model, self, remembers=True)
        self._geometry_data, self._data = self._queries.data, arm.model.createData()
        # A view that follows the data; Pinocchio drops the second axis of a single column.
        self._jacobian = by_columns(self._data.J, (6, arm.nv))
        shapes = model.geometryObjects
        moves = joint_support(arm.model)[np.array([item.parentJoint for item in shapes], np.int64)]
        first, second = self.pair_shapes.T
        self.sign: Array = moves[second] - moves[first]
        """S_2 - S_1 (K, nv): how each joint moves body 2 of a pair against body 1."""
        self.shape_lipschitz: Array = shape_lipschitz(arm.model, shapes)
        """For each shape the bounds r_j of the joints that move it (S, nv), else 0 [m/rad or 1]."""
        apart = 1.0 - moves[first] * moves[second]
        self.lipschitz: Array = (self.shape_lipschitz[first] + self.shape_lipschitz[second]) * apart
        """Lipschitz constants r_kj of the distances (K, nv) [m/rad, 1 for prismatic joints].

        r_kj bounds, over all configurations within the position limits, the distance from the axis
        of joint j to any point of the body that it moves; 0 where it moves both bodies or neither.
        """
        for obstacle in reserve.obstacles[len(scene) :]:
            self.remove_obstacle(obstacle.name)
        self._is_spare, self._there = np.zeros(self.n_pairs, bool), np.arange(self.n_pairs)

    def __repr__(self) -> str:
        return f"World({self.arm}, {self.scene}, {self.n_pairs} pairs)"

    def clearance(self, q: ArrayLike) -> ClearanceSample:
        """Return the distances of all pairs and their gradients.

        Args:
            q: configuration (nq,).

        Raises:
            InvalidValueError: q is not a configuration of the arm.
        """
        q = self.arm.check_configuration("configuration", q)
        gradient = np.zeros((self.n_pairs, self.arm.nv))
        pin.computeJointJacobians(self.arm.model, self._data, q)
        rows = self._measured()
        add_pair_gradients(rows, self._jacobian, self.sign, gradient)
        gradient[self._is_spare] = 0.0
        distance = np.where(self._is_spare, np.inf, rows[:, 0])
        rate = np.where(self._is_spare, 0.0, pair_rates(rows, self.twist))
        return ClearanceSample(distance, gradient, rate, self.pairs)

    def distances(self, q: Array, pairs: Pairs | None = None) -> Array:
        """Return the distances alone, without checks.

        Args:
            q: configuration (nq,).
            pairs: indices of the pairs to compute; None for all.

        Returns:
            Distances (K,), or those of the pairs (P,) [m], in a new array.
        """
        rows = self.query(q, pairs)
        asked = slice(None) if pairs is None else pairs
        return np.where(self._is_spare[asked], np.inf, rows[asked, 0])

    def distances_within(self, q: Array, limit: float, pairs: Pairs | None = None) -> Array:
        """Return what `distances` does, of many thousands of pairs only as far as they matter.

        Those beyond a limit [m] may be lower bounds then, above the limit too.
        """
        if not self._queries.is_large:
            return self.distances(q, pairs)
        asked = np.arange(self.n_pairs) if pairs is None else pairs
        found = self.bounds(q, asked)
        is_near = found <= limit
        found[is_near] = self._measured(asked[is_near])[asked[is_near], 0]
        return found

    def bounds(self, q: Array, pairs: Pairs) -> Array:
        """Return lower bounds of the distances of pairs (P,), by balls around bodies [m]."""
        pin.forwardKinematics(self.arm.model, self._data, q)
        self._queries.place(self._data)
        found = self._queries.bounds(pairs)
        found[self.changes[pairs] < 0] = np.inf
        return found

    def query(self, q: Array, pairs: Pairs | None = None) -> Array:
        """Return what coal tells of pairs, without a copy and without checks.

        Args:
            q: configuration (nq,).
            pairs: indices of the pairs to ask for; None for all.

        Returns:
            Rows [distance, normal from body 1 to 2, nearest point of each] of all pairs (K, 10),
            new where asked for, points seen from `Arm.origin`; the next query overwrites them.
        """
        pin.forwardKinematics(self.arm.model, self._data, q)
        return self._measured(pairs)

    def nearest(self, q: Array) -> NearestPair | None:
        """Return the nearest two bodies at a configuration (nq,), None without pairs."""
        distance = self.distances(q)
        if not np.isfinite(distance).any():
            return None
        k = int(distance.argmin())
        points = self._queries.rows[k, 4:].reshape(2, 3) + self.arm.origin
        return NearestPair(float(distance[k]), points, self.pairs[k])

    def inverse_kinematics(
        self,
        pose: Pose,
        count: int = 8,
        seed: int = 0,
        *,
        near: ArrayLike | None = None,
        margin: float = 0.0,
    ) -> Array:
        """Return configurations that take a frame to a pose: clear, inside limits, nearest first.

        Obstacles are where they are now. Of an arm with more joints than the pose needs, ways of
        which one leads into another count as several where a joint differs by more than 0.1.

        Args:
            pose: where a frame shall be.
            count: configurations at most.
            seed: of the starts of the search; the same gives the same bits.
            near: configuration (nq,) to be near to, at which the search begins; None for the
                neutral one.
            margin: distance that every pair must exceed [m].

        Returns:
            Configurations (N, nq), 1 <= N <= count, at which the arm can be held too.

        Raises:
            UnknownNameError: no such frame.
            DensarmError: the pose is out of reach, or in collision, with how far and what.
        """
        arm, limits = self.arm, self.arm.limits
        if not isinstance(pose, Pose):
            raise InvalidValueError("pose", pose, "a densarm.Pose")
        if near is None:
            neutral = arm.configurations(np.clip(0.0, limits.lower, limits.upper))
            near = arm.postures.get("neutral", neutral)
        near = arm.check_configuration("near", near)
        non_negative("margin", margin)
        search = InverseKinematics(arm, pose)
        tried, found = np.empty((0, arm.nq)), list[Array]()
        enough = _ENOUGH * positive_integer("count", count)
        for used, ways in enumerate(search.solutions(near, non_negative_integer("seed", seed))):
            for q in ways:
                if (np.abs(arm.difference(tried, q)).max(axis=1) < _APART).any():
                    continue
                tried = np.vstack([tried, q])
                if self._keeps(q, margin) and holding_ratios(arm, q).max() <= 1.0:
                    found.append(q)
                    break
            if len(found) == count or (found and used > enough):
                break
        if not found:
            reason = self._fault(tried, margin) if len(tried) else search.shortfall()
            raise DensarmError(f"pose of {pose} {reason}")
        solutions = np.array(found)
        far = np.linalg.norm(arm.difference(near, solutions), axis=1)
        return np.asarray(solutions[np.argsort(far, kind="stable")])

    def _keeps(self, q: Array, margin: float) -> bool:
        """Return whether all pairs are farther apart than a margin [m] at q (nq,)."""
        whole = self.spare_is_known and not self.clouds and not self._queries.is_large
        if margin > 0.0 or not whole:
            return bool(self.distances_within(q, margin).min(initial=np.inf) > margin)
        # Takes a quarter of the time that distances take.
        model, data = self.geometry_model, self._geometry_data
        return not pin.computeCollisions(self.arm.model, self._data, model, data, q, True)

    def _fault(self, tried: Array, margin: float) -> str:
        """Return, as a phrase, what is wrong at the best of configurations (N, nq)."""
        distances = np.array([self.distances_within(q, margin) for q in tried]).reshape(
            len(tried), -1
        )
        least = distances.min(axis=1, initial=np.inf)
        best = int(least.argmax())
        gap, ways = 1e3 * float(least[best]), f"all {len(tried)} ways to reach it that were tried"
        if gap > 1e3 * margin:
            return f"cannot be held: {holding_torque(self.arm, tried[best])}"
        pair = " and ".join(self.pairs[int(distances[best].argmin())])
        how = f"overlap by {-gap:.3g} mm" if gap <= 0.0 else f"are {gap:.3g} mm apart"
        return f"is in collision in {ways}; where least {pair} {how}"

    def base_overlaps(self) -> tuple[str, ...]:
        """Return what the function of this name does, of the obstacles as they are now."""
        return base_overlaps(self.arm, self.scene)

    def motion_bound(self, step: Array, pairs: Pairs | None = None) -> Array:
        r"""Return how far the bodies of each pair move against each other at most [m].

        .. math:: \mu_k = \sum_j r_{kj} |\Delta q_j|

        Args:
            step: joint motions (..., nv) [rad or m], within the position limits.
            pairs: indices of the pairs to look at; None for all.

        Returns:
            Bounds (..., K), or (..., P) [m].
        """
        lipschitz = self.lipschitz if pairs is None else self.lipschitz[pairs]
        return np.asarray(np.abs(step) @ lipschitz.T)

    def _measured(self, pairs: Pairs | None = None) -> Array:
        """Return the rows of `DistanceView`, new for some pairs or all."""
        if not self.spare_is_known:
            self._skip_spare_pairs()
        self._queries.place(self._data)
        if pairs is not None and len(pairs) < self.n_pairs:
            self._queries.ask(pairs)
        elif not self._is_spare.all():
            self._queries.ask_active(self._there)
        return self._queries.rows

    def _skip_spare_pairs(self) -> None:
        is_spare, self.spare_is_known = self.changes < 0, True
        for k in np.flatnonzero(is_spare != self._is_spare).tolist():
            self._queries.activate(k, not is_spare[k])
        self._is_spare, self._there = is_spare, np.flatnonzero(~is_spare)


def base_overlaps(arm: Arm, scene: Scene) -> tuple[str, ...]:
    """Return which obstacles an arm's base is more than 5 mm inside of, a phrase each.

    The base is all that no joint moves. A world has no distance of it, since none would change: the
    arm stands in its table, or one of the two is not where it is said to be.
    """
    still = [item for item in arm.collision_model.geometryObjects if not item.parentJoint]
    found = []
    around = [(item, x) for item in scene for x in geometry_objects(item, origin=arm.origin)]
    for body, (obstacle, other) in product(still, around):
        is_cloud = isinstance(obstacle, PointCloud)
        pose = nearest_ball(obstacle, other.placement, body) if is_cloud else other.placement
        depth = -_distance(body, other.geometry, pose)
        if depth > _OVERLAP:
            found.append(f"{body.name!r} is in {other.name!r} by {1e3 * depth:.3g} mm")
    return tuple(found)


def _distance(body: pin.GeometryObject, shape: coal.CollisionGeometry, pose: pin.SE3) -> float:
    """Return the signed distance of a body that no joint moves from a shape at a pose [m]."""
    one, other = (coal.Transform3s(x.rotation, x.translation) for x in (body.placement, pose))
    # At coal's own tolerance of 1e-6 m: at tighter ones it may find no distance.
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(body.geometry, one, shape, other, request, result))
