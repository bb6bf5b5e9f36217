"""MoveIt's text format ``.scene``, as its RViz panel exports a scene, and MoveIt's shapes."""

import math
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin

from densarm.errors import DensarmError, FileContentError, InvalidValueError, UnknownNameError
from densarm.scene.mesh import Mesh, hull_corners
from densarm.scene.obstacles import (
    Box,
    Cylinder,
    HalfSpace,
    Obstacle,
    Sphere,
    numbered,
    pose_fields,
)
from densarm.scene.scene import Scene
from densarm.scene.shapes import circumscribed_circle
from densarm.values.checks import finite_tuple, finite_vector, positive, unit_quaternion
from densarm.values.files import read_text

_SIZES = {"sphere": 1, "box": 3, "cylinder": 2, "cone": 2, "plane": 4}
_MOST = 100_000  # shapes of an object, vertices and triangles of a mesh


def read_moveit_scene(path: Path) -> Scene:
    """Return the obstacles of a ``.scene`` file; errors name the line.

    Both versions are read: with a pose and subframes for each object (MoveIt 1.1 and 2), and
    without. Poses are taken as in the world; colours and subframes are left out. A plane becomes
    the half-space behind it, a cone or a mesh its convex hull.

    Source: MoveIt, `PlanningScene::saveGeometryToStream`, and geometric_shapes, `saveAsText`.
    """
    words = _Words(read_text(path))
    try:
        return Scene(_obstacles(words))
    except DensarmError as error:
        raise FileContentError(path, f"line {words.line}: {error}") from None


def moveit_obstacle(name: str, kind: str, sizes: Sequence[float], pose: pin.SE3) -> Obstacle:
    """Return the obstacle that a shape of the library geometric_shapes stands for.

    Args:
        name: its name.
        kind: "sphere", "box", "cylinder", "cone" (its hull, a circumscribed pyramid) or "plane".
        sizes: radius; side lengths x y z; radius and length; radius and length, the tip on the
            side of positive z; a b c d of the plane a x + b y + c z + d = 0, whose side towards
            which (a, b, c) points is free [m].
        pose: of the shape in the world, or in the frame of the link that holds it.
    """
    if len(sizes) != _size_count(name, kind):
        raise InvalidValueError(f"sizes of {kind} {name!r}", sizes, f"{_SIZES[kind]} numbers")
    placed = pose_fields(pose)
    if kind == "sphere":
        return Sphere(name=name, radius=sizes[0], position=placed["position"])
    if kind == "box":
        return Box(name=name, size=sizes, **placed)
    if kind == "cylinder":
        return Cylinder(name=name, radius=sizes[0], length=sizes[1], **placed)
    if kind == "cone":
        radius = positive(f"{name}.radius", sizes[0])
        half = positive(f"{name}.length", sizes[1]) / 2.0
        rim = circumscribed_circle(radius, -half)
        return Mesh(name=name, pieces=[[*rim, (0.0, 0.0, half)]], **placed)
    scale = math.hypot(*sizes[:3]) or 1.0  # zero is refused by the half-space
    return HalfSpace(name=name, normal=tuple(sizes[:3]), offset=-sizes[3] / scale, **placed)


def moveit_mesh(name: str, vertices: Sequence[Sequence[float]], pose: pin.SE3) -> Obstacle:
    """Return the convex hull of a mesh whose vertices (N, 3) [m] a message or file lists."""
    points = np.array([finite_tuple(f"vertex of {name!r}", vertex, 3) for vertex in vertices])
    return Mesh(
        name=name,
        pieces=[hull_corners(points.reshape(-1, 3), f"mesh {name!r}")],
        **pose_fields(pose),
    )


def moveit_pose(name: str, position: Sequence[float], orientation: Sequence[float]) -> pin.SE3:
    """Return the pose x y z [m], quaternion x y z w of a message or file; zeros turn nothing."""
    at = finite_vector(f"position of {name}", position, 3)
    turn = finite_vector(f"orientation of {name}", orientation, 4)
    if not turn.any():
        turn[3] = 1.0
    return pin.XYZQUATToSE3(np.array([*at, *unit_quaternion(f"orientation of {name}", turn)]))


class _Words:
    """The words of a file in turn, and the line of the last one."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self.line = 1  # which is the scene's name
        self._words: list[str] = []
        first = next((b for a, b in pairwise(self._lines[1:]) if a.startswith("*")), "")
        # A single word after an object's name is its number of shapes.
        self.has_object_poses = len(first.split()) > 1

    def word(self) -> str:
        """Return the next word."""
        while not self._words:
            if self.line >= len(self._lines):
                raise DensarmError("the file ends before the line '.' that closes a scene")
            self._words = self._lines[self.line].split()[::-1]
            self.line += 1
        return self._words.pop()

    def rest_of_line(self) -> str:
        """Return what is left of the line."""
        rest, self._words = " ".join(self._words[::-1]), []
        return rest

    def numbers(self, count: int) -> list[float]:
        """Return the next words as numbers."""
        return [self._number() for _ in range(count)]

    def count(self, what: str) -> int:
        """Return the next word as a count."""
        word = self.word()
        if not (word.isascii() and word.isdigit() and len(word) < 10 and int(word) <= _MOST):
            raise InvalidValueError(f"number of {what}", word, f"a whole number <= {_MOST}")
        return int(word)

    def pose(self, name: str) -> pin.SE3:
        """Return the next words as a pose."""
        return moveit_pose(name, self.numbers(3), self.numbers(4))

    def _number(self) -> float:
        word = self.word()
        try:
            return float(word)
        except ValueError:
            raise InvalidValueError("entry", word, "a number") from None


def _obstacles(words: _Words) -> list[Obstacle]:
    obstacles: list[Obstacle] = []
    while (marker := words.word()) != ".":
        if marker != "*":
            raise InvalidValueError("entry", marker, "'*' before an object, or '.' at the end")
        name = words.rest_of_line()
        pose = words.pose(f"object {name!r}") if words.has_object_poses else pin.SE3.Identity()
        count = words.count(f"shapes of {name!r}")
        obstacles += [_shape(words, item, pose) for item in numbered(name, count)]
        if words.has_object_poses:
            for _ in range(words.count(f"subframes of {name!r}")):
                words.pose(f"subframe {words.word()!r}")
    return obstacles


def _shape(words: _Words, name: str, pose: pin.SE3) -> Obstacle:
    kind = words.word()
    if kind == "mesh":
        count, triangles = words.count("vertices"), words.count("triangles")
        made_at = partial(moveit_mesh, name, [words.numbers(3) for _ in range(count)])
        words.numbers(3 * triangles)
    else:
        made_at = partial(moveit_obstacle, name, kind, words.numbers(_size_count(name, kind)))
    placed = pose * words.pose(f"shape of {name!r}")
    words.numbers(4)  # the colour
    return made_at(placed)


def _size_count(name: str, kind: str) -> int:
    if kind not in _SIZES:
        raise UnknownNameError(f"shape of object {name!r}", kind, [*_SIZES, "mesh"])
    return _SIZES[kind]
