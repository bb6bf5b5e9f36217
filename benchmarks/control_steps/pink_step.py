"""PinkStep: differential inverse kinematics by pin-pink."""

import numpy as np
import pink
import pinocchio as pin
from pink.barriers import SelfCollisionBarrier
from pink.tasks import FrameTask, PostureTask

from control_steps.task import MARGIN, ControlTask
from densarm.values.arrays import Array


class PinkStep:
    """`pink.solve_ik` with a SelfCollisionBarrier, to which fixed shapes are shapes as all others.

    Args:
        task: what is to be done.
        rows: closest pairs that become rows of the QP.
    """

    def __init__(self, task: ControlTask, rows: int) -> None:
        self._task, self._poses = task, task.poses()
        model, geometry = task.arm.model.copy(), task.world.geometry_model.copy()
        self._configuration = pink.Configuration(
            model,
            model.createData(),
            task.q[0],
            collision_model=geometry,
            collision_data=pin.GeometryData(geometry),
        )
        self._barrier = SelfCollisionBarrier(
            n_collision_pairs=rows, gain=20.0, safe_displacement_gain=1.0, d_min=MARGIN
        )
        self._frame = FrameTask(task.arm.end_effector, position_cost=50.0, orientation_cost=10.0)
        self._posture = PostureTask(cost=1e-3)
        kind = "all" if rows == task.world.n_pairs else f"closest {rows}"
        self.name = f"pin-pink, {kind} rows"
        self.set_up = (
            f"solve_ik with FrameTask, PostureTask, SelfCollisionBarrier ({rows} rows, gain 20, as"
            " in its example of two arms), its configuration and velocity limits, solver daqp;"
            " distances to coal's default tolerance; the command is a velocity"
        )

    def measure(self, k: int) -> object:
        self._configuration.update(self._task.q[k])
        barrier = self._barrier.compute_barrier(self._configuration)
        return barrier, self._barrier.compute_jacobian(self._configuration)

    def command(self, k: int) -> Array:
        self._configuration.update(self._task.q[k])
        self._frame.set_target(self._poses[k])
        self._posture.set_target(self._task.wanted[k])
        velocity: Array = pink.solve_ik(
            self._configuration,
            [self._frame, self._posture],
            self._task.period,
            solver="daqp",
            barriers=[self._barrier],
            safety_break=False,
        )
        return velocity

    def distances(self, k: int) -> Array:
        self._configuration.update(self._task.q[k])
        results = self._configuration.collision_data.distanceResults
        return np.array([result.min_distance for result in results], np.float64)
