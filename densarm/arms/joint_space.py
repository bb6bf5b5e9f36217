"""Joint space: where motions take place, and its geometry in compiled code."""

import math
from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive_integer
from densarm.values.kernels import compiled_lean_part


class ConfigurationSpace(Protocol):
    """Configurations q (nq,) and the tangent vectors (nv,) between them; an `Arm` is one."""

    @property
    def nv(self) -> int:
        """Number of tangent directions."""
        ...

    def check_configuration(self, name: str, q: ArrayLike) -> Array:
        """Return q as a float array (nq,), or raise InvalidValueError by its name."""
        ...

    def difference(self, q_from: Array, q_to: Array) -> Array:
        """Return the tangent vectors (..., nv) from configurations (..., nq) to others."""
        ...

    def integrate(self, q: Array, step: Array) -> Array:
        """Return q ⊕ step: the configurations (..., nq) that tangent vectors (..., nv) lead to."""
        ...


class EuclideanSpace:
    """The space Rⁿ of points.

    Args:
        n: its dimension.

    Raises:
        InvalidValueError: a dimension below one.
    """

    def __init__(self, n: int) -> None:
        self.nv = positive_integer("n", n)

    def check_configuration(self, name: str, q: ArrayLike) -> Array:
        """Act as `ConfigurationSpace.check_configuration`."""
        return finite_vector(name, q, self.nv)

    def difference(self, q_from: Array, q_to: Array) -> Array:
        """Return q_to - q_from, both (..., n) [m]."""
        return q_to - q_from

    def integrate(self, q: Array, step: Array) -> Array:
        """Return q + step, both (..., n) [m]."""
        return q + step


def joint_axis(model: pin.Model, joint: int) -> tuple[Array, bool]:
    """Return the unit vector (3,) along which a joint slides or about which it turns; if it slides.

    The joints of the model have one degree of freedom each.
    """
    subspace = model.joints[joint].createData().S.reshape(6)
    slides = not subspace[3:].any()
    return (subspace[:3] if slides else subspace[3:]), slides


def joint_rows(model: pin.Model) -> Array:
    """Return one row for each joint (njoints, 16), of a model of one degree of freedom a joint.

    It has the joint's pose at rest in its parent's frame, as `pose_row`, the unit vector along
    which it slides or about which it turns, and 1 if it slides, else 0.
    """
    rows = np.zeros((model.njoints, 16))
    for index, placement in enumerate(model.jointPlacements):
        rows[index, :12] = pose_row(placement)
        if index > 0:
            rows[index, 12:15], rows[index, 15] = joint_axis(model, index)
    return rows


def pose_row(placement: pin.SE3) -> Array:
    """Return a pose as twelve numbers: the rotation matrix, row by row, the translation [m]."""
    return np.concatenate([placement.rotation.ravel(), placement.translation])


def sliding_joints(model: pin.Model) -> NDArray[np.bool_]:
    """Return which joints are prismatic (nv,), of a model of one degree of freedom a joint."""
    return np.array([joint_axis(model, joint)[1] for joint in range(1, model.njoints)])


@compiled_lean_part
def joint_error(q_goal: Array, q: Array, joint_index: NDArray[np.int64], out: Array) -> None:
    r"""Write the tangent-space error of each joint.

    .. math::

        e_i = q_i - q^{goal}_i \ \text{(bounded)}, \qquad
        e_i = \operatorname{atan2}(\sin(q_i - q^{goal}_i), \cos(q_i - q^{goal}_i))
        \ \text{(continuous)}

    Args:
        q_goal: goal configuration, shape (nq,); a continuous joint is (cos, sin).
        q: configuration, shape (nq,).
        joint_index: `Arm.joint_index`, shape (2, nv).
        out: e = q ⊖ q_goal [rad or m], shape (nv,), overwritten.
    """
    for i in range(out.shape[0]):
        k = joint_index[0, i]
        if joint_index[1, i]:
            sine = q_goal[k] * q[k + 1] - q_goal[k + 1] * q[k]
            cosine = q_goal[k] * q[k] + q_goal[k + 1] * q[k + 1]
            out[i] = math.atan2(sine, cosine)
        else:
            out[i] = q[k] - q_goal[k]


@compiled_lean_part
def write_configuration(angles: Array, joint_index: NDArray[np.int64], out: Array) -> None:
    """Write the configuration (nq,) of joint positions (nv,) [rad or m] into `out`."""
    for i in range(angles.shape[0]):
        k = joint_index[0, i]
        if joint_index[1, i]:
            out[k], out[k + 1] = math.cos(angles[i]), math.sin(angles[i])
        else:
            out[k] = angles[i]


@compiled_lean_part
def place_joints(
    parent: NDArray[np.int64],
    joints: Array,
    angles: Array,
    step: Array,
    share: float,
    joint_pose: Array,
) -> None:
    """Write where joints are after a share of a motion.

    Args:
        parent: joint that each joint moves with (njoints,).
        joints: `joint_rows` (njoints, 16).
        angles: joint positions (nv,) [rad or m].
        step: motion of the joints (nv,) [rad or m].
        share: of the motion that was made.
        joint_pose: poses of the joints in the world (njoints, 12), overwritten.

    Source: Rodrigues' formula: Lynch and Park, Modern Robotics, eq. 3.51.
    """
    for k in range(12):
        joint_pose[0, k] = 1.0 if k in (0, 4, 8) else 0.0
    for joint in range(1, parent.size):
        row = joint_pose[joint]
        compose(joint_pose[parent[joint]], joints[joint], row)
        x, y, z = joints[joint, 12], joints[joint, 13], joints[joint, 14]
        position = angles[joint - 1] + share * step[joint - 1]
        slide = position * joints[joint, 15]
        turn = position - slide
        c, s = math.cos(turn), math.sin(turn)
        for i in range(0, 9, 3):
            a, b, d = row[i], row[i + 1], row[i + 2]
            along = a * x + b * y + d * z
            row[9 + i // 3] += slide * along
            along *= 1.0 - c
            row[i] = c * a + s * (b * z - d * y) + along * x
            row[i + 1] = c * b + s * (d * x - a * z) + along * y
            row[i + 2] = c * d + s * (a * y - b * x) + along * z


@compiled_lean_part
def compose(outer: Array, inner: Array, out: Array) -> None:
    """Write a pose that is given in the frame of another, both rows of 12 or more numbers."""
    for r in range(3):
        a, b, c = outer[3 * r], outer[3 * r + 1], outer[3 * r + 2]
        for column in range(3):
            turned = a * inner[column] + b * inner[3 + column]
            out[3 * r + column] = turned + c * inner[6 + column]
        out[9 + r] = outer[9 + r] + (a * inner[9] + b * inner[10] + c * inner[11])
