"""Which joints of a description move: all but some, or some out of a larger robot."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.robot.locked_joints import mimicking_joints
from densarm.robot.robot_description import RobotDescription
from densarm.robot.robot_models import joint_names
from densarm.robot.urdf import Urdf
from densarm.validation import finite_tuple


def without_joints(description: RobotDescription, locked: Mapping[str, float]) -> RobotDescription:
    """Return the description with joints locked, also in what it gives per joint.

    Args:
        description: the robot.
        locked: joint name to position [rad or m].

    Raises:
        UnknownNameError: a joint that the URDF does not have.
        InvalidValueError: a position that is not a finite number.
        RobotDescriptionError: the URDF cannot be used.
    """
    positions = {j: finite_tuple(f"locked_joints.{j}", [x], 1)[0] for j, x in locked.items()}
    changed = replace(description, locked_joints={**description.locked_joints, **positions})
    given, postures = description.acceleration, description.postures
    if given is None and not postures:
        return changed
    remaining = joint_names(changed)
    kept = [i for i, name in enumerate(joint_names(description)) if name in remaining]
    return replace(
        changed,
        acceleration=None if given is None else tuple(given[i] for i in kept),
        postures={key: tuple(angles[i] for i in kept) for key, angles in postures.items()},
    )


def only_joints(
    description: RobotDescription, joints: Iterable[str], locked: Mapping[str, float]
) -> RobotDescription:
    """Return the description with all joints locked but those named.

    Args:
        description: the robot.
        joints: names of joints that it moves.
        locked: joint name to position [rad or m]; zero for all others, or the limit next to it.

    Raises:
        UnknownNameError: a joint that the robot does not move.
        InvalidValueError: a joint that is locked and named, or a position that is not finite.
        RobotDescriptionError: the URDF cannot be used.
    """
    urdf = Urdf(description)
    names = [name for name in list(urdf.model.names)[1:] if name not in description.locked_joints]
    for name in joints:
        if name not in names:
            raise UnknownNameError("joint", name, names)
        if name in locked:
            raise InvalidValueError(f"locked_joints.{name}", locked[name], "of no joint in joints")
    others = {
        name: _neutral(urdf, name)
        for name in names
        if name not in joints and name not in mimicking_joints(urdf)
    }
    return without_joints(description, {**others, **locked})


def _neutral(urdf: Urdf, name: str) -> float:
    joint = urdf.model.joints[urdf.model.getJointId(name)]
    if joint.nq > 1:
        return 0.0
    limits = urdf.model.lowerPositionLimit[joint.idx_q], urdf.model.upperPositionLimit[joint.idx_q]
    return float(np.clip(0.0, *limits))
