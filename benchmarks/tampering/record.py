"""Ways to tamper with what was recorded."""

from dataclasses import replace

import numpy as np

from tampering.kind import exponent, moving_sample, regridded


def position(run, rng):
    arm, q, step = run.scenario.arm, run.q.copy(), np.zeros(run.scenario.arm.nv)
    k = int(rng.integers(1, len(q)))
    step[rng.integers(arm.nv)] = exponent(rng, -7, -1)
    q[k] = arm.integrate(q[k], step)
    return replace(run, q=q)


def velocity(run, rng):
    v = run.v.copy()
    v[rng.integers(1, len(v)), rng.integers(v.shape[1])] += exponent(rng, -7, 0)
    return replace(run, v=v)


def torque(run, rng):
    """One torque in one step, off by what changes a velocity by 1e-8 rad/s or more."""
    arm, tau = run.scenario.arm, run.tau.copy()
    k, joint = int(rng.integers(len(tau) - 1)), int(rng.integers(arm.nv))
    column = arm.mass_matrix(run.q[k])[:, joint] / run.scenario.simulation.dt
    tau[k] += exponent(rng, -8, -2) * column
    return replace(run, tau=tau)


def shifted_torque(run, rng):
    return replace(run, tau=np.roll(run.tau, int(rng.integers(1, 20)), axis=0))


def skipped_sample(run, rng):
    return regridded(run, np.delete(np.arange(len(run.q)), moving_sample(run, rng)))


def repeated_sample(run, rng):
    k = moving_sample(run, rng)
    return regridded(run, np.insert(np.arange(len(run.q)), k, k))


def teleport(run, rng):
    k = moving_sample(run, rng)
    return regridded(run, np.r_[0 : k - 1, min(k + 50, len(run.q) - 1) : len(run.q)])


def swapped_joints(run, rng):
    arm = run.scenario.arm
    order = np.roll(np.arange(arm.nv), int(rng.integers(1, arm.nv)))
    q = arm.configurations(arm.angles(run.q)[:, order])
    return replace(run, q=q, v=run.v[:, order])


def time_stamp(run, rng):
    time = run.time.copy()
    time[rng.integers(len(time))] += exponent(rng, -8, -1)
    return replace(run, time=time)


def time_scale(run, rng):
    return replace(run, time=run.time * (1.0 + exponent(rng, -6, -0.5)))
