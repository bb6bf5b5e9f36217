"""Lift a SCARA arm's quill over a wall and lower it behind: an arm from a URDF of one's own.

python examples/own_urdf.py --out .
"""

import argparse
from pathlib import Path

import densarm


def main(out: Path) -> None:
    arm = densarm.load_arm(Path(__file__).with_name("scara.urdf"))
    for joint, lower, upper in zip(
        arm.joint_names, arm.limits.lower, arm.limits.upper, strict=True
    ):
        print(f"{joint} from {lower:g} to {upper:g}")  # [rad], or [m] for the slide
    for pair in arm.excluded_pairs:
        print(f"not checked against each other: {' and '.join(pair.shapes)}, {pair.reason}")

    floor = densarm.HalfSpace(name="floor")
    wall = densarm.Box(name="wall", size=[0.3, 0.02, 0.2], position=[0.45, 0.0, 0.1])  # [m]
    world = densarm.World(arm, densarm.Scene([floor, wall]))
    start = arm.configuration([-0.9, 0.7, -0.19])  # [rad], [rad], [m]
    goal = arm.configuration([0.2, 0.7, -0.19])  # [rad], [rad], [m]

    motion = densarm.plan_motion(world, start, goal, margin=0.005)  # [m]
    run = densarm.simulate(world, densarm.DensityTracking(world, motion), start)
    print(f"{run.outcome} after {run.time[-1]:.2f} s, certified: {run.certified}")
    print(f"the quill rose to {run.q[:, 2].max() * 1e3:.0f} mm")
    densarm.save_picture(run, out / "own_urdf.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    main(parser.parse_args().out)
