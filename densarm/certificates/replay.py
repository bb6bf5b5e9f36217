"""One-step replay: the recorded torque leads from each recorded state to the next."""

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.simulation.plant import Integrator

REPLAY_TOLERANCE = 1e-9
"""Largest difference of a replayed state from the recorded one [rad, rad/s or m, m/s]."""


def replay_errors(
    arm: Arm, dt: float, integrator: Integrator, q: Array, v: Array, tau: Array
) -> Array:
    """Return the largest difference between each recorded state and the step that leads to it.

    Args:
        arm: the arm.
        dt: time step [s].
        integrator: the integrator that the record names.
        q: configurations (N, nq).
        v: velocities (N, nv) [rad/s or m/s].
        tau: torque held from each sample to the next (N, nv) [N·m or N].

    Returns:
        One difference for each step (N - 1,) [rad, rad/s or m, m/s].
    """
    step = {
        Integrator.SEMI_IMPLICIT_EULER: _semi_implicit_euler,
        Integrator.RK4: _rk4,
    }[integrator]
    position, velocity = step(_Accelerations(arm, tau[:-1]), dt, arm.angles(q[:-1]), v[:-1])
    position = arm.difference(arm.configurations(position), q[1:])
    largest = np.maximum(np.abs(position), np.abs(velocity - v[1:]))
    return np.asarray(largest.max(axis=1))


class _Accelerations:
    """Accelerations of an arm under torques, at many states at once."""

    def __init__(self, arm: Arm, tau: Array) -> None:
        self._arm = arm
        self._pool = pin.ModelPool(arm.model, 1)
        self._tau = np.asfortranarray(tau.T)

    def __call__(self, angles: Array, v: Array) -> Array:
        q = np.asfortranarray(self._arm.configurations(angles).T)
        columns = pin.abaInParallel(1, self._pool, q, np.asfortranarray(v.T), self._tau)
        # Pinocchio drops the axis of a single joint, and of a single state.
        return np.asarray(columns).T.reshape(v.shape)


def _semi_implicit_euler(
    acceleration: _Accelerations, dt: float, angles: Array, v: Array
) -> tuple[Array, Array]:
    v = v + dt * acceleration(angles, v)
    return angles + dt * v, v


def _rk4(acceleration: _Accelerations, dt: float, angles: Array, v: Array) -> tuple[Array, Array]:
    a1 = acceleration(angles, v)
    v2 = v + 0.5 * dt * a1
    a2 = acceleration(angles + 0.5 * dt * v, v2)
    v3 = v + 0.5 * dt * a2
    a3 = acceleration(angles + 0.5 * dt * v2, v3)
    v4 = v + dt * a3
    a4 = acceleration(angles + dt * v3, v4)
    mean_v, mean_a = v + 2.0 * v2 + 2.0 * v3 + v4, a1 + 2.0 * a2 + 2.0 * a3 + a4
    return angles + dt / 6.0 * mean_v, v + dt / 6.0 * mean_a
