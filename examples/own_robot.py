"""Drive a robot by a driver of one's own: three methods, here around a simulated arm.

python examples/own_robot.py
"""

import numpy as np

import densarm
from densarm.certificates.task import Input
from densarm.hardware.drive import drive
from densarm.hardware.robot import Reading
from densarm.simulation.plants import PinocchioPlant
from densarm.values.arrays import Array


class OwnRobot:
    """Where this steps a simulation, a driver waits for a message and sends one."""

    input, period = Input.TORQUE, 0.001  # [s]

    def __init__(self, arm: densarm.Arm, start: Array) -> None:
        self._arm, self._plant = arm, PinocchioPlant(arm, self.period)
        self._q, self._v, self._time = start, np.zeros(arm.nv), 0.0
        self._tau: Array | None = None  # no command yet: the robot holds itself

    def read(self) -> Reading:
        """Wait for the next state."""
        if self._tau is not None:
            self._q, self._v = self._plant.step(self._q, self._v, self._tau)
            self._time += self.period
        return Reading(self._time, self._arm.angles(self._q), self._v)

    def command(self, u: Array) -> None:
        """Send the torque that acts from now on [N·m], gravity's included."""
        self._tau = u

    def stop(self) -> None:
        """Give control back to the robot."""
        self._tau = None


def main() -> None:
    scenario = densarm.load_scenario("fr3_posts")
    motion = densarm.plan_motion(scenario.world, scenario.start, scenario.goal)
    controller = densarm.DensityTracking(scenario.world, motion)
    run = drive(OwnRobot(scenario.arm, scenario.start), scenario.world, controller)
    print(f"{run.outcome} in {run.time[-1]:.2f} s, {run.goal_error:.1e} rad from the goal")
    print(run.certificate)


if __name__ == "__main__":
    main()
