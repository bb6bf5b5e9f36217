"""Ask for a pose of the hand rather than for joint angles: the nearest of its configurations.

python examples/pose_goal.py
"""

import densarm


def main() -> None:
    arm = densarm.load_arm("panda")
    table = densarm.Box(name="table", size=[0.8, 1.4, 0.04], position=[0.6, 0.0, 0.1])
    world = densarm.World(arm, densarm.Scene([table]))
    start = arm.postures["ready"]

    # From above, turned about the hand's own z as it comes.
    cup = densarm.Pose("panda_hand_tcp", [0.5, -0.35, 0.25], [1.0, 0.0, 0.0, 0.0], free="z")
    ways = world.inverse_kinematics(cup, count=8, near=start)
    print(f"{len(ways)} ways to the cup, the nearest {arm.angles(ways[0]).round(2).tolist()}")

    can = densarm.Pose("panda_hand_tcp", [0.6, 0.3, 0.3])  # its position alone
    motion = densarm.plan_motion(world, start, [cup, can])  # any will do
    run = densarm.simulate(world, densarm.DensityTracking(world, motion), start)
    print(f"{run.outcome} after {run.time[-1]:.2f} s at {arm.pose(run.q[-1])}")
    print(f"certified: {run.certified}")

    try:
        densarm.plan_motion(world, start, densarm.Pose("panda_hand_tcp", [1.4, 0.0, 0.3]))
    except densarm.PlanningError as error:
        print(error)


if __name__ == "__main__":
    main()
