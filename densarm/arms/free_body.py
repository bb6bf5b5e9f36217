"""Rigid bodies that move freely: a point, a disc, any shapes, as an arm of slides and turns."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations_with_replacement, pairwise
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.collision_shapes import evenly_filled
from densarm.arms.description import RobotDescription
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import (
    Box,
    Capsule,
    Cylinder,
    Obstacle,
    Sphere,
    geometry_objects,
    obstacle_pose,
)
from densarm.scene.scene import Scene
from densarm.values.arrays import Array, Vector
from densarm.values.checks import finite_tuple, one_of, positive

_CARRIER_SHARE = 1e-3
"""Moment of inertia of what carries the pitch axis, per that of the body."""

_FREEDOMS: Mapping[str, tuple[str, ...]] = {
    "plane": ("x", "y"),
    "plane + yaw": ("x", "y", "yaw"),
    "space": ("x", "y", "z"),
    "rigid body": ("x", "y", "z", "yaw", "pitch", "roll"),
}
_X, _Y, _Z = "1 0 0", "0 1 0", "0 0 1"
_AXES = {"x": _X, "y": _Y, "z": _Z, "yaw": _Z, "pitch": _Y, "roll": _X}


def free_body(
    shapes: Obstacle | Iterable[Obstacle],
    freedom: str,
    bounds: Sequence[Vector] | Array,
    *,
    name: str = "body",
    mass: float = 1.0,
    speed: float = 1.0,
    acceleration: float = 10.0,
) -> Arm:
    r"""Return a free rigid body as an arm whose joints are the body's coordinates.

    .. math:: (x, y[, z][, \psi[, \vartheta, \varphi]]), \qquad
        R = R_z(\psi)\, R_y(\vartheta)\, R_x(\varphi)

    It navigates by the world, density and planners of any arm. A point is a `Sphere`
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
        freedom: "plane" for the slides x and y, "space" for x, y and z; "plane + yaw" turns about
            z too, and "rigid body" about z, the new y and the new x.
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
    joints = _FREEDOMS[one_of("freedom", freedom, list(_FREEDOMS))]
    limits = _checked_bounds(bounds, [joint for joint in joints if joint in "xyz"])
    parts = _checked_parts(shapes)
    items = [item for part in parts for item in geometry_objects(part)]
    inertia = evenly_filled(items, positive("mass", mass))
    contents = dict.fromkeys(["ground", *joints[:-1]], "")
    if not isinstance(name, str) or not name or name in {"ground", *joints}:
        raise InvalidValueError("name", name, "a non-empty string, other than 'ground' or a joint")
    if "pitch" in joints:
        largest = float(np.linalg.eigvalsh(inertia.inertia).max())
        carrier = pin.Inertia(0.0, np.zeros(3), _CARRIER_SHARE * largest * np.eye(3))
        contents["yaw"] = _inertial(carrier)
    contents[name] = _inertial(inertia) + "".join(map(_collision, parts))
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
    bounds: Sequence[Vector] | Array, slides: Sequence[str]
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


def _inertial(inertia: pin.Inertia) -> str:
    moments = " ".join(
        f'i{"xyz"[i]}{"xyz"[j]}="{float(inertia.inertia[i, j])!r}"'
        for i, j in combinations_with_replacement(range(3), 2)
    )
    return (
        f'<inertial><origin xyz="{_words(inertia.lever)}"/><mass value="{inertia.mass!r}"/>'
        f"<inertia {moments}/></inertial>"
    )


def _collision(part: Obstacle) -> str:
    """Return a part as a collision element, whose words are those of its class and fields."""
    sizes = {key: getattr(part, key) for key in ("radius", "length", "size") if hasattr(part, key)}
    given = " ".join(f'{key}="{_words(np.atleast_1d(size))}"' for key, size in sizes.items())
    pose = obstacle_pose(part)
    return (
        f'<collision><origin xyz="{_words(pose.translation)}" '
        f'rpy="{_words(pin.rpy.matrixToRpy(pose.rotation))}"/>'
        f"<geometry><{type(part).__name__.lower()} {given}/></geometry></collision>"
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
