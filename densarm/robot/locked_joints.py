"""Joints of a URDF that an arm does not move, and where they stand."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from densarm.arrays import Array
from densarm.errors import RobotDescriptionError, UnknownNameError
from densarm.robot.urdf import Urdf
from densarm.validation import finite_vector

_LINK_MARK = " (link)"


def locked_positions(urdf: Urdf, given: Mapping[str, float]) -> dict[str, float]:
    """Return the positions of all locked joints: those given, and those that mimic them.

    Args:
        urdf: the URDF.
        given: joint name to position [rad or m].

    Raises:
        UnknownNameError: a joint that the URDF does not have.
        InvalidValueError: a position that is not finite.
    """
    names = list(urdf.model.names)[1:]
    for name in given:
        if name not in names:
            raise UnknownNameError("joint to lock", name, names)
    all_joints = {joint.get("name", "") for joint in urdf.root.iter("joint")}
    standing = {**dict.fromkeys(all_joints - set(names), 0.0), **given}
    followers = {name: m for name, m in mimicking_joints(urdf).items() if name not in given}
    while ready := [name for name, mimic in followers.items() if mimic.leader in standing]:
        for name in ready:
            mimic = followers.pop(name)
            standing[name] = mimic.multiplier * standing[mimic.leader] + mimic.offset
    locked = {name: standing[name] for name in names if name in standing}
    for name, position in locked.items():
        finite_vector(f"locked_joints.{name}", [position], 1)
    return locked


def refuse_mimics(urdf: Urdf, locked: Mapping[str, float]) -> None:
    """Refuse joints that move with another.

    Args:
        urdf: the URDF.
        locked: positions of the locked joints.

    Raises:
        RobotDescriptionError: a joint that is not locked mimics another.
    """
    for name, mimic in mimicking_joints(urdf).items():
        if name not in locked:
            moves = urdf.model.existJointName(mimic.leader)
            raise RobotDescriptionError(
                f"joint {name!r} mimics {mimic.leader!r}, which "
                f"{'moves' if moves else 'is no joint'}: lock {'either' if moves else 'it'} by "
                f"locked_joints={{{mimic.leader if moves else name!r}: position}}"
            )


def lock_joints(
    model: pin.Model, geometry: pin.GeometryModel, positions: Mapping[str, float]
) -> tuple[pin.Model, pin.GeometryModel]:
    """Return models without the joints that are locked.

    Raises:
        RobotDescriptionError: a joint of several axes that is not locked at zero.
    """
    if not positions:
        return model, geometry
    q = pin.neutral(model)
    for name, position in positions.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nv == 1:
            single = [np.cos(position), np.sin(position)] if joint.nq == 2 else [position]
            q[joint.idx_q : joint.idx_q + joint.nq] = single
        elif position != 0.0:
            raise RobotDescriptionError(
                f"joint {name!r} has {joint.nv} degrees of freedom, so it can be locked at 0 "
                "alone, its neutral pose"
            )
    return _reduced(model, geometry, [model.getJointId(name) for name in positions], q)


def _reduced(
    model: pin.Model, geometry: pin.GeometryModel, ids: list[int], q: Array
) -> tuple[pin.Model, pin.GeometryModel]:
    """Lock joints at q; Pinocchio does not tell a joint to lock from a link of the same name."""
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            frame.name += _LINK_MARK
    model, (geometry,) = pin.buildReducedModel(model, [geometry], ids, q)
    for frame in model.frames:
        frame.name = frame.name.removesuffix(_LINK_MARK)
    return model, geometry


class Mimic(NamedTuple):
    """How a joint follows another: position = multiplier times the leader's + offset."""

    leader: str
    multiplier: float
    offset: float


def mimicking_joints(urdf: Urdf) -> dict[str, Mimic]:
    """Return the joints that mimic others, by name."""
    mimics = {}
    for joint in urdf.root.iter("joint"):
        element, name = joint.find("mimic"), joint.get("name", "")
        if element is not None and urdf.model.existJointName(name):
            mimics[name] = Mimic(
                element.get("joint", ""),
                float(element.get("multiplier", "1")),
                float(element.get("offset", "0")),
            )
    return mimics
