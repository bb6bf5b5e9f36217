"""Carry a kilogram that the controller is not told of, in MuJoCo, beside plain computed torque.

python examples/unknown_payload.py
"""

import densarm
from densarm.study.baselines import ComputedTorque


def main() -> None:
    scenario = densarm.load_scenario("panda_shelf")
    world, start = scenario.world, scenario.start
    motion = densarm.plan_motion(world, start, scenario.goal)
    tracking = densarm.DensityTracking(world, motion)
    laws: dict[str, densarm.Controller] = {
        "computed torque": ComputedTorque(world.arm, motion, scenario.law_gains),
        "density": tracking,
    }
    for name, controller in laws.items():
        run = densarm.simulate(
            world,
            controller,
            start,
            plant="mujoco",
            disturbances=densarm.Disturbances(payload=1.0),  # [kg], at the end effector
        )
        print(f"{name}: {run.outcome}, clearance at least {1e3 * run.clearance.min():.1f} mm")
    found = ", ".join(f"{torque:.1f}" for torque in tracking.dynamics.disturbance)
    print(f"found to act beside the model, at the end: {found} N·m")


if __name__ == "__main__":
    main()
