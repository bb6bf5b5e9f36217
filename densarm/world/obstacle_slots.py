"""ChangingObstacles: obstacles that are moved, added and removed in a geometry model that stays."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.errors import InvalidValueError, SceneChangedError, UnknownNameError
from densarm.scene.obstacles import Capsule, Obstacle, Sphere, obstacle_pose
from densarm.scene.scene import Scene
from densarm.values.arrays import Array


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
        """For each pair, the `version` that its obstacle is of, negative if it is spare (K,)."""
        self._shapes = list(geometry_model.geometryObjects)
        self._attachments = scene.attachments
        self._origin = origin
        self._spare: list[_Slot] = []
        self._present: dict[str, _Slot] = {}
        end = len(self._shapes) - sum(len(item.convex_shapes()) for item in scene)
        for obstacle in scene:
            begin, end = end, end + len(obstacle.convex_shapes())
            pairs = np.flatnonzero((pair_shapes >= begin) & (pair_shapes < end)) // 2
            self._present[obstacle.name] = _Slot(obstacle, self._shapes[begin:end], pairs)
        self._scene: Scene | None = None
        self._pairs: tuple[tuple[str, str], ...] | None = None

    @property
    def scene(self) -> Scene:
        """The obstacles as they are now."""
        if self._scene is None:
            self._scene = Scene((s.obstacle for s in self._present.values()), self._attachments)
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
        slot = self._slot(name)
        pose: dict[str, Any] = {"position": position}
        if orientation_xyzw is not None:
            pose["orientation_xyzw"] = orientation_xyzw
        self._fill(slot, replace(slot.obstacle, **pose))

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
        self._note(slot, 1)

    def _note(self, slot: "_Slot", sign: int) -> None:
        self.version += 1
        self.changes[slot.pairs] = sign * self.version
        self._scene = None


class _Slot:
    """The shapes of an obstacle in the geometry model, and the pairs that they are part of."""

    def __init__(
        self, obstacle: Obstacle, shapes: list[pin.GeometryObject], pairs: NDArray[np.int64]
    ) -> None:
        self.obstacle = obstacle
        self.shapes = shapes
        self.pairs = pairs

    def can_hold(self, obstacle: Obstacle) -> bool:
        if type(obstacle) is not type(self.obstacle):
            return False
        sizes = {item.name for item in fields(obstacle)} - {item.name for item in fields(Obstacle)}
        return isinstance(obstacle, Sphere | Capsule) or all(
            getattr(obstacle, size) == getattr(self.obstacle, size) for size in sizes
        )

    def hold(self, obstacle: Obstacle, origin: Array) -> None:
        self.obstacle = obstacle
        geometry = self.shapes[0].geometry
        if isinstance(obstacle, Sphere | Capsule):
            geometry.radius = obstacle.radius
        if isinstance(obstacle, Capsule):
            geometry.halfLength = 0.5 * obstacle.length
        pose, one = obstacle_pose(obstacle, origin), len(self.shapes) == 1
        for k, shape in enumerate(self.shapes):
            shape.placement = pose
            shape.name = obstacle.name if one else f"{obstacle.name}.{k}"
