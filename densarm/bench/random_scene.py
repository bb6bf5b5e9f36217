"""RandomScene: obstacles around an arm in proportion to its reach, and where to move among them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.bench.workspace import Workspace
from densarm.scene import Box, Scene, Sphere

_BODIES = (3, 8)  # spheres or boxes in a scene, the last number not included
# Lengths are in units of the reach.
_BOARD = 0.02  # thickness of boards
_NEAREST = 0.5  # of the middle of spheres and boxes to the first joint, which they would block
_WIDE = 1.2  # half of a wall's width and height


@dataclass(frozen=True)
class Region:
    """A box that stands upright in front of an arm.

    Coordinates are forward, to the left and up, from a point of the arm.
    """

    origin: Array
    """That point (3,) [m]."""
    forward: Array
    """Horizontal direction (3,), of length one."""
    low: Array
    """Lowest coordinates (3,) [m]."""
    high: Array
    """Highest coordinates (3,) [m]."""

    @property
    def axes(self) -> Array:
        """Forward, left and up as rows (3, 3)."""
        up = np.array([0.0, 0.0, 1.0])
        return np.array([self.forward, np.cross(up, self.forward), up])

    def contains(self, x: Array) -> bool:
        """Return whether a point (3,) is inside."""
        at = self.axes @ (x - self.origin)
        return bool(((self.low <= at) & (at <= self.high)).all())

    def part(self, low: Array, high: Array) -> "Region":
        """Return the region of other coordinates from the same point."""
        return Region(self.origin, self.forward, np.asarray(low), np.asarray(high))

    def solid(self, name: str) -> Box:
        """Return the region as an obstacle."""
        half_turn = 0.5 * np.arctan2(self.forward[1], self.forward[0])
        return Box(
            name=name,
            size=tuple((self.high - self.low).tolist()),
            position=tuple((self.origin + 0.5 * (self.low + self.high) @ self.axes).tolist()),
            orientation_xyzw=(0.0, 0.0, float(np.sin(half_turn)), float(np.cos(half_turn))),
        )


@dataclass(frozen=True)
class RandomScene:
    """Obstacles, and the regions that a motion's ends have their end effector in."""

    scene: Scene
    ends: tuple[Region, Region] | None = None
    """One for each end; None for anywhere."""


def empty(workspace: Workspace, random: np.random.Generator) -> RandomScene:  # noqa: ARG001
    """Return no obstacles."""
    return RandomScene(Scene())


def spheres(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return spheres where the end effector can be, half the reach or more away."""
    reach = workspace.reach
    balls = [
        Sphere(
            name=f"sphere_{k}",
            radius=reach * random.uniform(0.05, 0.15),
            position=_somewhere(workspace, random),
        )
        for k in range(random.integers(*_BODIES))
    ]
    return RandomScene(Scene(balls))


def boxes(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return boxes in any orientation where the end effector can be, as far away."""
    crates = []
    for k in range(random.integers(*_BODIES)):
        quaternion = random.normal(size=4)
        crates.append(
            Box(
                name=f"box_{k}",
                size=tuple((workspace.reach * random.uniform(0.08, 0.35, 3)).tolist()),
                position=_somewhere(workspace, random),
                orientation_xyzw=tuple((quaternion / np.linalg.norm(quaternion)).tolist()),
            )
        )
    return RandomScene(Scene(crates))


def wall(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return a wall with a gap, to reach through or to draw back from."""
    front, height = random.uniform(0.35, 0.6), random.uniform(-0.2, 0.5)
    gap = random.uniform(0.2, 0.3, 2)
    left = random.uniform(-0.3, 0.3) * gap[0]
    back = front + _BOARD
    all_around = _in_front(workspace, random)

    def part(low: tuple[float, ...], high: tuple[float, ...]) -> Region:
        return all_around.part(workspace.reach * np.array(low), workspace.reach * np.array(high))

    sides, lintel = (left - gap[0], left + gap[0]), (height - gap[1], height + gap[1])
    boards = {
        "right": part((front, -_WIDE, -_WIDE), (back, sides[0], _WIDE)),
        "left": part((front, sides[1], -_WIDE), (back, _WIDE, _WIDE)),
        "below": part((front, sides[0], -_WIDE), (back, sides[1], lintel[0])),
        "above": part((front, sides[0], lintel[1]), (back, sides[1], _WIDE)),
    }
    behind = part((back + 0.05, -_WIDE, -_WIDE), (_WIDE, _WIDE, _WIDE))
    before = part((-_WIDE, -_WIDE, -_WIDE), (front, _WIDE, _WIDE))
    return _furnished(boards, (before, behind), random)


def shelf(workspace: Workspace, random: np.random.Generator) -> RandomScene:
    """Return a shelf that stands open to the arm, to reach into or to draw back from."""
    front, deep, wide = random.uniform(0.4, 0.6), random.uniform(0.2, 0.3), random.uniform(0.2, 0.3)
    levels, rise = int(random.integers(2, 4)), random.uniform(0.3, 0.4)
    bottom, back = random.uniform(-0.5, 0.0), front + deep
    top = bottom + levels * rise
    all_around = _in_front(workspace, random)

    def part(low: tuple[float, ...], high: tuple[float, ...]) -> Region:
        return all_around.part(workspace.reach * np.array(low), workspace.reach * np.array(high))

    boards = {
        "right": part((front, -wide - _BOARD, bottom), (back, -wide, top + _BOARD)),
        "left": part((front, wide, bottom), (back, wide + _BOARD, top + _BOARD)),
        "back": part((back, -wide, bottom), (back + _BOARD, wide, top + _BOARD)),
    }
    for k in range(levels + 1):
        height = bottom + k * rise
        boards[f"board_{k}"] = part((front, -wide, height), (back, wide, height + _BOARD))
    height = bottom + rise * int(random.integers(levels))
    inside = part((front + 0.05, -wide, height), (back, wide, height + rise))
    before = part((-_WIDE, -_WIDE, -_WIDE), (front, _WIDE, _WIDE))
    return _furnished(boards, (before, inside), random)


SceneKind = Callable[[Workspace, np.random.Generator], RandomScene]

OBSTACLES: Mapping[str, SceneKind] = {
    "spheres": spheres,
    "boxes": boxes,
    "wall": wall,
    "shelf": shelf,
}
"""The kinds of scenes with something in them."""

SCENE_KINDS: Mapping[str, tuple[SceneKind, ...]] = {
    "none": (empty,),
    **{name: (kind,) for name, kind in OBSTACLES.items()},
    "mixed": tuple(OBSTACLES.values()),
}
"""Choices of scenes, whose kinds take turns."""


def _somewhere(workspace: Workspace, random: np.random.Generator) -> tuple[float, ...]:
    while True:
        tip = workspace.tip(workspace.draw(random))
        if np.linalg.norm(tip - workspace.centre) >= _NEAREST * workspace.reach:
            return tuple(tip.tolist())


def _in_front(workspace: Workspace, random: np.random.Generator) -> Region:
    """Return an empty region that faces a way in which the end effector can be."""
    forward = workspace.tip(workspace.draw(random)) - workspace.centre
    forward[2] = 0.0
    forward /= np.linalg.norm(forward)
    return Region(workspace.centre, forward, np.zeros(3), np.zeros(3))


def _furnished(
    boards: Mapping[str, Region], ends: tuple[Region, Region], random: np.random.Generator
) -> RandomScene:
    scene = Scene([region.solid(name) for name, region in boards.items()])
    return RandomScene(scene, ends if random.integers(2) else ends[::-1])
