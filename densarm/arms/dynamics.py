"""Kinematics and M of one configuration, torques of many states, and what holding still needs."""

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.values.arrays import Array
from densarm.values.kernels import compiled_part


class Kinematics:
    """What distances and inverse dynamics read alike, computed in one pass.

    The composite-rigid-body algorithm passes placements and Jacobian on its way to M, which costs
    little more than the first two.

    Attributes:
        data: Pinocchio's data, its placements those of the last update.
        jacobian: world-frame joint Jacobian (6, nv) at the last update.
        mass_matrix: M (nv, nv) at the last update, of which only the upper triangle is filled.
    """

    def __init__(self, arm: Arm) -> None:
        self.model = arm.model
        self.data: pin.Data = arm.model.createData()
        self.jacobian = by_columns(self.data.J, (6, arm.nv))
        self.mass_matrix = by_columns(self.data.M, (arm.nv, arm.nv))
        self.update(pin.neutral(arm.model))

    def update(self, q: Array) -> None:
        """Compute everything at q (nq,)."""
        pin.crba(self.model, self.data, q, pin.Convention.WORLD)


def by_columns(matrix: Array, shape: tuple[int, int]) -> Array:
    """Return a view of a matrix of Pinocchio, which it keeps by columns, as one of a shape.

    Pinocchio drops the axis of a single joint; kernels know columns by their strides.
    """
    stride = matrix.itemsize * max(shape[0], 2)
    return np.lib.stride_tricks.as_strided(matrix, shape, (matrix.itemsize, stride))


@compiled_part
def mass_entry(mass: Array, i: int, j: int) -> float:
    """Return an entry of M, of which Pinocchio fills the upper triangle."""
    entry: float = mass[i, j] if i <= j else mass[j, i]
    return entry


class JointTorques:
    """Torques of many states and accelerations in one call."""

    def __init__(self, arm: Arm) -> None:
        self._pool = pin.ModelPool(arm.model, 1)  # which takes longer to make than a call

    def __call__(self, q: Array, v: Array, a: Array) -> Array:
        """Return M(q) a + H(q, v), the torques (..., nv) [N·m or N].

        Args:
            q: configurations (..., nq).
            v: velocities (..., nv) [rad/s or m/s].
            a: accelerations (..., nv) [rad/s² or m/s²].
        """
        columns = [np.asfortranarray(x.reshape(-1, x.shape[-1]).T) for x in (q, v, a)]
        torques = pin.rneaInParallel(1, self._pool, *columns)
        # Pinocchio drops the axis of a single joint, and of a single state.
        return np.asarray(torques).T.reshape(v.shape)


def holding_ratios(arm: Arm, q: Array) -> Array:
    """Return the torque that holds the arm at q (nq,), in units of the limits (nv,)."""
    return np.asarray(np.abs(_holding(arm, q)) / arm.limits.effort)


def holding_torque(arm: Arm, q: Array) -> str:
    """Return, as a phrase, what holding the arm at q (nq,) asks of the joint nearest its limit."""
    joint = int(holding_ratios(arm, q).argmax())
    where = ", ".join(f"{angle:.4g}" for angle in arm.angles(q))
    slides = "P" in arm.model.joints[joint + 1].shortname().removeprefix("JointModel")[:1]
    unit = "N" if slides else "N·m"
    return (
        f"joint {arm.joint_names[joint]!r} needs {abs(_holding(arm, q)[joint]):.4g} {unit} to hold "
        f"the arm at joint positions ({where}), and has {arm.limits.effort[joint]:.4g}"
    )


def _holding(arm: Arm, q: Array) -> Array:
    return np.array(pin.computeGeneralizedGravity(arm.model, arm.data, q))
