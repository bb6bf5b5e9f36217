"""GoalOnObstacle: regulation to a pose that goes with an obstacle, as a part on a conveyor."""

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.arms.pose import Pose
from densarm.control.inverse_dynamics import InverseDynamics
from densarm.control.regulation import DensityRegulation
from densarm.scene.obstacles import pose_fields
from densarm.values.arrays import Array
from densarm.world.world import World

_EVERY = 0.01  # [s] that the goal is set anew


class GoalOnObstacle:
    """Regulates to a pose that keeps to an obstacle, by `DensityRegulation.set_goal`.

    Pose and twist of the goal are those of the obstacle, as `World` has them: by a motion, or as
    `World.move_obstacle` is told them.

    Args:
        world: the arm among obstacles.
        pose: the goal, while the obstacle is where it is now.
        obstacle: name of the obstacle.
        options: as those of `DensityRegulation`.

    Attributes:
        lag: how far the frame is off the goal, as it was set last [m].

    Raises:
        UnknownNameError: no such obstacle, or frame.
        InvalidValueError: as `DensityRegulation`.
    """

    def __init__(self, world: World, pose: Pose, obstacle: str, **options: Any) -> None:
        self._world, self._obstacle = world, obstacle
        there = pin.XYZQUATToSE3(world.obstacle_pose(obstacle))
        self._pose, self._on = pose, there.actInv(pose.placement)
        self._regulation = DensityRegulation(world, pose, **options)
        self._next, self.lag, self._lag_in_motion = -np.inf, 0.0, np.nan

    @property
    def goal(self) -> Pose:
        """The pose, where it is now."""
        goal: Pose = self._regulation.goal
        return goal

    @property
    def is_moving(self) -> bool:
        """Whether the obstacle moves."""
        return bool(self._world.obstacle_velocity(self._obstacle).any())

    @property
    def is_evading(self) -> bool:
        """As `DensityRegulation.is_evading`."""
        return self._regulation.is_evading

    @property
    def dynamics(self) -> InverseDynamics:
        """As `DensityRegulation.dynamics`."""
        return self._regulation.dynamics

    @property
    def remark(self) -> str:
        """As `DensityRegulation.remark`, and how far off the frame was when the goal moved last."""
        off = self._lag_in_motion
        own = "" if np.isnan(off) else f"{1e3 * off:.2g} mm off the goal when it moved last"
        return "; ".join(filter(None, [self._regulation.remark, own]))

    def describe_stall(self, q: Array) -> str:
        """Act as `DensityRegulation.describe_stall`."""
        return self._regulation.describe_stall(q)

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        if not self._next - _EVERY <= t < self._next:
            self._set_goal()
            here = self._world.arm.pose(q, self._pose.frame).position
            self.lag = float(np.linalg.norm(np.subtract(here, self.goal.position)))
            self._lag_in_motion = self.lag if self.is_moving else self._lag_in_motion
            self._next = t + _EVERY
        return self._regulation.torque(t, q, v)

    def _set_goal(self) -> None:
        there = pin.XYZQUATToSE3(self._world.obstacle_pose(self._obstacle))
        twist = self._world.obstacle_velocity(self._obstacle)
        now, turns = there.act(self._on), self._pose.orientation_xyzw is not None
        twist[:3] += np.cross(twist[3:], now.translation - there.translation)
        told = pose_fields(now) if turns else {"position": now.translation}
        self._regulation.set_goal(replace(self._pose, **told), twist)
