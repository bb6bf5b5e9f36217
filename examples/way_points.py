"""Pass a configuration and a pose on the way to a goal, without a stop: as near as is stated.

python examples/way_points.py
"""

import numpy as np

import densarm

TCP, DOWN = "panda_hand_tcp", (1.0, 0.0, 0.0, 0.0)


def main() -> None:
    arm = densarm.load_arm("panda")
    table = densarm.Box(name="table", size=[0.8, 1.4, 0.04], position=[0.6, 0.0, 0.1])
    wall = densarm.Box(name="wall", size=[0.3, 0.02, 0.25], position=[0.55, 0.0, 0.25])
    world = densarm.World(arm, densarm.Scene([table, wall]))

    above_wall = densarm.Pose(TCP, [0.5, 0.0, 0.5], DOWN, free="z")
    raised = arm.configuration([0.3, -0.4, 0.0, -1.8, 0.0, 1.6, 0.8])
    goal = densarm.Pose(TCP, [0.5, 0.3, 0.3], DOWN, free="z")
    start = arm.configuration([-0.5, 0.1, 0.0, -2.2, 0.0, 2.3, 0.8])
    move = densarm.MoveTo(goal, through=[above_wall, raised], blend=0.05)  # [rad] in each joint
    run = densarm.run_steps(world, start, [move])

    (phase,) = run.phases
    nearest = int(np.abs(arm.difference(raised, phase.q)).max(axis=1).argmin())
    speed = np.abs(phase.v[nearest]).max()
    print(f"{run.outcome} after {run.time[-1]:.2f} s, certified: {run.certified}")
    print(f"passes the raised posture after {phase.time[nearest]:.2f} s at {speed:.2f} rad/s")
    print(next(check.detail for check in run.certificate.checks if check.name == "way points"))


if __name__ == "__main__":
    main()
