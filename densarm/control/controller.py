"""Controller: joint torque from time and state."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.validation import finite_vector


class Controller(Protocol):
    """A feedback law for a torque-driven arm, usable in any loop, simulated or real."""

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Return the torque to apply, within the arm's limits.

        Args:
            t: time since the motion began [s].
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].

        Returns:
            tau (nv,) [N·m or N].

        Raises:
            InvalidValueError: a state of the wrong length, or one that is not finite.
        """
        ...


def checked_state(arm: Arm, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
    """Return q (nq,) and v (nv,) as float arrays; errors as `Controller.torque`."""
    q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
    if q.shape == (arm.nq,) and v.shape == (arm.nv,) and np.isfinite(q @ q + v @ v):
        return q, v
    return arm.check_configuration("configuration", q), finite_vector("velocity", v, arm.nv)
