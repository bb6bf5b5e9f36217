"""Joint torques: inverse dynamics of many states at once."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array


def joint_torques(arm: Arm, q: Array, v: Array, a: Array) -> Array:
    """Return M(q) a + H(q, v), the torques (..., nv) of states and accelerations [N·m or N].

    Args:
        arm: its dynamics.
        q: configurations (..., nq).
        v: velocities (..., nv) [rad/s or m/s].
        a: accelerations (..., nv) [rad/s² or m/s²].
    """
    columns = [np.asfortranarray(x.reshape(-1, x.shape[-1]).T) for x in (q, v, a)]
    torques = pin.rneaInParallel(1, pin.ModelPool(arm.model, 1), *columns)
    # Pinocchio drops the axis of a single joint, and of a single state.
    return np.asarray(torques).T.reshape(v.shape)
