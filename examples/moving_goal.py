"""Follow a goal that moves, without a plan and without a lag, around a ball in its way.

python examples/moving_goal.py
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

import densarm

SPEED = np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])  # [rad/s]


class Follower:
    """Sets the goal of a regulation thirty times a second, and notes how far the arm is off."""

    def __init__(self, world: densarm.World, start: NDArray[np.float64]) -> None:
        self.arm, self.start, self.next = world.arm, start, 0.0
        self.lags: list[float] = []
        self.regulation = densarm.DensityRegulation(world, start)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        goal = self.arm.integrate(self.start, t * SPEED)
        if t >= self.next:
            self.regulation.set_goal(goal, SPEED)
            self.next += 1.0 / 30.0
        self.lags.append(float(np.abs(self.arm.difference(np.asarray(q), goal)).max()))
        return self.regulation.torque(t, q, v)


def main() -> None:
    arm = densarm.load_arm("ur5")
    start = arm.postures["ready"]
    ball = densarm.Sphere(name="ball", radius=0.05, position=[0.27, 0.47, 0.36])
    world = densarm.World(arm, densarm.Scene([ball]))
    follower, end = Follower(world, start), arm.integrate(start, 4.0 * SPEED)
    parameters = densarm.SimulationParameters(time_limit=4.0)  # [s]
    run = densarm.simulate(world, follower, start, end, parameters=parameters)
    print(f"clearance at least {1e3 * run.clearance.min():.0f} mm")
    lags = 1e3 * np.array(follower.lags)
    print(f"off by at most {lags.max():.0f} mrad, at the end by {lags[-1]:.3f}")


if __name__ == "__main__":
    main()
