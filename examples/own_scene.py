"""Carry a held box past a rack: a scene from MoveIt, a table from Python, a body in the hand.

python examples/own_scene.py --out .
"""

import argparse
from pathlib import Path

import densarm


def main(out: Path) -> None:
    held = densarm.Attachment(
        densarm.Box(name="parcel", size=[0.1, 0.1, 0.15], position=[0.0, 0.0, 0.08]),  # [m]
        link="tool0",
        touch_links=["wrist_3_link"],
        mass=0.8,  # [kg]
    )
    arm = densarm.load_arm("ur5").holding(held)
    moveit = densarm.load_scene(Path(__file__).with_name("workbench.scene"))
    table = densarm.HalfSpace(name="table")  # all that lies below z = 0
    world = densarm.World(arm, densarm.Scene([*moveit, table]))
    start = arm.configuration([0.7, -1.2, 1.8, -2.17, -1.57, 0.0])  # [rad]
    goal = arm.configuration([-0.8, -1.2, 1.8, -2.17, -1.57, 0.0])  # [rad]

    for name, q in (("start", start), ("goal", goal)):
        sample = world.clearance(q)
        k = sample.distance.argmin()
        print(f"{name}: {sample.distance[k] * 1e3:.0f} mm between {' and '.join(sample.pairs[k])}")

    motion = densarm.plan_motion(world, start, goal)
    run = densarm.simulate(world, densarm.DensityTracking(world, motion), start)
    print(f"{run.outcome} after {run.time[-1]:.2f} s, certified: {run.certified}")
    print(f"{world.n_pairs} pairs, never closer than {run.clearance.min() * 1e3:.1f} mm")
    densarm.save_picture(run, out / "own_scene.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(), help="folder for the results")
    main(parser.parse_args().out)
