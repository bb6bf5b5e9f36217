"""MoveIt's text format ``.scene``, as its RViz panel exports a scene."""

from pathlib import Path

import pinocchio as pin

from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.obstacles import Obstacle
from densarm.robot.robot_description import read_text
from densarm.scene import Scene
from densarm.scene_files.moveit_shapes import (
    moveit_mesh,
    moveit_obstacle,
    moveit_pose,
    shape_names,
    size_count,
)

_MOST = 100_000  # shapes of an object, vertices and triangles of a mesh


def read_moveit_scene(path: Path) -> Scene:
    """Return the obstacles of a ``.scene`` file.

    Both versions are read: with a pose and subframes for each object (MoveIt 1.1 and 2), and
    without. Poses are taken as in the world; colours and subframes are left out. A plane becomes
    the half-space behind it, a cone or a mesh its convex hull.

    Source: MoveIt, `PlanningScene::saveGeometryToStream`, and geometric_shapes, `saveAsText`.

    Args:
        path: the file.

    Raises:
        FileContentError: it cannot be read, or is no such file, with the line.
    """
    words = _Words(read_text(path))
    try:
        return Scene(_obstacles(words))
    except DensarmError as error:
        raise FileContentError(path, f"line {words.line}: {error}") from None


class _Words:
    """The words of a file in turn, and the line of the last one."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._next = 1  # the first line is the scene's name
        self._words: list[str] = []
        self.has_object_poses = self._object_line_is_a_pose()

    @property
    def line(self) -> int:
        """Number of the line that the last word stands in."""
        return self._next

    def word(self) -> str:
        """Return the next word."""
        while not self._words:
            if self._next >= len(self._lines):
                raise DensarmError("the file ends before the line '.' that closes a scene")
            self._words = self._lines[self._next].split()[::-1]
            self._next += 1
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

    def _object_line_is_a_pose(self) -> bool:
        """Return whether the line after the first object's name holds more than one word."""
        for k, line in enumerate(self._lines[1:-1], start=1):
            if line.startswith("*"):
                return len(self._lines[k + 1].split()) > 1
        return False


def _obstacles(words: _Words) -> list[Obstacle]:
    obstacles: list[Obstacle] = []
    while (marker := words.word()) != ".":
        if marker != "*":
            raise InvalidValueError("entry", marker, "'*' before an object, or '.' at the end")
        name = words.rest_of_line()
        pose = words.pose(f"object {name!r}") if words.has_object_poses else pin.SE3.Identity()
        count = words.count(f"shapes of {name!r}")
        obstacles += [_shape(words, item, pose) for item in shape_names(name, count)]
        if words.has_object_poses:
            for _ in range(words.count(f"subframes of {name!r}")):
                words.pose(f"subframe {words.word()!r}")
    return obstacles


def _shape(words: _Words, name: str, pose: pin.SE3) -> Obstacle:
    kind = words.word()
    is_mesh = kind == "mesh"
    vertices = _vertices(words) if is_mesh else []
    sizes = [] if is_mesh else words.numbers(size_count(name, kind))
    placed = pose * words.pose(f"shape of {name!r}")
    words.numbers(4)  # the colour
    if is_mesh:
        return moveit_mesh(name, vertices, placed)
    return moveit_obstacle(name, kind, sizes, placed)


def _vertices(words: _Words) -> list[list[float]]:
    vertices, triangles = words.count("vertices"), words.count("triangles")
    points = [words.numbers(3) for _ in range(vertices)]
    words.numbers(3 * triangles)
    return points
