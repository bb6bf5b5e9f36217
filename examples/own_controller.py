"""Judge any controller: what `simulate` runs has one method.

python examples/own_controller.py
"""

import numpy as np
from numpy.typing import ArrayLike

import densarm
from densarm.values.arrays import Array


class Spring:
    """Pull every joint straight to the goal, with gravity cancelled and no eye for obstacles."""

    def __init__(self, arm: densarm.Arm, goal: Array) -> None:
        self._arm = arm
        self.goal = goal  # tells `simulate` where the arm shall be

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Return the torque at a time and state."""
        error = self._arm.difference(self.goal, np.asarray(q))  # [rad]
        pull = 20.0 * error + 8.0 * np.asarray(v)  # [N·m]
        return self._arm.nonlinear_effects(q, v) - pull


def main() -> None:
    scenario = densarm.load_scenario("panda_table")
    spring = Spring(scenario.arm, scenario.goal)
    run = densarm.simulate(scenario.world, spring, scenario.start)
    print(f"{run.outcome}: {run.detail}")  # the wall is in its way
    print(f"certified: {run.certified}")


if __name__ == "__main__":
    main()
