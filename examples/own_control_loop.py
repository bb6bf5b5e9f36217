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
    clearance = densarm.Clearance(arm, scenario.scene)
    plan = densarm.plan_motion(scenario, clearance, scenario.control.guide)
    if isinstance(plan, densarm.NoPath):
        raise SystemExit(plan.reason)
    controller = densarm.make_controller(scenario, plan)
    controller = densarm.GuardedController(arm, controller, period=DT)

    data = arm.model.createData()
    q, v = scenario.start, np.zeros(arm.nv)  # [rad], [rad/s]
    smallest = np.inf  # [m]
    for k in range(int((plan.reference.duration + SETTLING) / DT)):
        tau = controller.torque(k * DT, q, v)  # [N·m]
        a = pin.aba(arm.model, data, q, v, tau - FRICTION * v)  # [rad/s²]
        q, v = pin.integrate(arm.model, q, v * DT), v + a * DT
        smallest = min(smallest, clearance.distances(q).min())

    print(controller.status.sentence)
    error = np.abs(arm.difference(scenario.goal, q)).max()
    print(f"{error:.1e} rad from the goal, clearance at least {smallest * 1e3:.1f} mm")


if __name__ == "__main__":
    main()
