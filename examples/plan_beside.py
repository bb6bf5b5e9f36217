"""A process plans again while the loop goes on: a ball rolls into the arm's way, and stays there.

python examples/plan_beside.py
"""

import time

import numpy as np
import pinocchio as pin

import densarm
from densarm.control.planning_process import PlanningProcess
from densarm.control.replanning import Replanning

DT = 2e-3  # [s]
PLACE, ROLLS = np.array([1.2, 0.0, 0.55]), 1.2  # [m], and for how long [s]
SPEED = np.array([-0.5, 0.0, 0.0])  # [m/s]


def main() -> None:
    ball = densarm.Sphere(name="ball", radius=0.1, position=PLACE)
    arm = densarm.load_arm("panda", shapes="capsule")
    world = densarm.World(arm, densarm.Scene([ball]))
    start = arm.configuration([0.9, 0.3, 0.0, -1.6, 0.0, 2.0, 0.8])  # [rad]
    goal = arm.configuration([-0.9, 0.3, 0.0, -1.6, 0.0, 2.0, 0.8])
    tracking = densarm.DensityTracking(world, densarm.plan_motion(world, start, goal, period=DT))

    data, q, v = arm.model.createData(), start, np.zeros(arm.nv)
    smallest = np.inf
    with PlanningProcess(world, tracking, goal) as planner:
        controller = Replanning(arm, goal, tracking, planner, patience=0.5, period=DT)
        began = time.perf_counter()
        for k in range(int(6.0 / DT)):
            t = k * DT
            rolls = t < ROLLS
            world.move_obstacle("ball", PLACE + min(t, ROLLS) * SPEED, velocity=rolls * SPEED)
            tau = controller.torque(t, q, v)  # [N·m]
            a = pin.aba(arm.model, data, q, v, tau)  # [rad/s²]
            q, v = pin.integrate(arm.model, q, v * DT), v + a * DT
            smallest = min(smallest, float(world.distances(q).min()))
            time.sleep(max(0.0, began + t + DT - time.perf_counter()))

    times = ", ".join(f"{t:.1f}" for t in controller.replanned_at)
    print(f"planned again at t = {times} s; clearance at least {1e3 * smallest:.1f} mm")
    print(f"{np.abs(arm.difference(goal, q)).max():.1e} rad from the goal")


if __name__ == "__main__":
    main()
