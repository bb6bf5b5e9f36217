"""MinkStep: differential inverse kinematics by mink."""

import mink
import mujoco
import numpy as np
from numpy.typing import NDArray

from control_steps.mujoco_model import SITE, mujoco_model
from control_steps.task import MARGIN, ControlTask
from densarm.values.arrays import Array

_GAIN = 0.85  # of mink's collision limit, its default


class MinkStep:
    """`mink.solve_ik` with a CollisionAvoidanceLimit.

    Args:
        task: what is to be done.
        detection: distance within which a pair is a row of the QP [m].
    """

    def __init__(self, task: ControlTask, detection: float) -> None:
        self._task = task
        model = mujoco_model(task)
        self._configuration = mink.Configuration(model, task.q[0])
        arm_shapes = [
            item.name for item in task.arm.collision_model.geometryObjects if item.parentJoint > 0
        ]
        self._collision = mink.CollisionAvoidanceLimit(
            model,
            [(arm_shapes, [sphere.name for sphere in task.spheres])],
            gain=_GAIN,
            minimum_distance_from_collisions=MARGIN,
            collision_detection_distance=detection,
        )
        velocity = dict(zip(task.arm.joint_names, task.arm.limits.velocity, strict=True))
        self._limits = [
            mink.ConfigurationLimit(model),
            mink.VelocityLimit(model, velocity),
            self._collision,
        ]
        self._frame = mink.FrameTask(
            SITE, "site", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0
        )
        self._posture = mink.PostureTask(model, cost=1e-3)
        self._poses = [mink.SE3.from_matrix(pose.homogeneous) for pose in task.poses()]
        self._order = self._order_of_pairs(model)
        self.name = f"mink, detection {detection:g} m"
        self.set_up = (
            "solve_ik with FrameTask, PostureTask, ConfigurationLimit, VelocityLimit and"
            f" CollisionAvoidanceLimit (gain {_GAIN}, broadphase on, as by default), solver daqp;"
            " pairs farther than the detection distance are not measured; the command is a velocity"
        )

    def measure(self, k: int) -> object:
        self._configuration.update(self._task.q[k])
        return self._collision.compute_qp_inequalities(self._configuration, self._task.period)

    def command(self, k: int) -> Array:
        self._configuration.update(self._task.q[k])
        self._frame.set_target(self._poses[k])
        self._posture.set_target(self._task.wanted[k])
        velocity: Array = mink.solve_ik(
            self._configuration,
            [self._frame, self._posture],
            self._task.period,
            solver="daqp",
            damping=1e-3,
            limits=self._limits,
        )
        return velocity

    def distances(self, k: int) -> Array:
        self._configuration.update(self._task.q[k])
        period = self._task.period
        bound = self._collision.compute_qp_inequalities(self._configuration, period).h
        distance = np.full(self._task.world.n_pairs, np.nan)
        seen = np.isfinite(bound)
        distance[self._order[seen]] = MARGIN + bound[seen] * period / _GAIN
        return distance

    def _order_of_pairs(self, model: mujoco.MjModel) -> NDArray[np.int64]:
        place = {frozenset(pair): k for k, pair in enumerate(self._task.world.pairs)}
        return np.array(
            [
                place[frozenset((model.geom(a).name, model.geom(b).name))]
                for a, b in self._collision.geom_id_pairs
            ]
        )
