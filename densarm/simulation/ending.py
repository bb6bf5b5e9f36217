"""Ending: when a run in the making is over, simulated or on a robot."""

from typing import Any

import numpy as np

from densarm.arms.pose import Pose
from densarm.certificates.task import REACHED_POSITION, REACHED_VELOCITY, Task
from densarm.density.pose_distance import PoseDistance
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World

REACHED_POSE = (1e-3, 0.01)
"""Largest errors of a pose that is a goal [m, rad]."""

_HELD_SHARE = 0.5  # the loop ends well inside the bound on position at the goal
_STALL_MOTION = 0.01  # [rad or m] within the stall time
_NEAREST = 3  # pairs named where an arm rests


class Ending:
    """Tells that a goal is held, or that the arm rests elsewhere for too long.

    Args:
        task: with the goal, and the times that count.
        world: its arm among obstacles.
        controller: as `simulate` has it, or `drive`.
        pose: the goal of a task without a configuration for it.
    """

    def __init__(self, task: Task, world: World, controller: Any, pose: Pose | None = None) -> None:
        self._task, self._world, self._controller, self._pose = task, world, controller, pose
        self._to_pose = None if pose is None else PoseDistance(world.arm, pose)
        self._goal_is_own = getattr(controller, "goal", None) is pose
        motion = getattr(controller, "motion", None)
        self._moves_until = 0.0 if motion is None else motion.duration
        self._held, self._rest, self._rested_since = 0, task.start, 0

    def after(self, k: int, q: Array, v: Array) -> Outcome | None:
        """Return the outcome if step k ended the run at q (nq,) and v (nv,), none else."""
        p, controller = self._task.simulation, self._controller
        self._held = self._held + 1 if self._is_at_goal(q, v) else 0
        moves = getattr(controller, "is_moving", None)
        moves = k * p.dt <= self._moves_until if moves is None else moves
        if moves or self._distance(q, self._rest) > _STALL_MOTION:
            self._rest, self._rested_since = q, k
        if self._held * p.dt >= p.hold_time:
            return Outcome.REACHED
        has_goal = self._to_pose is not None or self._task.goal is not None
        if has_goal and (k - self._rested_since) * p.dt >= p.stall_time:
            return Outcome.STUCK
        return None

    def goal_reached(self, q: Array) -> Array | None:
        """Return the goal (nq,) of a run that reached it at q: that, if it was a pose."""
        return self._task.goal if self._to_pose is None else q

    def _is_at_goal(self, q: Array, v: Array) -> bool:
        if np.abs(v).max() > REACHED_VELOCITY:
            return False
        if self._to_pose is not None:
            if self._goal_is_own and isinstance(now := getattr(self._controller, "goal", 0), Pose):
                self._to_pose.set_pose(now)
            position, turn = self._to_pose.off(q)
            return max(position / REACHED_POSE[0], turn / REACHED_POSE[1]) <= _HELD_SHARE
        return (
            self._task.goal is not None
            and self._distance(self._task.goal, q) <= _HELD_SHARE * REACHED_POSITION
        )

    def _distance(self, q_a: Array, q_b: Array) -> float:
        """Return the largest difference of a joint [rad or m]."""
        return float(np.abs(self._task.arm.difference(q_a, q_b)).max())

    def describe_rest(self, q: Array) -> str:
        """Return why the arm rests at q (nq,) in the controller's words, or what is near there."""
        own = getattr(self._controller, "describe_stall", None)
        if own is not None and (told := str(own(q))):
            return told
        where = ", ".join(f"{angle:.4g}" for angle in self._task.arm.angles(q))
        distance = self._world.distances(q)
        nearest = ", ".join(
            f"{' and '.join(self._world.pairs[k])} ({1e3 * distance[k]:.3g} mm)"
            for k in np.argsort(distance)[:_NEAREST]
        )
        return f"at rest at joint positions ({where}); nearest there: {nearest or 'no pair'}"
