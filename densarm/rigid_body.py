"""Rigid bodies that move freely: a point, a disc, any shapes, as an arm of slides and turns."""

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from itertools import pairwise
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.errors import InvalidValueError
from densarm.robot.robot_description import RobotDescription
from densarm.scene import Box, Capsule, Cylinder, Obstacle, Scene, Sphere, obstacle_pose
from densarm.validation import finite_tuple, one_of, positive

_CARRIER_SHARE = 1e-3
"""Moment of inertia of what carries the pitch axis, per that of the body."""


class Freedom(StrEnum):
    """How a free body moves: along its slides and about its turns, in this order."""

    PLANE = "plane"
    """Slides x and y."""
    PLANE_AND_YAW = "plane + yaw"
    """Slides x and y; then a turn about z."""
    SPACE = "space"
    """Slides x, y and z."""
    RIGID_BODY = "rigid body"
    """Slides x, y and z; then turns about z, the new y and the new x."""


def free_body(
    shapes: Obstacle | Iterable[Obstacle],
    freedom: Freedom | str,
    bounds: Sequence[Sequence[float]],
    *,
    name: str = "body",
    mass: float = 1.0,
    speed: float = 1.0,
    acceleration: float = 10.0,
) -> Arm:
    r"""Return a free rigid body as an arm whose joints are the body's coordinates.

    .. math:: (x, y[, z][, \psi[, \vartheta, \varphi]]), \qquad
        R = R_z(\psi)\, R_y(\vartheta)\, R_x(\varphi)

    It navigates by the clearance, density, guides and swept bound of any arm. A point is a `Sphere`
    of a radius that is nothing in its scene, such as 1e-9 m; a disc in the plane is a `Sphere`
    among obstacles that stand across z = 0.

    Metres and radians meet in one joint space, at 1 m to 1 rad. See `TorusDistance` for what that
    means far from the goal, where κ = ∞ leads straight. Steps and sub-goals of 0.05 rad are of
    0.05 m here, which suits bodies of some centimetres and more.

    At ϑ = ±π/2 the first and the last turn have one axis (gimbal lock). Distances, paths and
    commanded velocities pass through it; torque then turns the body about two axes only. The mass
    matrix stays regular, since what carries the axis of ϑ has a thousandth of the body's inertia.

    Args:
        shapes: one or more shapes in the body's frame, all of one density.
        freedom: see `Freedom`.
        bounds: lowest and highest position of the body's origin along each slide [m], (2 or 3, 2).
        name: of the body; pairs call its shapes name_0, name_1, ...
        mass: of the body [kg]; gravity acts along -z.
        speed: velocity limit of every joint [m/s or rad/s].
        acceleration: acceleration limit of every joint [m/s² or rad/s²].

    Returns:
        An arm with the joints x, y, z, yaw, pitch, roll, or those of them that `freedom` has. The
        turns are continuous. No force is limited.

    Raises:
        InvalidValueError: no shape or one of another kind, an unknown freedom, a number out of its
            range, or a name that a joint has.

    Source: Siciliano et al., Robotics: Modelling, Planning and Control, 2009, section 2.4.2.
    """
    joints = _JOINTS[Freedom(one_of("freedom", freedom, list(Freedom)))]
    limits = _checked_bounds(bounds, [joint for joint in joints if joint in _SLIDES])
    parts = _checked_parts(shapes)
    inertia = _inertia(parts, positive("mass", mass))
    contents = dict.fromkeys(["ground", *joints[:-1]], "")
    if not isinstance(name, str) or not name or name in {"ground", *joints}:
        raise InvalidValueError("name", name, "a non-empty string, other than 'ground' or a joint")
    if "pitch" in joints:
        largest = float(np.linalg.eigvalsh(inertia.inertia).max())
        carrier = pin.Inertia(0.0, np.zeros(3), _CARRIER_SHARE * largest * np.eye(3))
        contents["yaw"] = _inertial(carrier)
    contents[name] = _inertial(inertia) + _collisions(parts)
    links = [f"<link name={quoteattr(key)}>{text}</link>" for key, text in contents.items()]
    ends = zip(joints, pairwise(contents), strict=True)
    speed = positive("speed", speed)
    chain = [_joint(joint, *pair, limits.get(joint), speed) for joint, pair in ends]
    return Arm(
        RobotDescription(
            name=name,
            urdf=f"<robot name={quoteattr(name)}>{''.join(links + chain)}</robot>",
            acceleration=(positive("acceleration", acceleration),) * len(joints),
        )
    )


