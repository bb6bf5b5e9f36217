"""Joints of a URDF that an arm does not move, and where they stand."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from densarm.errors import RobotDescriptionError, UnknownNameError
from densarm.urdf import Urdf
from densarm.validation import finite_vector


def locked_positions(urdf: Urdf, given: Mapping[str, float]) -> dict[str, float]:
    """Return the positions of all locked joints: those given, and those that mimic them.

    Args:
        urdf: the URDF.
        given: joint name to position [rad or m].

    Raises:
        RobotDescriptionError: a joint mimics one that moves, or is hard to understand.
        UnknownNameError: a joint that the URDF does not have.
        InvalidValueError: a position that is not finite.
    """
    names = list(urdf.model.names)[1:]
    for name, position in given.items():
        if name not in names:
            raise UnknownNameError("joint to lock", name, names)
        finite_vector(f"locked_joints.{name}", [position], 1)
    locked = dict(given)
    followers = {name: m for name, m in mimicked_joints(urdf).items() if name not in given}
    while ready := [name for name, (leader, _, _) in followers.items() if leader in locked]:
        for name in ready:
            leader, multiplier, offset = followers.pop(name)
            locked[name] = multiplier * locked[leader] + offset
    for name, (leader, _, _) in followers.items():
        raise RobotDescriptionError(
            f"joint {name!r} mimics {leader!r}, which moves; this is not supported: lock "
            f"the one or the other by locked_joints={{{leader!r}: position}}"
        )
    return locked


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
    ids = [model.getJointId(name) for name in positions]
    model, (geometry,) = pin.buildReducedModel(model, [geometry], ids, q)
    return model, geometry


def mimicked_joints(urdf: Urdf) -> dict[str, tuple[str, float, float]]:
    """Return, by joint, the joint that it mimics, the multiplier and the offset.

    Raises:
        RobotDescriptionError: a multiplier or offset that is not a finite number.
    """
    mimics = {}
    for joint in urdf.root.iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            name = joint.get("name", "")
            multiplier, offset = (_number(name, mimic.get(key, default)) for key, default in _MIMIC)
            mimics[name] = (mimic.get("joint", ""), multiplier, offset)
    return mimics


_MIMIC = (("multiplier", "1"), ("offset", "0"))


def _number(joint: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise RobotDescriptionError(f"URDF: mimic of joint {joint!r}: {text!r} is no finite number")
    return value
