"""Carry Panda's hand over a wall on a table: world, plan, control and run, step by step.

python examples/panda_table.py --out .
"""

import argparse
from pathlib import Path

import densarm


def main(out: Path) -> None:
    arm = densarm.load_arm("panda")
    scene = densarm.Scene(
        [
            densarm.Box(
                name="table",
                size=[0.8, 1.4, 0.04],  # [m]
                position=[0.6, 0.0, 0.1],  # [m]
            ),
            densarm.Box(
                name="wall",
                size=[0.5, 0.03, 0.2],  # [m]
                position=[0.6, 0.0, 0.22],  # [m]
            ),
            densarm.Sphere(
                name="lamp",
                radius=0.1,  # [m]
                position=[0.5, 0.0, 0.95],  # [m]
            ),
        ]
    )
    world = densarm.World(arm, scene)
    start = arm.configuration([0.5, 0.3, 0.0, -2.0, 0.0, 2.3, 0.8])  # [rad]
    goal = arm.configuration([-0.5, 0.3, 0.0, -2.0, 0.0, 2.3, 0.8])  # [rad]

    motion = densarm.plan_motion(world, start, goal, margin=0.005)  # [m]
    controller = densarm.DensityTracking(world, motion)
    run = densarm.simulate(world, controller, start, title="Carry Panda's hand over a wall")

    print(f"{motion.duration:.2f} s, planned in {motion.plan_time * 1e3:.0f} ms")
    print(run.outcome.description, run.detail)
    print(f"certified: {run.certified}, clearance at least {run.clearance.min() * 1e3:.1f} mm")
    densarm.save_html(run, out / "panda_table.html")
    densarm.save_plot(run, out / "panda_table.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    main(parser.parse_args().out)
