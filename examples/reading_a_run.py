"""Read a recorded run: how it ended, what is proved, where it was close, what the joints did.

densarm run swing_up --save swing_up.npz
python examples/reading_a_run.py swing_up.npz --out .
"""

import argparse
from pathlib import Path

import numpy as np

import densarm


def main(file: Path, out: Path) -> None:
    run = densarm.Run.load(file)
    arm, scene = run.task.arm, run.task.scene
    print(f"{run.task.title}: {run.outcome} after {run.time[-1]:.2f} s")

    for check in run.certificate.checks:  # computed anew from what the file holds
        print(f"  {check.name:<10}{'proved' if check.holds else 'not proved'}: {check.detail}")

    world = densarm.World(arm, scene)
    print("clearance over time")
    for k in np.linspace(0, len(run.time) - 1, 6).astype(int):
        sample = world.clearance(run.q[k])
        pair = sample.pairs[sample.distance.argmin()]
        print(f"  {run.time[k]:5.2f} s{run.clearance[k] * 1e3:8.1f} mm  {' and '.join(pair)}")

    speed = np.abs(run.v).max(axis=0) / arm.limits.velocity
    torque = np.abs(run.tau).max(axis=0) / arm.limits.effort
    print("peaks, in units of the limits")
    for joint, v, tau in zip(arm.joint_names, speed, torque, strict=True):
        print(f"  {joint}: velocity {v:.2f}, torque {tau:.2f}")

    densarm.save_plot(run, out / "reading_a_run_plot.png")
    densarm.save_picture(run, out / "reading_a_run.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path, help="a run that `densarm run --save` wrote")
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    arguments = parser.parse_args()
    main(arguments.file, arguments.out)
