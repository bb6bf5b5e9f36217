"""Drive an arm by `controller.torque` in a loop of one's own, here with friction in the joints.

python examples/own_control_loop.py
"""

import numpy as np
import pinocchio as pin

import densarm

DT = 5e-4  # [s]
FRICTION = 0.01  # [N·m·s/rad], which the controller does not know
SETTLING = 0.3  # [s]


def main() -> None:
    scenario = densarm.load_scenario("panda_shelf")
    arm = scenario.arm
    world = scenario.world
    motion = densarm.plan_motion(world, scenario.start, scenario.goal, period=DT)
    controller = densarm.DensityTracking(world, motion)
    supervisor = densarm.Supervisor(arm, controller, period=DT)

    data = arm.model.createData()
    q, v = scenario.start, np.zeros(arm.nv)  # [rad], [rad/s]
    smallest = np.inf  # [m]
    for k in range(int((motion.duration + SETTLING) / DT)):
        tau = supervisor.torque(k * DT, q, v)  # [N·m]
        a = pin.aba(arm.model, data, q, v, tau - FRICTION * v)  # [rad/s²]
        q, v = pin.integrate(arm.model, q, v * DT), v + a * DT
        smallest = min(smallest, float(world.distances(q).min()))

    print(supervisor.status.sentence)
    error = np.abs(arm.difference(scenario.goal, q)).max()
    print(f"{error:.1e} rad from the goal, clearance at least {smallest * 1e3:.1f} mm")


if __name__ == "__main__":
    main()
