"""Controllers: joint torque, or velocity, from time and state."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive
from densarm.values.documented import documented, in_short
from densarm.values.kernels import compiled, entry_point

_FLOAT = np.dtype(np.float64)
_NO_STATE = np.empty(0)
_ROUNDING = 1e-9  # relative, of torques at their limits
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


class VelocityController(Protocol):
    """A feedback law for a system that moves with the velocity it is told."""

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Return the velocity to command (nv,) [rad/s or m/s]; else as `Controller.torque`."""
        ...


class ToldByGoal:
    """A controller whose `repr` names its arm and its goal."""

    _arm: Arm

    def __repr__(self) -> str:
        goal = getattr(self, "goal", None)
        shown = in_short(self._arm.angles(goal)) if isinstance(goal, np.ndarray) else str(goal)
        return f"{type(self).__name__}({self._arm.name!r} to {shown})"


@documented
@dataclass(frozen=True)
class Gains:
    """K_p and K_v, the same on every joint; critically damped by default.

    Raises:
        InvalidValueError: a gain that is not positive.
    """

    position: float = 400.0
    """K_p [1/s²], on the density's gradient."""
    velocity: float = 40.0
    """K_v [1/s], on the velocity error."""

    @property
    def rate(self) -> float:
        """λ = K_p / K_v [1/s]: the velocity at which K_p ∇ρ and K_v q̇ balance, per ∇ρ."""
        return self.position / self.velocity

    def __post_init__(self) -> None:
        positive("position", self.position)
        positive("velocity", self.velocity)


def checked_state(arm: Arm, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
    """Return q (nq,) and v (nv,) as float arrays; errors as `Controller.torque`."""
    try:
        x, y = np.ascontiguousarray(q, _FLOAT), np.ascontiguousarray(v, _FLOAT)
    except (TypeError, ValueError):  # no numbers, which the checks below say better
        x = y = _NO_STATE
    if not (x.flags.carray and y.flags.carray):  # kernels would be compiled for read-only arrays
        x, y = x.copy(), y.copy()
    if x.shape == (arm.nq,) and y.shape == (arm.nv,) and _state_kernel()(x, y, arm.joint_index):
        return x, y
    return arm.check_configuration("configuration", q), finite_vector("velocity", v, arm.nv)


@cache
def _state_kernel() -> Callable[..., Any]:
    return entry_point(_is_state, np.zeros(1), np.zeros(1), np.zeros((2, 1), np.int64))


@compiled
def _is_state(q: Array, v: Array, joint_index: NDArray[np.int64]) -> bool:
    for i in range(v.size):
        k = joint_index[0, i]
        off = 0.0 * q[k]  # not a number where q is infinite
        if joint_index[1, i]:
            off = q[k] * q[k] + q[k + 1] * q[k + 1] - 1.0
        if not (abs(off) < _UNIT_TOLERANCE and math.isfinite(v[i])):
            return False
    return True


@compiled
def is_plausible(q: Array, v: Array, farthest: float, fastest: Array) -> bool:
    """Return whether no number of a state, q (nq,) and v (nv,), is beyond reason."""
    plausible = True
    for x in q:
        plausible &= abs(x) <= farthest
    for i in range(v.size):
        plausible &= abs(v[i]) <= fastest[i]
    return plausible


@compiled
def takes_torque(tau: Array, limit: Array, out: Array) -> bool:
    """Copy a torque if it is finite and within the limits up to rounding, clipped to them."""
    for i in range(tau.size):
        if not (math.isfinite(tau[i]) and abs(tau[i]) <= limit[i] * (1.0 + _ROUNDING)):
            return False
    for i in range(tau.size):
        most = limit[i]
        out[i] = most if tau[i] > most else -most if tau[i] < -most else tau[i]
    return True
