"""Take a can from a table and put it down elsewhere: steps, one run, one certificate.

python examples/pick_and_place.py
"""

import densarm

TCP, DOWN = "panda_hand_tcp", (1.0, 0.0, 0.0, 0.0)


def main() -> None:
    arm = densarm.load_arm("panda")
    table = densarm.Box(name="table", size=[0.8, 1.4, 0.04], position=[0.6, 0.0, 0.1])
    can = densarm.Cylinder(name="can", radius=0.033, length=0.12, position=[0.5, -0.2, 0.18])
    world = densarm.World(arm, densarm.Scene([table, can]))

    # The first grasp would lead a finger into the can, so that the second is taken.
    grasps = [densarm.Pose(TCP, [0.5, y, 0.315], DOWN) for y in (-0.17, -0.2)]
    run = densarm.run_steps(
        world,
        arm.postures["ready"],
        [
            densarm.MoveTo(grasps),
            densarm.Line(TCP, along=[0.0, 0.0, 0.1]),  # approach along the hand's own z [m]
            densarm.Grip({"panda_finger_joint1": 0.0335}),  # [m], short of touching it
            densarm.Attach("can", "panda_hand", mass=0.35, support="table"),  # [kg]
            densarm.Line(TCP, by=[0.0, 0.0, 0.1]),  # lift, upwards in the world [m]
            # What points up of the hand, and so of the can, stays within 0.1 rad of that.
            densarm.MoveTo(densarm.Pose(TCP, [0.5, 0.2, 0.315], DOWN, free="z"), upright=TCP),
            densarm.Line(TCP, by=[0.0, 0.0, -0.1]),
            densarm.Detach("can", support="table"),
            densarm.Grip({"panda_finger_joint1": 0.038}),
            densarm.Line(TCP, along=[0.0, 0.0, -0.1]),
        ],
    )
    for phase in run.phases:
        print(f"{phase.time[-1]:.2f} s  {phase.task.title}")
    print(f"{run.outcome} after {run.time[-1]:.1f} s, certified: {run.certified}")
    print(run.remark)


if __name__ == "__main__":
    main()
