"""Shapes of MoveIt's messages and files as obstacles."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.mesh import Mesh
from densarm.mesh_file import hull_corners
from densarm.obstacles import Box, Cylinder, HalfSpace, Obstacle, Sphere
from densarm.shapes import CYLINDER_SIDES
from densarm.validation import finite_tuple, finite_vector, positive, unit_quaternion

_SIZES = {"sphere": 1, "box": 3, "cylinder": 2, "cone": 2, "plane": 4}


def size_count(name: str, kind: str) -> int:
    """Return how many sizes a kind of shape has.

    Raises:
        UnknownNameError: a kind that makes no obstacle.
    """
    if kind not in _SIZES:
        raise UnknownNameError(f"shape of object {name!r}", kind, [*_SIZES, "mesh"])
    return _SIZES[kind]


def moveit_obstacle(name: str, kind: str, sizes: Sequence[float], pose: pin.SE3) -> Obstacle:
    """Return the obstacle that a shape of the library geometric_shapes stands for.

    Args:
        name: its name.
        kind: "sphere", "box", "cylinder", "cone" (its hull, a circumscribed pyramid) or "plane".
        sizes: radius; side lengths x y z; radius and length; radius and length, the tip on the
            side of positive z; a b c d of the plane a x + b y + c z + d = 0, whose side towards
            which (a, b, c) points is free [m].
        pose: of the shape in the world, or in the frame of the link that holds it.

    Raises:
        UnknownNameError: another kind.
        InvalidValueError: another number of sizes, or a value that is not allowed.
    """
    if len(sizes) != size_count(name, kind):
        raise InvalidValueError(f"sizes of {kind} {name!r}", sizes, f"{_SIZES[kind]} numbers")
    position, orientation = _position_and_orientation(pose)
    if kind == "sphere":
        return Sphere(name=name, radius=sizes[0], position=position)
    placed: dict[str, Any] = {
        "name": name,
        "position": position,
        "orientation_xyzw": orientation,
    }
    if kind == "box":
        return Box(size=tuple(sizes), **placed)
    if kind == "cylinder":
        return Cylinder(radius=sizes[0], length=sizes[1], **placed)
    if kind == "cone":
        return Mesh(pieces=(_cone_corners(name, *sizes),), **placed)
    scale = math.hypot(*sizes[:3]) or 1.0  # zero is refused by the half-space
    return HalfSpace(normal=tuple(sizes[:3]), offset=-sizes[3] / scale, **placed)


def moveit_mesh(name: str, vertices: Sequence[Sequence[float]], pose: pin.SE3) -> Obstacle:
    """Return the convex hull of a mesh whose vertices a message or file lists.

    Args:
        name: its name.
        vertices: (N, 3) [m].
        pose: of the mesh.

    Raises:
        InvalidValueError: a vertex that is not three finite numbers.
        RobotDescriptionError: vertices that span no volume.
    """
    position, orientation = _position_and_orientation(pose)
    points = np.array([finite_tuple(f"vertex of {name!r}", vertex, 3) for vertex in vertices])
    piece = hull_corners(points.reshape(-1, 3))
    return Mesh(name=name, pieces=(piece,), position=position, orientation_xyzw=orientation)


def moveit_pose(name: str, position: Sequence[float], orientation: Sequence[float]) -> pin.SE3:
    """Return the pose of a message or file, in which an orientation of zeros means none.

    Args:
        name: how errors call it.
        position: x y z [m].
        orientation: quaternion x y z w.

    Raises:
        InvalidValueError: a wrong number of entries, or no unit quaternion.
    """
    at = finite_vector(f"position of {name}", position, 3)
    turn = finite_vector(f"orientation of {name}", orientation, 4)
    if not turn.any():
        turn[3] = 1.0
    return pin.XYZQUATToSE3(np.array([*at, *unit_quaternion(f"orientation of {name}", turn)]))


def shape_names(name: str, count: int) -> list[str]:
    """Return the names of an object's shapes: its own if there is one, else with a number."""
    return [name] if count == 1 else [f"{name}.{k}" for k in range(count)]


def _cone_corners(name: str, radius: float, length: float) -> tuple[tuple[float, ...], ...]:
    corner = positive(f"{name}.radius", radius) / np.cos(np.pi / CYLINDER_SIDES)
    half = positive(f"{name}.length", length) / 2.0
    angles = 2.0 * np.pi * np.arange(CYLINDER_SIDES) / CYLINDER_SIDES
    ring = [(corner * float(np.cos(a)), corner * float(np.sin(a)), -half) for a in angles]
    return (*ring, (0.0, 0.0, half))


def _position_and_orientation(pose: pin.SE3) -> tuple[tuple[float, ...], tuple[float, ...]]:
    values = pin.SE3ToXYZQUAT(pose).tolist()
    return tuple(values[:3]), tuple(values[3:])
