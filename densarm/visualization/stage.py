"""Stage: all there is to see of a run, before anything draws it."""

from functools import cached_property
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.trajectory import Trajectory
from densarm.visualization.bodies import Body, arm_bodies, obstacle_bodies, sensing_bodies
from densarm.visualization.camera import Camera
from densarm.visualization.clearance_scale import ClearanceScale
from densarm.visualization.closest_line import closest_line
from densarm.visualization.closest_pairs import ClosestPairs
from densarm.visualization.triangle_mesh import TriangleMesh, tube

_FRAMES_PER_SECOND = 60.0
_FLOOR_CELL = 0.25  # [m]
_PATH_RADIUS = 0.006  # of the drawn end-effector path, as a part of the arm's extent
_CLOSEST_RADIUS = 0.5  # of the closest pair's line, as a part of the path's
_SURROUNDINGS = 0.75  # seen around the motion where obstacles stand, as a part of its extent
_VIEWED_SAMPLES = 60  # configurations of a motion that the camera is placed for
_WATCHED_SAMPLES = 16  # of them, those whose end effector is to be seen


class Stage:
    """The arm, its goal, its way, the obstacles, the closest pair, and where to look from.

    Args:
        run: what to show.

    Attributes:
        time: of the frames (N,), from 0 [s]; they are samples of the run.
        q: configuration at each frame (N, nq).
        robot: bodies of the arm.
        obstacles: bodies of the scene.
        sensing_distance: the largest distance at which obstacles act, the margin included [m].
        closest: the closest pair at each frame.
        closest_line: its line and ends, each as a mesh and where it is at each frame (N, 4, 4).
        scale: what the colours of the path mean.
        path: tube along the end effector's way; None if it hardly moves.
        line_radius: of the path's tube, a good width for other lines [m].
        floor: ends of the lines of a grid (K, 2, 3) [m].
        camera: where to look from.
    """

    def __init__(self, run: Trajectory) -> None:
        scenario = run.scenario
        self.run = run
        self._model = scenario.arm.model
        self._data = self._model.createData()
        rows = _key_rows(run)
        self.time, self.q = run.time[rows] - run.time[0], run.q[rows]
        self.closest = ClosestPairs.along(Clearance(scenario.arm, scenario.scene), self.q)
        self.robot = arm_bodies(scenario.arm)
        self.obstacles = obstacle_bodies(scenario.scene)
        self.sensing_distance = scenario.control.margin + scenario.sensing.distance
        self.scale = ClearanceScale.fitting(self.closest.distance)
        start = np.vstack([body.corners(self.joint_poses(run.q[0])) for body in self.robot])
        self.line_radius = _PATH_RADIUS * float(np.ptp(start, axis=0).max())
        self.closest_line = closest_line(self.closest, _CLOSEST_RADIUS * self.line_radius)
        way = np.array([self._end_effector(q) for q in self.q])
        self.path = self._path(way)
        points = self._points_to_see()
        self.floor = _floor(points)
        watched = way[np.linspace(0, len(way) - 1, _WATCHED_SAMPLES).astype(int)]
        self.camera = Camera.facing(points, watched, self._ended_obstacles())

    @cached_property
    def sensing(self) -> tuple[Body, ...]:
        """All that is within the largest sensing distance of each obstacle."""
        return sensing_bodies(self.run.scenario.scene, self.sensing_distance)

    @property
    def joints(self) -> list[str]:
        """Name of each joint, the world first."""
        return list(self._model.names)

    def joint_poses(self, q: Array) -> list[pin.SE3]:
        """Return the pose of each joint in the world at q (nq,)."""
        pin.forwardKinematics(self._model, self._data, q)
        return [pin.SE3(pose) for pose in self._data.oMi]

    def _end_effector(self, q: Array) -> Array:
        frame = self._model.frames[self.run.scenario.arm.end_effector_frame]
        pose = self.joint_poses(q)[frame.parentJoint] * frame.placement
        return np.array(pose.translation)

    def _path(self, way: Array) -> TriangleMesh | None:
        steps = [np.linalg.norm(after - before) for before, after in pairwise(way)]
        travelled = np.concatenate([[0.0], np.cumsum(steps)])
        count = int(travelled[-1] / self.line_radius)
        if count < 2:
            return None
        at = np.linspace(0.0, travelled[-1], count)
        points = np.column_stack([np.interp(at, travelled, way[:, axis]) for axis in range(3)])
        has_pairs = len(self.closest.distance) > 0
        distance = self.closest.distance if has_pairs else np.full(len(way), np.inf)
        clearance = np.interp(at, travelled, np.minimum(distance, self.scale.top))
        return tube(points, self.line_radius, self.scale.colors(clearance))

    def _ended_obstacles(self) -> list[Body]:
        return [body for body in self.obstacles if body.has_end]

    def _points_to_see(self) -> Array:
        rows = np.unique(np.linspace(0, len(self.q) - 1, _VIEWED_SAMPLES).astype(int))
        postures = [*self.q[rows], self.run.scenario.goal]
        poses = [self.joint_poses(q) for q in postures]
        points = np.vstack([body.corners(pose) for pose in poses for body in self.robot])
        obstacles = self._ended_obstacles()
        if not obstacles:
            return points
        low, high = points.min(axis=0), points.max(axis=0)
        margin = _SURROUNDINGS * np.max(high - low)
        corners = np.vstack([body.corners(poses[0]) for body in obstacles])
        return np.vstack([points, np.clip(corners, low - margin, high + margin)])


def _key_rows(run: Trajectory) -> NDArray[np.int64]:
    """Return the samples that are frames: evenly spaced ones, the closest and the last."""
    frames = np.arange(run.time[0], run.time[-1], 1.0 / _FRAMES_PER_SECOND)
    others = [int(run.clearance.argmin()), len(run.time) - 1]
    return np.unique([*np.searchsorted(run.time, frames), *others])


def _floor(points: Array) -> Array:
    """Return the lines of a grid below points (N, 3), somewhat wider than they are."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high)[:2] / 2.0
    half = np.max(high - low) / 2.0 + _FLOOR_CELL
    first, last = (_FLOOR_CELL * np.round((middle + side * half) / _FLOOR_CELL) for side in (-1, 1))
    z = min(0.0, low[2])
    x, y = (np.arange(first[k], last[k] + _FLOOR_CELL / 2.0, _FLOOR_CELL) for k in range(2))
    along_y = [[[at, y[0], z], [at, y[-1], z]] for at in x]
    along_x = [[[x[0], at, z], [x[-1], at, z]] for at in y]
    return np.array(along_y + along_x)
