"""DensarmStep: the tracking controller of densarm."""

from control_steps.task import ControlTask
from densarm.arrays import Array
from densarm.bench.step import full_sensing_density
from densarm.control.density_tracking import DensityTracking
from densarm.control.gains import Gains
from densarm.fields.sub_goal_chain import SensingParameters


class DensarmStep:
    """`DensityTracking.torque`, and `Clearance.update` alone."""

    def __init__(self, task: ControlTask) -> None:
        self._task = task
        arm, sensing = task.arm, SensingParameters()
        goal = arm.configuration(task.reference.position[-1])
        density = full_sensing_density(task.clearance, goal)
        self._controller = DensityTracking(arm, density, task.reference, Gains())
        self.name = "densarm"
        self.set_up = (
            f"DensityTracking.torque, sensing distance {1e3 * sensing.distance:.0f} mm; joint,"
            " torque and acceleration limits; pairs that cannot be near sleep in the command, but"
            " not where distances are measured alone; the command is a torque"
        )

    def measure(self, k: int) -> object:
        return self._task.clearance.update(self._task.q[k])

    def command(self, k: int) -> Array:
        return self._controller.torque(k * self._task.period, self._task.q[k], self._task.v[k])

    def distances(self, k: int) -> Array:
        return self._task.clearance.distances(self._task.q[k])
