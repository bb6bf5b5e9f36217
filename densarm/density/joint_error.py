"""Joint error: the difference of two configurations of an arm, joint by joint."""

import math

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled


@compiled
def joint_error(
    q_goal: Array,
    q: Array,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    out: Array,
) -> None:
    r"""Write the tangent-space error of each joint.

    .. math::

        e_i = q_i - q^{goal}_i \ \text{(bounded)}, \qquad
        e_i = \operatorname{atan2}(\sin(q_i - q^{goal}_i), \cos(q_i - q^{goal}_i))
        \ \text{(circle)}

    Args:
        q_goal: goal configuration, shape (nq,); a circle joint is (cos, sin).
        q: configuration, shape (nq,).
        idx_q: first index in a configuration of each joint, shape (nv,).
        is_circle: whether the joint is a circle, shape (nv,).
        out: e = q ⊖ q_goal [rad or m], shape (nv,), overwritten.
    """
    for i in range(out.shape[0]):
        k = idx_q[i]
        if is_circle[i]:
            sine = q_goal[k] * q[k + 1] - q_goal[k + 1] * q[k]
            cosine = q_goal[k] * q[k] + q_goal[k + 1] * q[k + 1]
            out[i] = math.atan2(sine, cosine)
        else:
            out[i] = q[k] - q_goal[k]