_JOINTS: Mapping[Freedom, tuple[str, ...]] = {
    Freedom.PLANE: ("x", "y"),
    Freedom.PLANE_AND_YAW: ("x", "y", "yaw"),
    Freedom.SPACE: ("x", "y", "z"),
    Freedom.RIGID_BODY: ("x", "y", "z", "yaw", "pitch", "roll"),
}
_SLIDES = ("x", "y", "z")
_X, _Y, _Z = "1 0 0", "0 1 0", "0 0 1"
_AXES = {"x": _X, "y": _Y, "z": _Z, "yaw": _Z, "pitch": _Y, "roll": _X}


def _checked_parts(shapes: Obstacle | Iterable[Obstacle]) -> Scene:
    """Return the shapes, checked like those of a scene."""
    parts = Scene(shapes if isinstance(shapes, Iterable) else [shapes])
    if not len(parts):
        raise InvalidValueError("shapes of a free body", [], "at least one shape")
    for part in parts:
        if not isinstance(part, Sphere | Box | Capsule | Cylinder):
            allowed = "of spheres, boxes, capsules and cylinders"
            raise InvalidValueError("shape of a free body", part, allowed)
    return parts


def _checked_bounds(
    bounds: Sequence[Sequence[float]], slides: Sequence[str]
) -> dict[str, tuple[float, ...]]:
    if len(bounds) != len(slides):
        allowed = f"a pair (lowest, highest) for each of {', '.join(slides)}"
        raise InvalidValueError("bounds", bounds, allowed)
    checked = {}
    for slide, pair in zip(slides, bounds, strict=True):
        low, high = checked[slide] = finite_tuple(f"bounds of {slide}", pair, 2)
        if not low < high:
            raise InvalidValueError(f"bounds of {slide}", pair, "lowest < highest")
    return checked


def _inertia(parts: Scene, mass: float) -> pin.Inertia:
    """Return the inertia of parts of one density and the given total mass."""
    total = pin.Inertia.Zero()
    for part in parts:
        (shape,) = part.convex_shapes()
        about_centre = shape.computeMomentofInertiaRelatedToCOM()
        solid = pin.Inertia(shape.computeVolume(), shape.computeCOM(), about_centre)
        total += obstacle_pose(part).act(solid)
    return pin.Inertia(mass, total.lever, mass / total.mass * total.inertia)


def _inertial(inertia: pin.Inertia) -> str:
    entries = {key: inertia.inertia[i, j] for key, (i, j) in _ENTRIES.items()}
    moments = " ".join(f'i{key}="{float(value)!r}"' for key, value in entries.items())
    return (
        f'<inertial><origin xyz="{_words(inertia.lever)}"/><mass value="{inertia.mass!r}"/>'
        f"<inertia {moments}/></inertial>"
    )


_ENTRIES = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}


def _collisions(parts: Scene) -> str:
    """Return one collision element for each part, then the ends of capsules.

    A URDF writes a capsule as a cylinder and two spheres, which loading it puts together again.
    """
    ends = [
        _collision(part, Sphere(name=part.name, radius=part.radius), z)
        for part in parts
        if isinstance(part, Capsule)
        for z in (-0.5 * part.length, 0.5 * part.length)
    ]
    return "".join([*(_collision(part, part, 0.0) for part in parts), *ends])


def _collision(part: Obstacle, solid: Any, z: float) -> str:
    """Return a solid as a collision element, at a height [m] along the z axis of a part."""
    match solid:
        case Sphere():
            geometry = f'<sphere radius="{solid.radius!r}"/>'
        case Box():
            geometry = f'<box size="{_words(solid.size)}"/>'
        case _:
            geometry = f'<cylinder radius="{solid.radius!r}" length="{solid.length!r}"/>'
    pose = obstacle_pose(part)
    return (
        f'<collision><origin xyz="{_words(pose.act(np.array([0.0, 0.0, z])))}" '
        f'rpy="{_words(pin.rpy.matrixToRpy(pose.rotation))}"/>'
        f"<geometry>{geometry}</geometry></collision>"
    )


def _joint(
    name: str, parent: str, child: str, limits: tuple[float, ...] | None, speed: float
) -> str:
    """Return a slide within limits, or a turn without; zero effort stands for no limit."""
    ends = "" if limits is None else 'lower="{!r}" upper="{!r}"'.format(*limits)
    return (
        f'<joint name="{name}" type="{"continuous" if limits is None else "prismatic"}">'
        f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>"
        f'<axis xyz="{_AXES[name]}"/><limit effort="0" velocity="{speed!r}" {ends}/></joint>'
    )


def _words(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(x)) for x in numbers)
