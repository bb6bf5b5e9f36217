"""Ways to tamper with what was recorded."""

from dataclasses import replace

import numpy as np

from densarm import Run
from tampering.kind import exponent, moving_sample, regridded


def position(run: Run, rng: np.random.Generator) -> Run:
    arm, q, step = run.task.arm, run.q.copy(), np.zeros(run.task.arm.nv)
    k = int(rng.integers(1, len(q)))
    step[rng.integers(arm.nv)] = exponent(rng, -7, -1)
    q[k] = arm.integrate(q[k], step)
    return replace(run, q=q)


def velocity(run: Run, rng: np.random.Generator) -> Run:
    v = run.v.copy()
    v[rng.integers(1, len(v)), rng.integers(v.shape[1])] += exponent(rng, -7, 0)
    return replace(run, v=v)


def torque(run: Run, rng: np.random.Generator) -> Run:
    """One torque in one step, off by what changes a velocity by 1e-8 rad/s or more."""
    arm, tau = run.task.arm, run.tau.copy()
    k, joint = int(rng.integers(len(tau) - 1)), int(rng.integers(arm.nv))
    column = arm.mass_matrix(run.q[k])[:, joint] / run.task.simulation.dt
    tau[k] += exponent(rng, -8, -2) * column
    return replace(run, tau=tau)


def shifted_torque(run: Run, rng: np.random.Generator) -> Run:
    return replace(run, tau=np.roll(run.tau, int(rng.integers(1, 20)), axis=0))


def skipped_sample(run: Run, rng: np.random.Generator) -> Run:
    return regridded(run, np.delete(np.arange(len(run.q)), moving_sample(run, rng)))


def repeated_sample(run: Run, rng: np.random.Generator) -> Run:
    k = moving_sample(run, rng)
    return regridded(run, np.insert(np.arange(len(run.q)), k, k))


def teleport(run: Run, rng: np.random.Generator) -> Run:
    k = moving_sample(run, rng)
    return regridded(run, np.r_[0 : k - 1, min(k + 50, len(run.q) - 1) : len(run.q)])


def swapped_joints(run: Run, rng: np.random.Generator) -> Run:
    arm = run.task.arm
    order = np.roll(np.arange(arm.nv), int(rng.integers(1, arm.nv)))
    q = arm.configurations(arm.angles(run.q)[:, order])
    return replace(run, q=q, v=run.v[:, order])


def time_stamp(run: Run, rng: np.random.Generator) -> Run:
    time = run.time.copy()
    time[rng.integers(len(time))] += exponent(rng, -8, -1)
    return replace(run, time=time)


def time_scale(run: Run, rng: np.random.Generator) -> Run:
    return replace(run, time=run.time * (1.0 + exponent(rng, -6, -0.5)))
