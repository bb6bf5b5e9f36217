"""PoseDistance: the goal distance of a pose, which any configuration will do for that has it."""

import math

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.models import frame_index
from densarm.arms.pose import AXES, Pose
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array

LENGTH = 0.3
"""ℓ: length that an error of position counts as a radian by [m]."""

_DAMPING = 0.2  # of ‖x‖, which is what the curvature of x adds to AᵀA where it cannot be zero
_LEAST_DAMPING = 1e-4  # of directions that the joints hardly move the frame in


class PoseDistance:
    r"""Half the squared error of the position and the axes of a frame.

    .. math::

        V(q) = \tfrac12 \|x\|^2, \qquad \nabla V = A^T x, \qquad
        x = \begin{bmatrix} (p - p_d)/\ell \\ \sqrt{c_i} (r_i - d_i) \end{bmatrix}, \qquad
        A = \begin{bmatrix} J_v/\ell \\ -\sqrt{c_i}\, [r_i]_\times J_\omega \end{bmatrix}

    with p the frame's origin, r_i its three axes, p_d and d_i where they shall be, and J_v, J_ω its
    Jacobian, all in the world. For a whole pose c_i = 1/2, and what the axes add to V is

    .. math:: \tfrac14 \|R - R_d\|_F^2 = \tfrac12 \operatorname{tr}(I - R_d^T R) = 1 - \cos\theta

    with θ the angle that is left to turn. Free about an axis, that has 1 and the others 0, and θ is
    the angle to it; for a position alone all are 0.

    θ²/2 has a kink at θ = π, where log does not know which way to turn. This V is smooth
    everywhere, as a density must be: at θ = π its gradient is zero, and ρ has a critical point,
    which is left as others are. No cosine is taken, so that it keeps errors of 1e-8.

    In the metric :math:`G = A^T A + (\lambda_0 + \lambda \|x\|) I` its gradient is the step of
    Levenberg and Marquardt: straight to the pose from nearby, bounded where the arm is singular,
    and none that swings where the pose is out of reach.

    Args:
        arm: its kinematics.
        pose: where one of its frames shall be.

    Raises:
        UnknownNameError: no such frame.
        InvalidValueError: a frame that no joint moves.

    Source: F. Bullo and R. M. Murray, Proportional derivative (PD) control on the Euclidean group,
        ECC 1995, for the trace; J. Fan and Y. Yuan, On the quadratic convergence of the
        Levenberg-Marquardt method without nonsingularity assumption, Computing 74 (2005), for ‖x‖.
    """

    def __init__(self, arm: Arm, pose: Pose) -> None:
        self._arm, self._data = arm, arm.model.createData()
        self._x, self._slope, self._name = np.zeros(12), np.zeros((12, arm.nv)), ""
        self.set_pose(pose)

    def set_pose(self, pose: Pose) -> None:
        """Take another pose for the goal, of any frame.

        Raises:
            UnknownNameError: as for the class.
            InvalidValueError: as for the class.
        """
        if pose.frame != self._name:  # looking it up takes as long as V
            model, name = self._arm.model, pose.frame
            frame = frame_index(model, name)
            if model.frames[frame].parentJoint == 0:
                allowed = f"one that a joint of {self._arm.name!r} moves"
                raise InvalidValueError("frame", name, allowed)
            self._frame, self._name = frame, name
        placement = pose.placement
        self._position = placement.translation - self._arm.origin
        self._axes: Array = np.array(placement.rotation.T)
        weights = [0.5 * (pose.free is None) + (pose.free == name) for name in AXES]
        turns = pose.orientation_xyzw is not None
        self._roots: Array = np.sqrt(weights) if turns else np.zeros(3)

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:  # noqa: ARG002
        """Act as `GoalDistance.evaluate`, whatever configuration is called the goal."""
        model, data, x, slope = self._arm.model, self._data, self._x, self._slope
        pin.computeJointJacobians(model, data, q)
        frame = pin.updateFramePlacement(model, data, self._frame)
        jacobian = pin.getFrameJacobian(
            model, data, self._frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        x[:3] = (frame.translation - self._position) / LENGTH
        slope[:3] = jacobian[:3] / LENGTH
        for i, (root, axis) in enumerate(zip(self._roots, frame.rotation.T, strict=True)):
            rows = slice(3 + 3 * i, 6 + 3 * i)
            x[rows] = root * (axis - self._axes[i])
            slope[rows] = -root * pin.skew(axis) @ jacobian[3:]
        np.matmul(x, slope, out=out_gradient)
        return 0.5 * float(x @ x)

    @property
    def metric(self) -> Array:
        """G (nv, nv), where V was evaluated last."""
        damping = _LEAST_DAMPING + _DAMPING * math.sqrt(self._x @ self._x)
        return self._slope.T @ self._slope + damping * np.eye(self._arm.nv)

    def step(self) -> Array:
        """Return the step (nv,) [rad or m] to the goal from where V was evaluated last."""
        return self._solved(-self._x)

    def following(self, twist: Array) -> Array:
        """Return the velocity (nv,) [rad/s or m/s] of an arm whose frame goes with a goal.

        Args:
            twist: of the goal (6,), linear [m/s] and angular [rad/s], in the world.
        """
        rate = np.empty(12)
        rate[:3] = twist[:3] / LENGTH
        turning = self._axes @ pin.skew(twist[3:]).T
        rate[3:] = (self._roots[:, np.newaxis] * turning).ravel()
        return self._solved(rate)

    def off(self, q: Array) -> tuple[float, float]:
        """Return how far the frame is off at q (nq,): its position [m], and θ [rad]."""
        self.evaluate(q, q, np.empty(self._arm.nv))
        sine = 0.5 * float(np.linalg.norm(self._x[3:]))
        return LENGTH * float(np.linalg.norm(self._x[:3])), 2.0 * math.asin(min(sine, 1.0))

    def _solved(self, rate: Array) -> Array:
        return np.asarray(np.linalg.solve(self.metric, rate @ self._slope), dtype=np.float64)
