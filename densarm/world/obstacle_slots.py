"""ChangingObstacles: obstacles that are moved, added and removed in a geometry model that stays."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.errors import InvalidValueError, SceneChangedError, UnknownNameError
from densarm.scene.obstacles import Obstacle
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.values.checks import finite_number, non_negative
from densarm.world.hulls import Hulls, hulls_of
from densarm.world.placed_obstacle import (
    PlacedObstacle,
    checked_velocity,
    enclosing_ball,
)

_LONGEST_WAY = 1e4  # [m], beyond which sums of small steps would round off too much


class ChangingObstacles:
    """The obstacles of a geometry model, present or spare, and what became of them.

    Args:
        geometry_model: holds the obstacles' shapes last, in their order.
        links: its other shapes alone, which the joints move.
        pair_shapes: indices of the two shapes of each pair (K, 2).
        scene: the obstacles, all of them present.
        counts: how many shapes each of them has.
        origin: point of the world that is the origin of the geometry model (3,) [m].
    """

    def __init__(
        self,
        geometry_model: pin.GeometryModel,
        links: pin.GeometryModel,
        pair_shapes: NDArray[np.int64],
        scene: Scene,
        counts: Sequence[int],
        origin: Array,
    ) -> None:
        self.geometry_model, self.links = geometry_model, links
        self.pair_shapes = pair_shapes
        """Indices of the two shapes of each pair (K, 2) in the geometry model."""
        self.version = 1
        """Number of changes to the obstacles so far, and one."""
        self.changes: NDArray[np.int64] = np.full(len(pair_shapes), self.version)
        """For each pair, the `version` that its obstacle came with, negative if spare (K,)."""
        self.obstacle_way: Array = np.zeros(len(pair_shapes))
        """How far a point of each pair's obstacle has moved at most since it came (K,) [m]."""
        self.has_motion: NDArray[np.bool_] = np.zeros(len(pair_shapes), bool)
        """Whether each pair's obstacle has a motion (K,)."""
        self.twist: Array = np.zeros((len(pair_shapes), 6))
        """Velocity of each pair's obstacle (K, 6): of its point at `Arm.origin` [m/s], and angular
        [rad/s], both in the world frame."""
        self._shapes = list(geometry_model.geometryObjects)
        self.balls: Array = np.array([enclosing_ball(item.geometry) for item in self._shapes])
        """Balls around all shapes (S, 4), in their frames: middle, and radius, which is infinite
        for what has no end, and for clouds, of which a shape is one point [m]."""
        self.spare_is_known = False
        """Whether those who skip spare pairs know of the last one."""
        self._attachments = scene.attachments
        self._origin = np.append(origin, np.zeros(4))  # of poses
        self._spare: list[PlacedObstacle] = []
        self._present: dict[str, PlacedObstacle] = {}
        self.clouds: list[PlacedObstacle] = []
        """Those that are point clouds, present or spare."""
        end = len(self._shapes) - sum(counts)
        # Pairs are in the order of the obstacles' shapes.
        last = np.maximum.accumulate(pair_shapes.max(axis=1, initial=-1))
        for obstacle, count in zip(scene, counts, strict=True):
            begin, end = end, end + count
            pairs = slice(*np.searchsorted(last, [begin, end]).tolist())
            own = self.obstacle_way[pairs], self.twist[pairs], self.balls[begin:end]
            slot = PlacedObstacle(self._shapes[begin:end], pairs, *own)
            slot.hold(obstacle, self._origin)
            self.has_motion[pairs] = obstacle.motion is not None
            self._present[obstacle.name] = slot
            if isinstance(obstacle, PointCloud):
                self.clouds.append(slot)
        self._moving: list[PlacedObstacle] | None = None
        self._scene: Scene | None = None
        self._pairs: tuple[tuple[str, str], ...] | None = None

    @cached_property
    def link_hulls(self) -> Hulls:
        """The hulls of the shapes up to the last that a cloud is paired with."""
        facing = np.concatenate([self.pair_shapes[slot.pairs, 0] for slot in self.clouds])
        return hulls_of([item.geometry for item in self._shapes[: facing.max(initial=0) + 1]])

    @property
    def scene(self) -> Scene:
        """The obstacles as they are now; those with a motion as it has them at time zero."""
        if self._scene is None:
            now = (slot.present() for slot in self._present.values())
            self._scene = Scene(now, self._attachments)
        return self._scene

    def predicted(self, ahead: float) -> Scene:
        """Return the obstacles at rest where they will be, if they go on as they do now.

        Args:
            ahead: in how long [s].

        Raises:
            InvalidValueError: a time that is negative or not finite.
        """
        ahead = non_negative("ahead", ahead)
        there = (slot.after(ahead, self._origin) for slot in self._present.values())
        return Scene(there, self._attachments)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the two bodies of each pair; a spare obstacle goes by its last name."""
        if self._pairs is None:
            names = [item.name for item in self._shapes]
            self._pairs = tuple((names[i], names[j]) for i, j in self.pair_shapes)
        return self._pairs

    def pair_names(self, pair: int) -> tuple[str, str]:
        """Return the names of the two bodies of one pair, as `pairs` has them."""
        first, second = self.pair_shapes[pair]
        return self._shapes[first].name, self._shapes[second].name

    def require_version(self, version: int) -> None:
        """Refuse what was computed before a change to the obstacles.

        Raises:
            SceneChangedError: `version` is not the present one.
        """
        if version != self.version:
            raise SceneChangedError

    def move_obstacle(
        self,
        name: str,
        position: ArrayLike,
        orientation_xyzw: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        *,
        time: float | None = None,
    ) -> None:
        """Put an obstacle elsewhere; at every step of a control loop, if need be.

        Controllers go on with the distances there are then; what was proved of paths and plans
        holds no longer. A motion of its own ends with it.

        Args:
            name: of the obstacle.
            position: origin of its frame (3,) [m].
            orientation_xyzw: unit quaternion of its frame; None to leave it.
            velocity: of that origin (3,) [m/s], or of that and angular [rad/s] (6,), which it has
                until the next move. None for the least-squares slope of the moves with times,
                older ones fading within 50 ms, or for zero without a time.
            time: when it was there [s].

        Raises:
            UnknownNameError: no such obstacle.
            InvalidValueError: no pose, no velocity, or no time.
        """
        slot = self._slot(name)
        if velocity is not None:
            velocity = checked_velocity(velocity)
        if time is not None:
            time = finite_number("time", time)
        told = slot.checked_pose(position, orientation_xyzw)
        slot.told, self._scene = told, None
        if slot.obstacle.motion is not None:
            slot.obstacle, self._moving = slot.present(), None
            self.has_motion[slot.pairs] = False
        self._put(slot, told, velocity, time)

    def update_cloud(self, name: str, points: ArrayLike) -> None:
        """Put other points in the place of a cloud's, as its camera sees them now.

        It may be called in a thread of its own while a control loop runs: the new points are ready
        before the loop hears of them, which then asks for the distances of all links anew.

        Args:
            name: of the cloud.
            points: in the cloud's frame, which stays where it is (N, 3) [m].

        Raises:
            UnknownNameError: no such obstacle.
            InvalidValueError: it is no cloud, or as of a `PointCloud`; the old points stay then.
        """
        slot = self._slot(name)
        if not isinstance(slot.obstacle, PointCloud):
            raise InvalidValueError("obstacle", name, "a point cloud")
        cloud = replace(slot.obstacle, points=points, path="")
        _ = cloud.tree, cloud.reach  # made before anybody waits for them
        slot.become(cloud)
        self.version += 1
        self.changes[slot.pairs] = self.version
        self._scene = None

    def set_time(self, time: float) -> None:
        """Put every obstacle with a motion where it is at a time [s], its velocity told."""
        for slot in self._moving_slots():
            pose = pin.SE3ToXYZQUAT(slot.obstacle.pose_at(time))
            self._put(slot, pose, slot.obstacle.velocity_at(time), None)

    def obstacle_velocity(self, name: str) -> Array:
        """Return the velocity of an obstacle, as it was told or estimated last.

        Args:
            name: of the obstacle.

        Returns:
            That of its frame's origin [m/s], and angular [rad/s], in the world frame (6,).

        Raises:
            UnknownNameError: no such obstacle.
        """
        return self._slot(name).velocity.copy()

    def obstacle_pose(self, name: str) -> Array:
        """Return where an obstacle is: x y z [m] and quaternion x y z w (7,); else as above."""
        return self._slot(name).pose + self._origin

    def unseen(self, time: float, longest: float) -> tuple[str, ...]:
        """Return the names of obstacles whose stream of poses has stopped.

        Those are moved with a time, and were so last more than `longest` before `time` [s]. Where
        they are is not known any more: a supervisor should stop the arm.
        """
        return tuple(n for n, slot in self._present.items() if time - slot.seen_at > longest)

    def motion_way(self, begin: float, end: float) -> Array:
        """Return how far a point of each pair's obstacle goes at most between two times [s].

        That is by the motions of obstacles, along which `set_time` puts them: (K,) [m].
        """
        way = np.zeros(len(self.pair_shapes))
        for slot in self._moving_slots():
            way[slot.pairs] = (end - begin) * slot.obstacle.speed_bound(begin, end)
        return way

    @property
    def fastest_obstacle(self) -> float:
        """Bound on the speed of all points of obstacles, by their motions [m/s]."""
        speeds = [s.obstacle.speed_bound(-math.inf, math.inf) for s in self._moving_slots()]
        return max(speeds, default=0.0)

    def add_obstacle(self, obstacle: Obstacle) -> None:
        """Put an obstacle in the place of a spare one.

        Args:
            obstacle: of the shape and size of a spare one, or a sphere or capsule of any size.

        Raises:
            InvalidValueError: its name is taken, or there is no spare one for it.
        """
        self._occupy(self._slots_for([obstacle], self._spare)[0], obstacle)

    def remove_obstacle(self, name: str) -> None:
        """Take an obstacle away; it is spare from then on.

        Args:
            name: of the obstacle.

        Raises:
            UnknownNameError: no such obstacle.
        """
        slot = self._slot(name)
        del self._present[name]
        self._spare.append(slot)
        self._note(slot, -1)

    def change_to(self, scene: Scene) -> None:
        """Move, add and remove obstacles until they are those of a scene.

        It brings a world with more spare obstacles, which was made meanwhile, up to date with the
        one that a control loop uses.

        Args:
            scene: the obstacles; its attached bodies are those of the world.

        Raises:
            InvalidValueError: other attached bodies, or no spare obstacle for one that is new;
                nothing is changed then.
        """
        if scene.attachments != self._attachments:
            raise InvalidValueError("attached bodies", scene.attachments, "those of the world")
        wanted = {item.name: item for item in scene}
        staying = {
            name: slot
            for name, slot in self._present.items()
            if name in wanted and slot.can_hold(wanted[name])
        }
        leaving = [slot for name, slot in self._present.items() if name not in staying]
        new = [item for item in scene if item.name not in staying]
        slots = self._slots_for(new, [*self._spare, *leaving])
        for slot in leaving:
            self.remove_obstacle(slot.obstacle.name)
        for slot, obstacle in zip(slots, new, strict=True):
            self._occupy(slot, obstacle)
        for name, slot in staying.items():
            if slot.present() != wanted[name]:
                self._fill(slot, wanted[name])

    def _moving_slots(self) -> list[PlacedObstacle]:
        if self._moving is None:
            there = self._present.values()
            self._moving = [slot for slot in there if slot.obstacle.motion is not None]
        return self._moving

    def _slot(self, name: str) -> PlacedObstacle:
        if name not in self._present:
            raise UnknownNameError("obstacle", name, self._present)
        return self._present[name]

    def _slots_for(self, new: list[Obstacle], free: list[PlacedObstacle]) -> list[PlacedObstacle]:
        """Return a free slot for each new obstacle, whose name no other body may have."""
        free_shapes = {item.name for slot in free for item in slot.shapes}
        taken = {item.name for item in self._shapes} - free_shapes
        taken |= {slot.obstacle.name for slot in self._present.values() if slot not in free}
        left, found = list(free), []
        for obstacle in new:
            if obstacle.name in taken:
                raise InvalidValueError("obstacle name", obstacle.name, "not in use")
            slot = next((slot for slot in left if slot.can_hold(obstacle)), None)
            if slot is None:
                kinds = ", ".join(sorted(type(slot.obstacle).__name__ for slot in left))
                allowed = f"like a spare obstacle ({kinds or 'none left'}), or make a new World"
                raise InvalidValueError("obstacle", obstacle, allowed)
            left.remove(slot)
            found.append(slot)
        return found

    def _occupy(self, slot: PlacedObstacle, obstacle: Obstacle) -> None:
        self._spare.remove(slot)
        self._present[obstacle.name] = slot
        self._pairs = None
        self._fill(slot, obstacle)

    def _fill(self, slot: PlacedObstacle, obstacle: Obstacle) -> None:
        slot.hold(obstacle, self._origin)
        self.has_motion[slot.pairs] = obstacle.motion is not None
        self._note(slot, 1)

    def _put(
        self, slot: PlacedObstacle, pose: Array, velocity: Array | None, time: float | None
    ) -> None:
        """Put an obstacle at a pose in the world (7,), of a velocity, or at a time."""
        way = slot.put(pose - self._origin, velocity, time)
        if way > 0.0:
            self.version += 1
            if not slot.gone < _LONGEST_WAY:
                slot.gone = self.obstacle_way[slot.pairs] = 0.0
                self.changes[slot.pairs] = self.version

    def _note(self, slot: PlacedObstacle, sign: int) -> None:
        self.version += 1
        self.changes[slot.pairs] = sign * self.version
        self.spare_is_known = False
        self._scene = self._moving = None
