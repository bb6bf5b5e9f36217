"""Count chatter and torque steps of the shipped scenarios in the three control forms.

python benchmarks/smoothness.py --json smoothness.json

- sign changes of the acceleration per second, summed over joints, of accelerations beyond 1 % of
  their limits: of the whole run, at rest (no joint faster than 0.02 rad/s) and near contact
  (closest pair within 20 mm);
- the largest change of the acceleration in one sample, in units of the acceleration limit, at the
  same place: M^-1 times the torque step. What a bounded acceleration can do is 2; a jerk that is
  bounded keeps it far below. Steps above 0.2 are counted.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import densarm
from densarm import Run
from densarm.arms.catalogue import scenario_paths
from densarm.scenarios.scenario import ControlForm
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenarios", nargs="+", default=sorted(scenario_paths()))
    parser.add_argument("--json", metavar="FILE")
    args = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for name in args.scenarios:
        scenario = densarm.load_scenario(name)
        for form in ControlForm:
            try:
                control = replace(scenario.control, form=form)
                run = densarm.run(replace(scenario, control=control))
            except densarm.DensarmError as error:
                print(f"{scenario.name}, {form}: {error}")
                continue
            row = {"scenario": scenario.name, "form": str(form), **counts(run)}
            if not rows:
                print("".join(f"{key:>17}" for key in row))
            rows.append(row)
            texts = (f"{x:.3g}" if isinstance(x, float) else str(x) for x in row.values())
            print("".join(f"{text:>17}" for text in texts), flush=True)
    if args.json:
        Path(args.json).write_text(json.dumps({"rows": rows}, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
