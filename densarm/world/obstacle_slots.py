"""ChangingObstacles: obstacles that are moved, added and removed in a geometry model that stays."""

import math
from dataclasses import fields, replace
from typing import Any, TypeGuard

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.errors import InvalidValueError, SceneChangedError, UnknownNameError
from densarm.scene.obstacles import Capsule, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.scene.shapes import FARTHEST
from densarm.values.arrays import Array
from densarm.values.checks import finite_number, finite_vector
from densarm.values.kernels import compiled, compiled_part

_FADING = 0.05  # [s], in which a pose counts for the velocity by a factor e less
_PRIOR = 2.5e-5  # [s²], by poses that err by 5 mm and velocities of 1 m/s
_LONGEST_WAY = 1e4  # [m], beyond which sums of small steps would round off too much


class ChangingObstacles:
    """The obstacles of a geometry model, present or spare, and what became of them.

    Args:
        geometry_model: holds the obstacles' shapes last, in their order.
        pair_shapes: indices of the two shapes of each pair (K, 2).
        scene: the obstacles, all of them present.
        origin: point of the world that is the origin of the geometry model (3,) [m].
    """

    def __init__(
        self,
        geometry_model: pin.GeometryModel,
        pair_shapes: NDArray[np.int64],
        scene: Scene,
        origin: Array,
    ) -> None:
        self.geometry_model = geometry_model
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
        self.spare_is_known = False
        """Whether those who skip spare pairs know of the last one."""
        self._attachments = scene.attachments
        self._origin = np.append(origin, np.zeros(4))  # of poses
        self._spare: list[_Slot] = []
        self._present: dict[str, _Slot] = {}
        end = len(self._shapes) - sum(len(item.convex_shapes()) for item in scene)
        for obstacle in scene:
            begin, end = end, end + len(obstacle.convex_shapes())
            own = np.flatnonzero((pair_shapes >= begin) & (pair_shapes < end)) // 2
            pairs = slice(own[0], own[-1] + 1) if own.size else slice(0)
            ways, twists = self.obstacle_way[pairs], self.twist[pairs]
            slot = _Slot(self._shapes[begin:end], pairs, ways, twists)
            slot.hold(obstacle, self._origin)
            self.has_motion[pairs] = obstacle.motion is not None
            self._present[obstacle.name] = slot
        self._moving: list[_Slot] | None = None
        self._scene: Scene | None = None
        self._pairs: tuple[tuple[str, str], ...] | None = None

    @property
    def scene(self) -> Scene:
        """The obstacles as they are now; those with a motion as it has them at time zero."""
        if self._scene is None:
            now = (slot.present() for slot in self._present.values())
            self._scene = Scene(now, self._attachments)
        return self._scene

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the two bodies of each pair; a spare obstacle goes by its last name."""
        if self._pairs is None:
            names = [item.name for item in self._shapes]
            self._pairs = tuple((names[i], names[j]) for i, j in self.pair_shapes)
        return self._pairs

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
            velocity = _checked_velocity(velocity)
        if time is not None:
            time = finite_number("time", time)
        told = slot.checked_pose(position, orientation_xyzw)
        slot.told, self._scene = told, None
        if slot.obstacle.motion is not None:
            slot.obstacle, self._moving = slot.present(), None
            self.has_motion[slot.pairs] = False
        self._put(slot, told, velocity, time)

    def set_time(self, time: float) -> None:
        """Put every obstacle with a motion where it is at a time [s], its velocity told."""
        if self._moving is None:
            there = self._present.values()
            self._moving = [slot for slot in there if slot.obstacle.motion is not None]
        for slot in self._moving:
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

    def motion_way(self, begin: float, end: float) -> Array:
        """Return how far a point of each pair's obstacle goes at most between two times [s].

        That is by the motions of obstacles, along which `set_time` puts them: (K,) [m].
        """
        way = np.zeros(len(self.pair_shapes))
        for slot in self._present.values():
            way[slot.pairs] = (end - begin) * slot.obstacle.speed_bound(begin, end)
        return way

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
            if slot.obstacle != wanted[name]:
                self._fill(slot, wanted[name])

    def _slot(self, name: str) -> "_Slot":
        if name not in self._present:
            raise UnknownNameError("obstacle", name, self._present)
        return self._present[name]

    def _slots_for(self, new: list[Obstacle], free: "list[_Slot]") -> "list[_Slot]":
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

    def _occupy(self, slot: "_Slot", obstacle: Obstacle) -> None:
        self._spare.remove(slot)
        self._present[obstacle.name] = slot
        self._pairs = None
        self._fill(slot, obstacle)

    def _fill(self, slot: "_Slot", obstacle: Obstacle) -> None:
        slot.hold(obstacle, self._origin)
        self.has_motion[slot.pairs] = obstacle.motion is not None
        self._note(slot, 1)

    def _put(self, slot: "_Slot", pose: Array, velocity: Array | None, time: float | None) -> None:
        """Put an obstacle at a pose in the world (7,), of a velocity, or at a time."""
        way = slot.put(pose - self._origin, velocity, time)
        if way > 0.0:
            self.version += 1
            if not slot.gone < _LONGEST_WAY:
                slot.gone = self.obstacle_way[slot.pairs] = 0.0
                self.changes[slot.pairs] = self.version

    def _note(self, slot: "_Slot", sign: int) -> None:
        self.version += 1
        self.changes[slot.pairs] = sign * self.version
        self.spare_is_known = False
        self._scene = self._moving = None


class _Slot:
    """The shapes of an obstacle in the geometry model, and the pairs that they are part of.

    Args:
        shapes: its shapes.
        pairs: where the pairs are among all.
        ways: their part of `ChangingObstacles.obstacle_way`, written to.
        twists: and of `ChangingObstacles.twist`.
    """

    obstacle: Obstacle

    def __init__(
        self, shapes: list[pin.GeometryObject], pairs: slice, ways: Array, twists: Array
    ) -> None:
        self.shapes = shapes
        self.pairs = pairs
        self._ways, self._twists = ways, twists
        self.gone = 0.0
        """As the ways [m]."""
        self._pose = np.zeros(7)  # x y z and quaternion, seen from the model's origin
        self.velocity = np.zeros(6)
        self.told: Array | None = None
        """Pose in the world that it was moved to; None if it is that of the obstacle."""
        self._track = np.zeros(_TRACK)

    def can_hold(self, obstacle: Obstacle) -> bool:
        if type(obstacle) is not type(self.obstacle):
            return False
        sizes = {item.name for item in fields(obstacle)} - {item.name for item in fields(Obstacle)}
        return isinstance(obstacle, Sphere | Capsule) or all(
            getattr(obstacle, size) == getattr(self.obstacle, size) for size in sizes
        )

    def hold(self, obstacle: Obstacle, origin: Array) -> None:
        self.obstacle, self.told, self._reach = obstacle, None, obstacle.reach
        geometry = self.shapes[0].geometry
        if isinstance(obstacle, Sphere | Capsule):
            geometry.radius = obstacle.radius
        if isinstance(obstacle, Capsule):
            geometry.halfLength = 0.5 * obstacle.length
        one = len(self.shapes) == 1
        for k, shape in enumerate(self.shapes):
            shape.name = obstacle.name if one else f"{obstacle.name}.{k}"
        pose = np.array([*obstacle.position, *obstacle.orientation_xyzw])
        self.put(pose - origin, obstacle.velocity_at(0.0), None)
        self.gone = self._ways[:] = 0.0

    def present(self) -> Obstacle:
        """Return the obstacle where it was moved to."""
        if self.told is not None:
            *position, x, y, z, w = self.told.tolist()
            pose = {"position": position, "orientation_xyzw": (x, y, z, w)}
            self.obstacle, self.told = replace(self.obstacle, **pose, motion=None), None
        return self.obstacle

    def checked_pose(self, position: ArrayLike, orientation_xyzw: ArrayLike | None) -> Array:
        """Return a pose (7,) in the world, turned as it is if by None; errors as of an obstacle."""
        turned: Any = self._pose[3:] if orientation_xyzw is None else orientation_xyzw
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
        way = _go(pose, self._pose, self._reach, self._ways)
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


def _is_vector(value: object, size: int) -> TypeGuard[Array]:
    return isinstance(value, np.ndarray) and value.shape == (size,) and value.dtype == np.float64


def _checked_velocity(value: ArrayLike) -> Array:
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
