"""Measure the way to the goal as one likes: a goal distance has one method.

python examples/own_goal_distance.py
"""

import numpy as np

import densarm
from densarm.values.arrays import Array


class ShoulderFirst:
    """V = ½ Σ w_i e_i², with so much weight on the shoulder that it arrives before the wrist."""

    def __init__(self, arm: densarm.Arm) -> None:
        self._arm = arm
        self._weights = np.array([4.0, 4.0, 2.0, 2.0, 1.0, 1.0, 1.0])  # [1/rad²]

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        """Return V at q, and write its gradient."""
        error = self._arm.difference(goal, q)  # [rad]
        out_gradient[:] = self._weights * error
        return float(0.5 * error @ out_gradient)


def main() -> None:
    arm = densarm.load_arm("panda")
    world = densarm.World(arm, densarm.Scene([densarm.HalfSpace(name="floor")]))
    start = arm.configuration([0.0, 0.2, 0.0, -2.0, 0.0, 2.0, 0.0])  # [rad]
    goal = arm.configuration([1.0, 0.5, 0.0, -1.5, 0.0, 2.5, 1.0])  # [rad]
    for distance in (densarm.TorusDistance(arm), ShoulderFirst(arm)):
        law = densarm.DensityRegulation(world, goal, goal_distance=distance)
        run = densarm.simulate(world, law, start)
        arrived = run.time[(np.abs(run.q - goal) > 0.1).sum(axis=0)]  # [rad]
        print(f"{run.outcome}: shoulder after {arrived[0]:.2f} s, wrist after {arrived[6]:.2f} s")


if __name__ == "__main__":
    main()
