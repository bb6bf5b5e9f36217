"""Drive what is not the model: a plant has a time step and one method.

python examples/own_plant.py
"""

import pinocchio as pin

import densarm
from densarm.values.arrays import Array


class RubbingArm:
    """The arm with friction in every joint, which no controller is told of."""

    dt = 0.001  # [s]

    def __init__(self, arm: densarm.Arm, friction: float) -> None:
        self._model, self._data = arm.model, arm.model.createData()
        self._friction = friction  # [N·m·s/rad]

    def step(self, q: Array, v: Array, u: Array) -> tuple[Array, Array]:
        """Return the state one time step later, under a torque [N·m]."""
        v = v + self.dt * pin.aba(self._model, self._data, q, v, u - self._friction * v)
        return pin.integrate(self._model, q, self.dt * v), v


def main() -> None:
    scenario = densarm.load_scenario("panda_shelf")
    motion = densarm.plan_motion(scenario.world, scenario.start, scenario.goal)
    controller = densarm.DensityTracking(scenario.world, motion)
    plant = RubbingArm(scenario.arm, friction=0.02)
    run = densarm.simulate(scenario.world, controller, scenario.start, plant=plant)
    print(f"{run.outcome}, {run.tracking_error or 0.0:.3f} rad off at most")
    print(f"certified: {run.certified}")  # the plant is not the model that proves the run


if __name__ == "__main__":
    main()
