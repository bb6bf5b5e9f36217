"""JointTorques: inverse dynamics of many states at once."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array


class JointTorques:
    """Torques of many states and accelerations in one call.

    Args:
        arm: its dynamics.
    """

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
