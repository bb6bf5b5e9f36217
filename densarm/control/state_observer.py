"""StateObserver: where the dynamics say that an arm is."""

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.control.guard_tolerances import GuardTolerances


class StateObserver:
    r"""Propagates a state by the dynamics, and draws it towards measurements that agree with it.

    .. math::

        \dot{\hat v} = M^{-1} (\tau - H) + (v - \hat v) / T, \qquad
        \dot{\hat q} = \hat v + (q \ominus \hat q) / T

    A measurement agrees if each joint's differences are within the tolerances. One that does not
    is left out: the observed state then follows the dynamics alone.

    Args:
        arm: its dynamics.
        fastest: bound on the observed velocity (nv,) [rad/s or m/s].
        tolerances: T is their `memory`.

    Source: D. G. Luenberger, An introduction to observers, IEEE TAC 1971.
    """

    def __init__(self, arm: Arm, fastest: Array, tolerances: GuardTolerances) -> None:
        self._arm = arm
        self._data = arm.model.createData()
        self._tolerances = tolerances
        self._fastest = fastest
        self._angles = np.zeros(arm.nv)
        self.q: Array = arm.configurations(self._angles)
        """Observed configuration (nq,), overwritten by the next call."""
        self.v: Array = np.zeros(arm.nv)
        """Observed velocity (nv,) [rad/s or m/s], overwritten by the next call."""
        # Kernels are loaded, or compiled, here rather than in a control loop.
        self.advance(0.0, 1.0, self.v)
        self.agrees(self.q, self.v, 0.0)

    def start(self, q: Array, v: Array) -> None:
        """Begin at a state, q (nq,) and v (nv,)."""
        self.q[:], self.v[:], self._angles[:] = q, v, self._arm.angles(q)

    def advance(self, time: float, step: float, tau: Array) -> None:
        """Follow the dynamics.

        Args:
            time: how far [s].
            step: longest step [s].
            tau: torque held meanwhile (nv,) [N·m or N].
        """
        n = max(math.ceil(time / step - 1e-6), 1)
        for _ in range(n):
            a = pin.aba(self._arm.model, self._data, self.q, self.v, tau)
            _advance(
                time / n,
                a,
                self._fastest,
                self._arm.idx_q,
                self._arm.is_circle,
                self._angles,
                self.v,
                self.q,
            )

    def agrees(self, q: Array, v: Array, time: float) -> bool:
        """Return whether a measurement agrees; if so, draw the observed state towards it.

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            time: since the last measurement [s]; zero for one that tells nothing new.
        """
        return _draw(
            q,
            v,
            min(time / self._tolerances.memory, 1.0),
            self._tolerances.position,
            self._tolerances.velocity,
            self._arm.idx_q,
            self._arm.is_circle,
            self._angles,
            self.v,
            self.q,
        )


@compiled
def _write(angles: Array, idx_q: NDArray[np.int64], is_circle: NDArray[np.bool_], q: Array) -> None:
    for i in range(angles.size):
        if is_circle[i]:
            q[idx_q[i]], q[idx_q[i] + 1] = math.cos(angles[i]), math.sin(angles[i])
        else:
            q[idx_q[i]] = angles[i]


@compiled
def _advance(
    dt: float,
    a: Array,
    fastest: Array,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    angles: Array,
    v: Array,
    q: Array,
) -> None:
    for i in range(v.size):
        if math.isfinite(a[i]):
            v[i] = min(max(v[i] + dt * a[i], -fastest[i]), fastest[i])
        angles[i] += dt * v[i]
    _write(angles, idx_q, is_circle, q)


@compiled
def _draw(
    q: Array,
    v: Array,
    share: float,
    position: float,
    velocity: float,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    angles: Array,
    v_observed: Array,
    q_observed: Array,
) -> bool:
    for i in range(v.size):
        off = abs(_difference(q, idx_q[i], is_circle[i], angles[i]))
        if off > position or abs(v[i] - v_observed[i]) > velocity:
            return False
    for i in range(v.size):
        angles[i] += share * _difference(q, idx_q[i], is_circle[i], angles[i])
        v_observed[i] += share * (v[i] - v_observed[i])
    _write(angles, idx_q, is_circle, q_observed)
    return True


@compiled
def _difference(q: Array, k: int, is_circle: bool, angle: float) -> float:
    if not is_circle:
        return float(q[k] - angle)
    c, s = math.cos(angle), math.sin(angle)
    return math.atan2(q[k + 1] * c - q[k] * s, q[k] * c + q[k + 1] * s)
