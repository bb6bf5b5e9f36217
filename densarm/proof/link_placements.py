"""LinkPlacements: forward kinematics for compiled loops."""

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled


class JointChain(NamedTuple):
    """A model of revolute, continuous and prismatic joints as arrays; joint 0 is the world."""

    parent: NDArray[np.int64]
    """Joint that each one moves with (njoints,)."""
    rotation: Array
    """Of each joint's frame at rest in its parent's (njoints, 3, 3)."""
    translation: Array
    """Of each joint's frame at rest in its parent's (njoints, 3) [m]."""
    axis: Array
    """Unit vector along which each joint slides or about which it turns (njoints, 3)."""
    slides: NDArray[np.bool_]
    """Whether each joint is prismatic (njoints,)."""


def joint_chain(model: pin.Model) -> JointChain:
    """Return the arrays of a model whose joints have one degree of freedom each."""
    subspace = np.zeros((model.njoints, 6))
    for index in range(1, model.njoints):
        subspace[index] = model.joints[index].createData().S.reshape(6)
    slides = np.logical_not(np.any(subspace[:, 3:] != 0.0, axis=1))
    return JointChain(
        parent=np.array(list(model.parents), dtype=np.int64),
        rotation=np.array([placement.rotation for placement in model.jointPlacements]),
        translation=np.array([placement.translation for placement in model.jointPlacements]),
        axis=np.where(slides[:, np.newaxis], subspace[:, :3], subspace[:, 3:]),
        slides=slides,
    )


@compiled
def write_placements(
    chain: JointChain,
    angles: Array,
    step: Array,
    share: float,
    rotation: Array,
    translation: Array,
) -> None:
    """Write where the joints' frames are after a share of a motion.

    Args:
        chain: the joints.
        angles: joint positions (nv,) [rad or m].
        step: motion of the joints (nv,) [rad or m].
        share: of the motion that was made.
        rotation: of the frames in the world (njoints, 3, 3), overwritten.
        translation: of the frames in the world (njoints, 3) [m], overwritten.

    Source: Rodrigues' formula: Lynch and Park, Modern Robotics, eq. 3.51.
    """
    for i in range(3):
        translation[0, i] = 0.0
        for j in range(3):
            rotation[0, i, j] = 1.0 if i == j else 0.0
    for joint in range(1, chain.parent.size):
        parent, position = chain.parent[joint], angles[joint - 1] + share * step[joint - 1]
        slide = position if chain.slides[joint] else 0.0
        turn = 0.0 if chain.slides[joint] else position
        x, y, z = chain.axis[joint, 0], chain.axis[joint, 1], chain.axis[joint, 2]
        c, s = math.cos(turn), math.sin(turn)
        versine = 1.0 - c
        for i in range(3):
            # Row i of the frame at rest, seen from the world.
            a = b = d = at = 0.0
            for k in range(3):
                r = rotation[parent, i, k]
                a += r * chain.rotation[joint, k, 0]
                b += r * chain.rotation[joint, k, 1]
                d += r * chain.rotation[joint, k, 2]
                at += r * chain.translation[joint, k]
            along = a * x + b * y + d * z
            translation[joint, i] = translation[parent, i] + at + slide * along
            rotation[joint, i, 0] = c * a + s * (b * z - d * y) + versine * along * x
            rotation[joint, i, 1] = c * b + s * (d * x - a * z) + versine * along * y
            rotation[joint, i, 2] = c * d + s * (a * y - b * x) + versine * along * z
