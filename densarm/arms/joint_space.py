"""Joint space: where motions take place, and its geometry in compiled code."""

import math
from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive_integer
from densarm.values.kernels import compiled_part


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


def sliding_joints(model: pin.Model) -> NDArray[np.bool_]:
    """Return which joints are prismatic (nv,), of a model of one degree of freedom a joint."""
    return np.array([joint_axis(model, joint)[1] for joint in range(1, model.njoints)])


@compiled_part
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


@compiled_part
def write_configuration(angles: Array, joint_index: NDArray[np.int64], out: Array) -> None:
    """Write the configuration (nq,) of joint positions (nv,) [rad or m] into `out`."""
    for i in range(angles.shape[0]):
        k = joint_index[0, i]
        if joint_index[1, i]:
            out[k], out[k + 1] = math.cos(angles[i]), math.sin(angles[i])
        else:
            out[k] = angles[i]
