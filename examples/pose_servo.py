"""Lead a tool round a circle by its pose alone, without inverse kinematics, around a ball.

python examples/pose_servo.py
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

import densarm

RADIUS, SPEED = 0.1, 0.1  # [m], [m/s]


class Servo:
    """Sets a pose and its twist a hundred times a second, and notes how far the tool is off."""

    def __init__(self, world: densarm.World, start: NDArray[np.float64]) -> None:
        self.arm, self.first, self.next = world.arm, world.arm.pose(start), 0.0
        self.off: list[float] = []
        self.regulation = densarm.DensityRegulation(world, self.first)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        turned = t * SPEED / RADIUS
        c, s = np.cos(turned), np.sin(turned)
        shift = np.array([RADIUS * (c - 1.0), RADIUS * s, 0.0, 0.0, 0.0, 0.0])
        if t >= self.next:
            twist = [-SPEED * s, SPEED * c, 0.0, 0.0, 0.0, 0.0]
            self.regulation.set_goal(self.first.moved(shift), twist)
            self.next += 0.01
        here, wanted = self.arm.pose(q).position, self.first.moved(shift).position
        self.off.append(1e3 * float(np.linalg.norm(np.subtract(here, wanted))))
        return self.regulation.torque(t, q, v)


def main() -> None:
    arm = densarm.load_arm("ur5")
    start = arm.postures["ready"]
    x, y, z = arm.pose(start).position
    ball = densarm.Sphere(name="ball", radius=0.03, position=[x - RADIUS, y, z - 0.05])
    world = densarm.World(arm, densarm.Scene([ball]))
    servo = Servo(world, start)
    parameters = densarm.SimulationParameters(time_limit=4.0)  # [s]
    run = densarm.simulate(world, servo, start, parameters=parameters)
    print(f"clearance at least {1e3 * run.clearance.min():.0f} mm")
    print(f"off by at most {max(servo.off):.1f} mm, after a second by {max(servo.off[1000:]):.2f}")


if __name__ == "__main__":
    main()
