"""Plan for a robot that follows positions: a trajectory for its own controller, as CSV and JSON.

python examples/plan_only.py --out .
"""

import argparse
import json
from pathlib import Path

import numpy as np

import densarm


def main(out: Path) -> None:
    scenario = densarm.load_scenario("ur5_bin")
    motion = densarm.plan_motion(scenario.world, scenario.start, scenario.goal)
    samples = motion.samples(0.008)  # [s], the cycle of a UR5
    names = scenario.arm.joint_names

    # Time, positions, velocities and accelerations in SI units, for any controller.
    header = ["time", *(f"{kind}_{name}" for kind in samples._fields[1:] for name in names)]
    rows = np.column_stack(samples)
    np.savetxt(out / "plan_only.csv", rows, "%.9g", ",", header=",".join(header), comments="")

    # The shape of ROS's trajectory_msgs/JointTrajectory, without ROS.
    trajectory = samples.joint_trajectory(names)
    (out / "plan_only.json").write_text(json.dumps(trajectory), encoding="utf-8")

    print(f"{motion.duration:.2f} s in {len(samples.time)} points of {len(names)} joints")
    if motion.tube is not None:  # what a robot may lag behind, and still touches nothing
        print(f"proved clear within {motion.tube.min():.4f} rad of it in every joint")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    main(parser.parse_args().out)
