"""Swing three links up by the density alone, its parts put together in Python.

python examples/three_link_swing_up.py
"""

import math

import densarm


def main() -> None:
    arm = densarm.load_arm("three_link")
    balls = [
        densarm.Sphere(name=name, radius=0.15, position=[x, 0.0, -0.4])  # [m]
        for name, x in (("left", -1.15), ("right", 1.15))
    ]
    world = densarm.World(arm, densarm.Scene(balls))
    start = arm.postures["hanging"]
    for weights in (None, "inertia"):  # of the goal distance V: ones, or by the arm's masses
        try:
            motion = densarm.plan_motion(
                world,
                start,
                arm.postures["upright"],
                guide="direct",  # the goal alone, no planner
                kappa=math.inf,  # V is the sum over joints
                density=densarm.DensityParameters(weights=weights),
            )
        except densarm.PlanningError as error:
            print(f"weights {weights}: {error.outcome}, {error.detail}")
            continue
        run = densarm.simulate(world, densarm.DensityTracking(world, motion), start)
        print(f"weights {weights}: {run.outcome}, {run.remark}\ncertified: {run.certified}")


if __name__ == "__main__":
    main()
