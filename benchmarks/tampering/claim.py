"""Ways to tamper with what a run is said to be a record of."""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from densarm import Run
from densarm.arms.arm import Arm
from densarm.certificates.task import Integrator
from tampering.kind import NotPossibleError, exponent, moving_sample, regridded, with_task


def with_arm(run: Run, **changes: Any) -> Run:
    return with_task(run, arm=Arm(replace(run.task.arm.description, **changes)))


def changed_urdf(run: Run, change: Callable[[ElementTree.Element], None]) -> Run:
    root = ElementTree.fromstring(run.task.arm.description.urdf)
    change(root)
    return with_arm(run, urdf=ElementTree.tostring(root, encoding="unicode"))


def changed_limit(run: Run, joint: int, key: str, value: float) -> Run:
    def change(root: ElementTree.Element) -> None:
        element = root.find(f"joint[@name='{run.task.arm.joint_names[joint]}']/limit")
        assert element is not None
        element.set(key, repr(float(value)))

    return changed_urdf(run, change)


def time_step(run: Run, rng: np.random.Generator) -> Run:
    dt = run.task.simulation.dt * (1.0 + exponent(rng, -3, -0.5))
    simulation = replace(run.task.simulation, dt=dt)
    return replace(
        with_task(run, simulation=simulation), time=dt * np.arange(len(run.q), dtype=np.float64)
    )


def integrator(run: Run, _: object) -> Run:
    return with_task(run, simulation=replace(run.task.simulation, integrator=Integrator.RK4))


def mass(run: Run, rng: np.random.Generator) -> Run:
    def change(root: ElementTree.Element) -> None:
        names = {*run.task.arm.joint_names}
        joints = [joint for joint in root.iter("joint") if joint.get("name") in names]
        links = [str(child.get("link")) for joint in joints for child in joint.iter("child")]
        element = root.find(f"link[@name='{rng.choice(links)}']/inertial/mass")
        if element is None:
            raise NotPossibleError
        element.set(
            "value", repr(float(element.get("value", "0")) * (1.0 + exponent(rng, -3, -0.1)))
        )

    return changed_urdf(run, change)


def tilted_base(run: Run, rng: np.random.Generator) -> Run:
    placement = pin.XYZQUATToSE3(np.array(run.task.arm.description.base_placement))
    turn = pin.exp3(exponent(rng, -3, 0) * np.array([1.0, 0.0, 0.0]))
    placement.rotation = turn @ placement.rotation
    return with_arm(run, base_placement=tuple(pin.SE3ToXYZQUAT(placement).tolist()))


def start_moved(run: Run, rng: np.random.Generator) -> Run:
    arm, step = run.task.arm, np.zeros(run.task.arm.nv)
    step[rng.integers(arm.nv)] = exponent(rng, -8, -1)
    return with_task(run, start=arm.integrate(run.task.start, step))


def goal_moved(run: Run, rng: np.random.Generator) -> Run:
    arm, step = run.task.arm, np.zeros(run.task.arm.nv)
    step[rng.integers(arm.nv)] = exponent(rng, -1.6, 0)  # 25 mrad, where 10 count as reached
    assert run.task.goal is not None
    return with_task(run, goal=arm.integrate(run.task.goal, step))


def starts_in_motion(run: Run, rng: np.random.Generator) -> Run:
    k = moving_sample(run, rng)
    return with_task(regridded(run, np.arange(k, len(run.q))), start=run.q[k])


def ends_in_motion(run: Run, rng: np.random.Generator) -> Run:
    k = moving_sample(run, rng)
    return with_task(regridded(run, np.arange(k)), goal=run.q[k - 1])


def weaker(run: Run, rng: np.random.Generator) -> Run:
    share = np.abs(run.tau).max(axis=0)
    joint = int(rng.integers(share.size))
    return changed_limit(run, joint, "effort", share[joint] * (1.0 - abs(exponent(rng, -6, -0.3))))


def slower(run: Run, rng: np.random.Generator) -> Run:
    peak = np.abs(run.v).max(axis=0)
    joint = int(rng.integers(peak.size))
    return changed_limit(run, joint, "velocity", peak[joint] * (1.0 - abs(exponent(rng, -6, -0.3))))


def gentler(run: Run, rng: np.random.Generator) -> Run:
    arm, dt = run.task.arm, run.task.simulation.dt
    peak = np.abs(np.diff(run.v, axis=0)).max(axis=0) / dt
    limit, joint = arm.limits.acceleration.copy(), int(rng.integers(arm.nv))
    limit[joint] = peak[joint] * (1.0 - abs(exponent(rng, -6, -0.3)))
    return with_arm(run, acceleration=tuple(limit.tolist()))


def narrower(run: Run, rng: np.random.Generator) -> Run:
    arm = run.task.arm
    bounded = np.flatnonzero(np.isfinite(arm.limits.upper))
    if not bounded.size:
        raise NotPossibleError
    joint, by = int(rng.choice(bounded)), abs(exponent(rng, -7, -2))
    reached = arm.angles(run.q)[:, joint]
    if rng.random() < 0.5:
        return changed_limit(run, joint, "upper", reached.max() - by)
    return changed_limit(run, joint, "lower", reached.min() + by)
