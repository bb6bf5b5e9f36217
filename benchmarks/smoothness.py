"""Count chatter and torque steps of the shipped scenarios in the three control forms.

python benchmarks/smoothness.py --json smoothness.json

- sign changes of the acceleration per second, summed over joints, of accelerations beyond 1 % of
  their limits: of the whole run, at rest (no joint faster than 0.02 rad/s) and near contact
  (closest pair within 20 mm);
- the largest change of the acceleration in one sample, in units of the acceleration limit, at the
  same place: M^-1 times the torque step. What a bounded acceleration can do is 2; a jerk that is
  bounded keeps it far below. Steps above 0.2 are counted.

python benchmarks/smoothness.py --references

- the largest jerk [rad/s³] and change of torque without gravity's [N·m/ms] of each planned motion,
  between samples at its knots and between those a control law asks for there; at rest before and
  after. The exit status is 1 where one exceeds the arm's limits.
"""

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import densarm
from densarm import Run
from densarm.arms.catalogue import scenario_paths
from densarm.arms.dynamics import JointTorques
from densarm.scenarios.control import ControlForm
from densarm.scenarios.run import by_density
from densarm.scenarios.scenario import Scenario
from densarm.values.arrays import Array

COUNTED = 0.01  # share of the acceleration limit that a sign must have
SLOW = 0.02  # [rad/s]
NEAR = 0.02  # [m]
STEP = 0.2  # of the acceleration limit


def sign_changes(a: Array, limit: Array, where: NDArray[np.bool_], dt: float) -> float | None:
    """Per second of the samples where it is asked for; None without any."""
    if not where.any():
        return None
    count = 0
    for j in range(a.shape[1]):
        seen = np.flatnonzero((np.abs(a[:, j]) > COUNTED * limit[j]) & where)
        turns = np.diff(np.sign(a[seen, j])) != 0
        count += int((turns & (np.diff(seen) <= 20)).sum())
    return float(count / (where.sum() * dt))


def torque_steps(run: Run) -> Array:
    """The step of the torque at each sample as one of acceleration, in units of its limit (N,)."""
    arm = run.task.arm
    steps = np.zeros(len(run.time) - 2)
    for k in range(1, len(run.time) - 1):
        data = arm.data
        before, after = (
            pin.aba(arm.model, data, run.q[k], run.v[k], run.tau[i]).copy() for i in (k - 1, k)
        )
        steps[k - 1] = (np.abs(after - before) / arm.limits.acceleration).max()
    return steps


def counts(run: Run) -> dict[str, Any]:
    dt, limits = run.task.simulation.dt, run.task.arm.limits
    a = np.diff(run.v, axis=0) / dt
    slow, near = np.abs(run.v[1:]).max(axis=1) < SLOW, run.clearance[1:] < NEAR
    steps = torque_steps(run)
    worst = int(steps.argmax())
    return {
        "outcome": str(run.outcome),
        "duration_s": float(run.time[-1]),
        "changes": sign_changes(a, limits.acceleration, np.ones_like(slow), dt),
        "at_rest": sign_changes(a, limits.acceleration, slow, dt),
        "near": sign_changes(a, limits.acceleration, near, dt),
        "peak": float((np.abs(a) / limits.acceleration).max()),
        "largest_step": float(steps[worst]),
        "at_s": float(run.time[worst + 1]),
        "steps": int((steps > STEP).sum()),
    }


def reference(scenario: Scenario) -> dict[str, Any]:
    """The jerk and torque rate of the motion that a scenario's run tracks."""
    arm, motion = scenario.arm, by_density(scenario).motion
    assert motion is not None, "tracking has one"
    jerk, rate = np.zeros(arm.nv), np.zeros(arm.nv)
    for lead in (0.0, 0.5 * motion.period):
        times = motion.samples(motion.period).time[:-1]
        ends = [motion.sample(-1.0)], [motion.sample(motion.duration + 1.0)]
        samples = [*ends[0], *(motion.sample(t, lead) for t in times), *ends[1]]
        angles, v, a = np.stack(samples, axis=1)
        q, torques = arm.configurations(angles), JointTorques(arm)
        torque = torques(q, v, a) - torques(q, 0.0 * v, 0.0 * a)
        jerk = np.maximum(jerk, np.abs(np.diff(a, axis=0)).max(axis=0) / motion.period)
        rate = np.maximum(rate, np.abs(np.diff(torque, axis=0)).max(axis=0) / motion.period)
    return {
        "duration_s": motion.duration,
        "jerk": float(jerk.max()),
        "torque_rate": 1e-3 * float(rate.max()),
        "within": bool((jerk <= arm.limits.jerk).all() and (rate <= arm.limits.torque_rate).all()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", nargs="+", default=sorted(scenario_paths()))
    parser.add_argument("--references", action="store_true", help="of planned motions alone")
    parser.add_argument("--json", metavar="FILE")
    args = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for name in args.scenarios:
        scenario = densarm.load_scenario(name)
        for form in [scenario.control.form] if args.references else ControlForm:
            try:
                control = replace(scenario.control, form=form)
                own = replace(scenario, control=control)
                measured = reference(own) if args.references else counts(densarm.run(own))
            except densarm.DensarmError as error:
                print(f"{scenario.name}, {form}: {error}")
                continue
            row = {"scenario": scenario.name, "form": str(form), **measured}
            if not rows:
                print("".join(f"{key:>17}" for key in row))
            rows.append(row)
            texts = (f"{x:.3g}" if isinstance(x, float) else str(x) for x in row.values())
            print("".join(f"{text:>17}" for text in texts), flush=True)
    if args.json:
        Path(args.json).write_text(json.dumps({"rows": rows}, indent=2), encoding="utf-8")
    sys.exit(int(not all(row.get("within", True) for row in rows)))


if __name__ == "__main__":
    main()
