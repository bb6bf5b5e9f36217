"""DensarmStep: the tracking controller of densarm."""

from control_steps.task import ControlTask
from densarm.density.unsafe_sets import SensingParameters
from densarm.study.step import full_sensing_controller
from densarm.values.arrays import Array


class DensarmStep:
    """`DensityTracking.torque`, and `World.clearance` alone."""

    def __init__(self, task: ControlTask) -> None:
        self._task = task
        sensing = SensingParameters()
        self._controller = full_sensing_controller(task.world, task.motion)
        self.name = "densarm"
        self.set_up = (
            f"DensityTracking.torque, sensing distance {1e3 * sensing.distance:.0f} mm; joint,"
            " torque and acceleration limits; pairs that cannot be near sleep in the command, but"
            " not where distances are measured alone; the command is a torque"
        )

    def measure(self, k: int) -> object:
        return self._task.world.clearance(self._task.q[k])

    def command(self, k: int) -> Array:
        return self._controller.torque(k * self._task.period, self._task.q[k], self._task.v[k])

    def distances(self, k: int) -> Array:
        return self._task.world.distances(self._task.q[k])
