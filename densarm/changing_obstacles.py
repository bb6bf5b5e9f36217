"""ChangingObstacles: moves, adds and removes obstacles inside a geometry model that stays."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.obstacles import Body, Capsule, Obstacle, Sphere, obstacle_pose
from densarm.scene import Scene


class ChangingObstacles:
    """The obstacles of a geometry model, present or spare, and what became of them.

    Args:
        geometry_model: holds the obstacles' shapes last, in their order.
        pair_shapes: indices of the two shapes of each pair (K, 2).
        scene: the obstacles, all of them present.
    """

    def __init__(
        self, geometry_model: pin.GeometryModel, pair_shapes: NDArray[np.int64], scene: Scene
    ) -> None:
        self._shapes = list(geometry_model.geometryObjects)
        self._pair_shapes = pair_shapes
        self._attachments = scene.attachments
        self._spare: list[_Slot] = []
        self._present: dict[str, _Slot] = {}
        begin = len(self._shapes) - sum(len(item.convex_shapes()) for item in scene)
        for obstacle in scene:
            end = begin + len(obstacle.convex_shapes())
            pairs = np.flatnonzero((pair_shapes >= begin) & (pair_shapes < end)) // 2
            self._present[obstacle.name] = _Slot(obstacle, self._shapes[begin:end], pairs)
            begin = end
        self.version = 1
        """Grows with every change."""
        self.changes: NDArray[np.int64] = np.full(len(pair_shapes), self.version)
        """For each pair, the version that its obstacle is of, negative if it is spare (K,)."""
        self._scene: Scene | None = None
        self._pairs: tuple[tuple[str, str], ...] | None = None

    @property
    def scene(self) -> Scene:
        """The obstacles that are present."""
        if self._scene is None:
            self._scene = Scene((s.obstacle for s in self._present.values()), self._attachments)
        return self._scene

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the two bodies of each pair."""
        if self._pairs is None:
            names = [item.name for item in self._shapes]
            self._pairs = tuple((names[i], names[j]) for i, j in self._pair_shapes)
        return self._pairs

    def move(self, name: str, position: ArrayLike, orientation_xyzw: ArrayLike | None) -> None:
        """Act as `Clearance.move_obstacle`."""
        slot = self._slot(name)
        pose: dict[str, Any] = {"position": position}
        if orientation_xyzw is not None:
            pose["orientation_xyzw"] = orientation_xyzw
        slot.place(_moved(slot.obstacle, pose))
        self._note(slot, 1)

    def add(self, obstacle: Obstacle) -> None:
        """Act as `Clearance.add_obstacle`."""
        slot = _room_for(obstacle, self._spare, self._names_but_of(self._spare))
        self._occupy(slot, obstacle)

    def remove(self, name: str) -> None:
        """Act as `Clearance.remove_obstacle`."""
        slot = self._slot(name)
        del self._present[name]
        self._spare.append(slot)
        self._note(slot, -1)

    def change_to(self, scene: Scene) -> None:
        """Act as `Clearance.change_to`."""
        if scene.attachments != self._attachments:
            raise InvalidValueError("attached bodies", scene.attachments, "those of the clearance")
        wanted = {item.name: item for item in scene}
        staying = {
            name: slot
            for name, slot in self._present.items()
            if name in wanted and slot.can_hold(wanted[name])
        }
        leaving = [slot for name, slot in self._present.items() if name not in staying]
        new = [item for item in scene if item.name not in staying]
        room = [*self._spare, *leaving]
        taken = self._names_but_of(room)
        found = []
        for obstacle in new:  # whatever is refused is refused before anything changes
            found.append(_room_for(obstacle, room, taken))
            room.remove(found[-1])
        for slot in leaving:
            self.remove(slot.obstacle.name)
        for slot, obstacle in zip(found, new, strict=True):
            self._occupy(slot, obstacle)
        for name, slot in staying.items():
            if slot.obstacle != wanted[name]:
                self._fill(slot, wanted[name])

    def _occupy(self, slot: "_Slot", obstacle: Obstacle) -> None:
        self._spare.remove(slot)
        self._present[obstacle.name] = slot
        self._pairs = None
        self._fill(slot, obstacle)

    def _fill(self, slot: "_Slot", obstacle: Obstacle) -> None:
        slot.resize(obstacle)
        slot.place(obstacle)
        self._note(slot, 1)

    def _slot(self, name: str) -> "_Slot":
        if name not in self._present:
            raise UnknownNameError("obstacle", name, self._present)
        return self._present[name]

    def _names_but_of(self, slots: "list[_Slot]") -> set[str]:
        """Return the names of all bodies but those in some slots."""
        others = {s.obstacle.name for s in self._present.values() if s not in slots}
        free = {item.name for slot in slots for item in slot.shapes}
        return others | ({item.name for item in self._shapes} - free)

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
        return isinstance(obstacle, Sphere | Capsule) or all(
            getattr(obstacle, key) == getattr(self.obstacle, key) for key in _sizes(obstacle)
        )

    def resize(self, obstacle: Obstacle) -> None:
        geometry = self.shapes[0].geometry
        if isinstance(obstacle, Sphere | Capsule):
            geometry.radius = obstacle.radius
        if isinstance(obstacle, Capsule):
            geometry.halfLength = 0.5 * obstacle.length

    def place(self, obstacle: Obstacle) -> None:
        self.obstacle = obstacle
        pose, one = obstacle_pose(obstacle), len(self.shapes) == 1
        for k, shape in enumerate(self.shapes):
            shape.placement = pose
            shape.name = obstacle.name if one else f"{obstacle.name}.{k}"


def _room_for(obstacle: Obstacle, slots: list[_Slot], taken: set[str]) -> _Slot:
    """Return the first slot that can hold a new obstacle, whose name must not be taken."""
    if obstacle.name in taken:
        raise InvalidValueError("obstacle name", obstacle.name, "not in use")
    for slot in slots:
        if slot.can_hold(obstacle):
            return slot
    kinds = ", ".join(sorted(type(slot.obstacle).__name__ for slot in slots))
    allowed = f"like a spare obstacle ({kinds or 'none left'}), or make a new Clearance"
    raise InvalidValueError("obstacle", obstacle, allowed)


def _moved(obstacle: Any, pose: dict[str, Any]) -> Obstacle:
    moved: Obstacle = replace(obstacle, **pose)
    return moved


def _sizes(obstacle: Any) -> set[str]:
    return {item.name for item in fields(obstacle)} - {item.name for item in fields(Body)}
