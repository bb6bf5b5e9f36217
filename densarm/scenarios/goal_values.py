"""Goals and configurations as TOML and JSON have them, to those of an arm and back."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from densarm.arms.arm import Arm
from densarm.arms.joint_space import sliding_joints
from densarm.arms.pose import Pose
from densarm.errors import InvalidValueError, UnknownNameError
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector


def read_goal(arm: Arm, key: str, value: Any) -> Any:
    """Return the goal of a value of TOML or JSON: positions, a posture, a pose, or a list of them.

    Raises:
        DensarmError: as `Pose.of_table`, or a value that is none.
    """
    is_list = isinstance(value, list) and not all(isinstance(x, int | float) for x in value)
    if not is_list:
        return read_one_goal(arm, key, value)
    return [read_one_goal(arm, f"{key}[{k}]", item) for k, item in enumerate(value)]


def read_one_goal(arm: Arm, key: str, value: Any) -> Array | Pose:
    """Return one goal of a value; errors call it by the key."""
    if isinstance(value, Mapping):
        return Pose.of_table(key, value)
    if not isinstance(value, str | list):
        raise InvalidValueError(
            key, value, "joint positions, a posture, a pose, or a list of these"
        )
    return read_configuration(arm, key, value)


def goals_json(arm: Arm, goals: Sequence[Array | Pose]) -> list[Any]:
    """Return goals as values of JSON."""
    return [x.to_json() if isinstance(x, Pose) else arm.angles(x).tolist() for x in goals]


def read_configuration(arm: Arm, key: str, value: str | Sequence[float]) -> Array:
    """Return the configuration (nq,) of joint positions or the name of a posture."""
    if isinstance(value, str):
        if value not in arm.postures:
            raise UnknownNameError(f"posture for {key}", value, arm.postures)
        return arm.postures[value]
    angles = finite_vector(f"{key} (one number per joint, or a posture)", value, arm.nv)
    limits, turns = arm.limits, ~sliding_joints(arm.model)
    outside = limits.excess(angles) > 0.0
    for joint in np.flatnonzero(outside & turns & (np.abs(angles) > 2.0 * np.pi))[:1]:
        low, high = limits.lower[joint], limits.upper[joint]
        allowed = (
            f"in radians, {low:.4g} to {high:.4g} for {arm.joint_names[joint]!r}, "
            f"not {angles[joint]:g}: are these degrees?"
        )
        raise InvalidValueError(key, value, allowed)
    return arm.configuration(angles)
