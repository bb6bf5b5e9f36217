"""One-step replay: the recorded torque leads from each recorded state to the next."""

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.simulation.plant import Integrator, PinocchioPlant

REPLAY_TOLERANCE = 1e-9
"""Largest difference of a replayed state from the recorded one [rad, rad/s or m, m/s]."""


def replay_error(
    arm: Arm, dt: float, integrator: Integrator, q: Array, v: Array, tau: Array
) -> float:
    """Return the largest difference between each recorded state and the step that leads to it.

    Args:
        arm: the arm.
        dt: time step [s].
        integrator: the integrator that the record names.
        q: configurations (N, nq).
        v: velocities (N, nv) [rad/s or m/s].
        tau: torque held from each sample to the next (N, nv) [N·m or N].
    """
    plant = PinocchioPlant(arm, dt, integrator)
    steps = [plant.step(*state) for state in zip(q[:-1], v[:-1], tau[:-1], strict=True)]
    if not steps:
        return 0.0
    position = arm.difference(q[1:], np.array([step[0] for step in steps]))
    velocity = v[1:] - np.array([step[1] for step in steps])
    return float(max(np.abs(position).max(), np.abs(velocity).max()))
