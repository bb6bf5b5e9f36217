"""Forward kinematics for compiled loops.

A pose is a row of twelve numbers: the rotation matrix, row by row, then the translation [m].
"""

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled

AXIS, SLIDES = slice(12, 15), 15
"""Columns of a table of joints: its axis, and whether it slides along it."""
_IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def pose_row(placement: pin.SE3) -> Array:
    """Return a placement as a pose (12,)."""
    return np.concatenate([placement.rotation.ravel(), placement.translation])


def joint_table(model: pin.Model) -> tuple[NDArray[np.int64], Array]:
    """Return a model of revolute, continuous and prismatic joints as arrays.

    Args:
        model: its joints have one degree of freedom each; joint 0 is the world.

    Returns:
        The joint that each one moves with (njoints,), and one row for each (njoints, 16): its pose
        at rest in its parent's frame, the unit vector along which it slides or about which it
        turns, and 1 if it slides, else 0.
    """
    table = np.zeros((model.njoints, 16))
    for index, placement in enumerate(model.jointPlacements):
        table[index, : AXIS.start] = pose_row(placement)
    for index in range(1, model.njoints):
        subspace = model.joints[index].createData().S.reshape(6)
        slides = not subspace[3:].any()
        table[index, AXIS] = subspace[:3] if slides else subspace[3:]
        table[index, SLIDES] = slides
    return np.array(list(model.parents), dtype=np.int64), table


@compiled
def write_joint_poses(
    parent: NDArray[np.int64], joints: Array, angles: Array, step: Array, share: float, out: Array
) -> None:
    """Write where the joints' frames are after a share of a motion.

    Args:
        parent: of each joint (njoints,).
        joints: the table of joints (njoints, 16).
        angles: joint positions (nv,) [rad or m].
        step: motion of the joints (nv,) [rad or m].
        share: of the motion that was made.
        out: poses of the frames in the world (njoints, 12), overwritten.

    Source: Rodrigues' formula: Lynch and Park, Modern Robotics, eq. 3.51.
    """
    for k in range(12):
        out[0, k] = _IDENTITY[k]
    for joint in range(1, parent.size):
        write_composed(out, parent[joint], joints, joint, out)
        x, y, z = joints[joint, 12], joints[joint, 13], joints[joint, 14]
        position = angles[joint - 1] + share * step[joint - 1]
        slide = position * joints[joint, 15]
        turn = position - slide
        c, s = math.cos(turn), math.sin(turn)
        for i in range(3):
            a, b, d = out[joint, 3 * i], out[joint, 3 * i + 1], out[joint, 3 * i + 2]
            along = a * x + b * y + d * z
            out[joint, 9 + i] += slide * along
            along *= 1.0 - c
            out[joint, 3 * i] = c * a + s * (b * z - d * y) + along * x
            out[joint, 3 * i + 1] = c * b + s * (d * x - a * z) + along * y
            out[joint, 3 * i + 2] = c * d + s * (a * y - b * x) + along * z


@compiled
def write_composed(outer: Array, i: int, inner: Array, k: int, out: Array) -> None:
    """Write pose k of a table, seen from pose i of another, to row k of a third."""
    for r in range(3):
        a, b, c = outer[i, 3 * r], outer[i, 3 * r + 1], outer[i, 3 * r + 2]
        for column in range(3):
            turned = a * inner[k, column] + b * inner[k, 3 + column]
            out[k, 3 * r + column] = turned + c * inner[k, 6 + column]
        moved = a * inner[k, 9] + b * inner[k, 10] + c * inner[k, 11]
        out[k, 9 + r] = outer[i, 9 + r] + moved
