"""Bounds on how far, and how far off a straight line, bodies move along a joint-space segment."""

import math

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled


@compiled
def write_motion_bounds(
    parent: NDArray[np.int64],
    joints: Array,
    joint: NDArray[np.int64],
    ball: Array,
    lever: Array,
    is_asked: NDArray[np.bool_],
    step: Array,
    share: float,
    joint_pose: Array,
    shape_pose: Array,
    motion: Array,
    bend: Array,
) -> None:
    r"""Write, for shapes seen from each joint that moves them, bounds on their motion.

    Let joint positions move at constant rates u_j over a unit of time, and let the point p of a
    shape be seen from the frame of a joint c. Over the joints j between c and the shape,

    .. math:: |p'| \le \mu_c = \sum_j r_j |u_j|, \qquad
        |p''| \le \beta_c = \sum_j \omega_j (r_j |u_j| + 2 \mu_j),

    ω_j = |u_j| for joints that turn and 0 for those that slide, r_j a bound on the distance of the
    shape from the axis of joint j (1 if it slides). Between the middle of the motion and either
    end that distance changes by no more than half of μ_j.

    Args:
        parent: of each joint (njoints,).
        joints: the table of joints (njoints, 16).
        joint: that moves each shape (S,).
        ball: radius of a ball around each shape (S,) [m].
        lever: bound on r_j over all configurations (S, nv) [m, 1 for prismatic joints].
        is_asked: for which shapes the bounds are wanted (S,).
        step: motion of the joints (nv,) [rad or m].
        share: of the motion that is made.
        joint_pose: poses of the joints in the middle of it (njoints, 12 or more).
        shape_pose: poses of the shapes there (S, 12).
        motion: the bounds μ_c (S, njoints) [m], overwritten where c moves the shape or is 0.
        bend: the bounds β_c (S, njoints) [m], overwritten alike.
    """
    for shape in range(joint.size):
        if not is_asked[shape]:
            continue
        moved = bent = 0.0
        j = joint[shape]
        while j > 0:
            motion[shape, j], bend[shape, j] = moved, bent
            across = _across(joints, j, joint_pose, shape_pose, shape)
            slides, rate = joints[j, 15], share * abs(step[j - 1])
            reach = slides + (1.0 - slides) * (across + 0.5 * moved + ball[shape])
            farthest = lever[shape, j - 1]
            travel = rate * (min(farthest, reach))
            bent += (1.0 - slides) * rate * (travel + 2.0 * moved)
            moved += travel
            j = parent[j]
        motion[shape, 0], bend[shape, 0] = moved, bent


@compiled
def _across(joints: Array, joint: int, joint_pose: Array, shape_pose: Array, shape: int) -> float:
    """Return how far the middle of a shape is from the axis of a joint [m]."""
    x, y, z = joints[joint, 12], joints[joint, 13], joints[joint, 14]
    a = joint_pose[joint, 0] * x + joint_pose[joint, 1] * y + joint_pose[joint, 2] * z
    b = joint_pose[joint, 3] * x + joint_pose[joint, 4] * y + joint_pose[joint, 5] * z
    c = joint_pose[joint, 6] * x + joint_pose[joint, 7] * y + joint_pose[joint, 8] * z
    x = shape_pose[shape, 9] - joint_pose[joint, 9]
    y = shape_pose[shape, 10] - joint_pose[joint, 10]
    z = shape_pose[shape, 11] - joint_pose[joint, 11]
    along = a * x + b * y + c * z
    return math.sqrt(max(0.0, x * x + y * y + z * z - along * along))
