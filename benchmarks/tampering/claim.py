"""Ways to tamper with what a run is said to be a record of."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pinocchio as pin

from densarm.arm import Arm
from tampering.kind import NotPossibleError, exponent, moving_sample, regridded, with_scenario


def with_arm(run, **changes):
    return with_scenario(run, arm=Arm(replace(run.scenario.arm.description, **changes)))


def changed_urdf(run, change):
    root = ElementTree.fromstring(run.scenario.arm.description.urdf)
    change(root)
    return with_arm(run, urdf=ElementTree.tostring(root, encoding="unicode"))


def changed_limit(run, joint, key, value):
    def change(root):
        element = root.find(f"joint[@name='{run.scenario.arm.joint_names[joint]}']/limit")
        element.set(key, repr(float(value)))

    return changed_urdf(run, change)


def time_step(run, rng):
    dt = run.scenario.simulation.dt * (1.0 + exponent(rng, -3, -0.5))
    simulation = replace(run.scenario.simulation, dt=dt)
    return replace(with_scenario(run, simulation=simulation), time=dt * np.arange(len(run.q)))


def integrator(run, _):
    return with_scenario(run, simulation=replace(run.scenario.simulation, integrator="rk4"))


def mass(run, rng):
    def change(root):
        names = {*run.scenario.arm.joint_names}
        child = [j.find("child").get("link") for j in root.iter("joint") if j.get("name") in names]
        element = root.find(f"link[@name='{rng.choice(child)}']/inertial/mass")
        if element is None:
            raise NotPossibleError
        element.set("value", repr(float(element.get("value")) * (1.0 + exponent(rng, -3, -0.1))))

    return changed_urdf(run, change)


def tilted_base(run, rng):
    placement = pin.XYZQUATToSE3(np.array(run.scenario.arm.description.base_placement))
    turn = pin.exp3(exponent(rng, -3, 0) * np.array([1.0, 0.0, 0.0]))
    placement.rotation = turn @ placement.rotation
    return with_arm(run, base_placement=tuple(pin.SE3ToXYZQUAT(placement).tolist()))


def start_moved(run, rng):
    arm, step = run.scenario.arm, np.zeros(run.scenario.arm.nv)
    step[rng.integers(arm.nv)] = exponent(rng, -8, -1)
    return with_scenario(run, start=arm.integrate(run.scenario.start, step))


def goal_moved(run, rng):
    arm, step = run.scenario.arm, np.zeros(run.scenario.arm.nv)
    step[rng.integers(arm.nv)] = exponent(rng, -1.6, 0)  # 25 mrad, where 10 count as reached
    return with_scenario(run, goal=arm.integrate(run.scenario.goal, step))


def starts_in_motion(run, rng):
    k = moving_sample(run, rng)
    return with_scenario(regridded(run, np.arange(k, len(run.q))), start=run.q[k])


def ends_in_motion(run, rng):
    k = moving_sample(run, rng)
    return with_scenario(regridded(run, np.arange(k)), goal=run.q[k - 1])


def weaker(run, rng):
    share = np.abs(run.tau).max(axis=0)
    joint = int(rng.integers(share.size))
    return changed_limit(run, joint, "effort", share[joint] * (1.0 - abs(exponent(rng, -6, -0.3))))


def slower(run, rng):
    peak = np.abs(run.v).max(axis=0)
    joint = int(rng.integers(peak.size))
    return changed_limit(run, joint, "velocity", peak[joint] * (1.0 - abs(exponent(rng, -6, -0.3))))


def gentler(run, rng):
    arm, dt = run.scenario.arm, run.scenario.simulation.dt
    peak = np.abs(np.diff(run.v, axis=0)).max(axis=0) / dt
    limit, joint = arm.limits.acceleration.copy(), int(rng.integers(arm.nv))
    limit[joint] = peak[joint] * (1.0 - abs(exponent(rng, -6, -0.3)))
    return with_arm(run, acceleration=tuple(limit.tolist()))


def narrower(run, rng):
    arm = run.scenario.arm
    bounded = np.flatnonzero(np.isfinite(arm.limits.upper))
    if not bounded.size:
        raise NotPossibleError
    joint, by = int(rng.choice(bounded)), abs(exponent(rng, -7, -2))
    reached = arm.angles(run.q)[:, joint]
    if rng.random() < 0.5:
        return changed_limit(run, joint, "upper", reached.max() - by)
    return changed_limit(run, joint, "lower", reached.min() + by)
