"""DensarmStep: the tracking controller of densarm."""

from control_steps.task import ControlTask
from densarm.arrays import Array
from densarm.control.density_tracking import DensityTracking
from densarm.control.gains import Gains
from densarm.density import (
    DensityParameters,
    JointLimitSet,
    NavigationDensity,
    NearClearanceSet,
    NearPairs,
    TorusDistance,
    UnsafeSet,
)
from densarm.fields.sub_goal_chain import SensingParameters
from densarm.proof.swept_bound import SweptBound


class DensarmStep:
    """`DensityTracking.torque`, and `Clearance.update` alone."""

    def __init__(self, task: ControlTask) -> None:
        self._task = task
        arm, sensing = task.arm, SensingParameters()
        unsafe: list[UnsafeSet] = [
            NearClearanceSet(NearPairs(SweptBound(task.clearance)), 0.0, sensing.distance),
            JointLimitSet(arm, sensing.joint),
        ]
        goal_distance = TorusDistance(arm, arm.configuration(task.reference.position[-1]))
        density = NavigationDensity(unsafe, goal_distance, DensityParameters())
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
