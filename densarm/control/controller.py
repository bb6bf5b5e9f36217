"""Controller: joint torque from time and state."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.validation import finite_vector

_FLOAT = np.dtype(np.float64)
_NO_STATE = np.empty(0)
_UNIT_TOLERANCE = 1e-6  # of cos² + sin² of a continuous joint


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


def tracking_error(controller: Controller) -> float:
    """Return the attribute `tracking_error` of a controller that has one, else zero.

    It is how far the joint that is farthest from the reference was from it at the last call
    [rad or m].
    """
    return float(getattr(controller, "tracking_error", 0.0))


def checked_state(arm: Arm, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
    """Return q (nq,) and v (nv,) as float arrays; errors as `Controller.torque`."""
    try:
        x, y = np.ascontiguousarray(q, _FLOAT), np.ascontiguousarray(v, _FLOAT)
    except (TypeError, ValueError):  # no numbers, which the checks below say better
        x = y = _NO_STATE
    if not (x.flags.carray and y.flags.carray):  # kernels would be compiled for read-only arrays
        x, y = x.copy(), y.copy()
    if x.ndim == y.ndim == 1 and _is_state(x, y, arm.idx_q, arm.is_circle):
        return x, y
    return arm.check_configuration("configuration", q), finite_vector("velocity", v, arm.nv)


@compiled
def _is_state(q: Array, v: Array, idx_q: NDArray[np.int64], is_circle: NDArray[np.bool_]) -> bool:
    last = idx_q.size - 1
    if v.size != idx_q.size or q.size != idx_q[last] + (2 if is_circle[last] else 1):
        return False
    for i in range(v.size):
        x = q[idx_q[i]]
        if not (math.isfinite(v[i]) and math.isfinite(x)):
            return False
        y = q[idx_q[i] + 1] if is_circle[i] else 0.0
        if is_circle[i] and not abs(x * x + y * y - 1.0) < _UNIT_TOLERANCE:
            return False
    return True
