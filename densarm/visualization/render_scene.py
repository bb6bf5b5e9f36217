"""RenderScene: all there is to see of a run, before anything draws it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.certificates.phases import body_poses
from densarm.scene.obstacles import numbered
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.visualization.bodies import (
    Body,
    arm_bodies,
    half_space_bodies,
    obstacle_bodies,
)
from densarm.visualization.camera import Camera, Sight
from densarm.visualization.palette import CARRIED, OBSTACLE_OPACITY, ClearanceScale
from densarm.visualization.triangle_mesh import TriangleMesh, sphere_swept_hull, tube
from densarm.world.world import NearestPair, World

_FRAMES_PER_SECOND = 60.0
_SAME = 1e-9  # [m], and of rotations
_FLOOR_CELL = 0.25  # [m]
_ABOVE = 1e-3  # of a grid's lines, so that boards do not cover them [m]
_PATH_RADIUS = 0.006  # of the drawn end-effector path, as a part of the arm's extent
_CLOSEST_RADIUS = 0.5  # of the closest pair's line, as a part of the path's
_SHORTEST = 1e-6  # length of that line [m], so that it has a direction
_END = 2.0  # radius of its ends over half its width
_SURROUNDINGS = 0.75  # seen around the motion where obstacles stand, as a part of its extent
_VIEWED_SAMPLES = 60  # configurations of a motion that the camera is placed for
_WATCHED_SAMPLES = 16  # of them, those whose end effector is to be seen


@dataclass(frozen=True)
class SummaryLine:
    """What to say of a run, in a few words."""

    title: str
    words: tuple[tuple[str, bool | None], ...]
    """Outcome, duration, smallest clearance and certificate: each good, bad or neither."""
    detail: str
    """What the outcome means, and what stood in the way; where it reached, what led it."""

    @classmethod
    def of(cls, run: Run) -> "SummaryLine":
        """Return the summary of a run."""
        smallest = float(run.clearance.min())
        clearance = _millimetres(smallest) if np.isfinite(smallest) else "infinite"
        is_reached = run.outcome == Outcome.REACHED
        words = (
            (str(run.outcome).replace("_", " "), is_reached),
            (f"{run.time[-1]:.3f} s", None),
            (f"smallest clearance {clearance}", None),
            ("certified" if run.certified else "not certified", run.certified),
        )
        told = "; ".join(filter(None, [run.led_by and f"Led by {run.led_by}", run.remark]))
        detail = told if is_reached else f"{run.outcome.description} {run.detail}".strip()
        return cls(run.task.title, words, detail)


class RenderScene:
    """The arm, its goal, its way, the obstacles, the closest pair, and where to look from.

    Args:
        run: what to show.

    Attributes:
        time: of the frames (N,), from 0 [s]; they are samples of the run.
        q: configuration at each frame (N, nq).
        robot: bodies of the arm.
        solids: bodies of the obstacles that have an end, as the scene begins.
        obstacles: these, and a board for each half-space.
        obstacle_poses: of those that move, by name, the pose at each frame (N).
        sensing_distance: the largest distance at which obstacles act, the margin included [m].
        closest: the closest pair at each frame; empty where there are no pairs.
        clearance: their distances [m].
        closest_line: its line and ends, each as a mesh and where it is at each frame (N, 4, 4).
        scale: what the colours of the path mean.
        path: tube along the end effector's way; None if it hardly moves.
        line_radius: of the path's tube, a good width for other lines [m].
        ground: height of the floor [m]: a half-space's, where one is below.
        floor: ends of the lines of its grid, and of other half-spaces' (K, 2, 3) [m].
        watched: the end effector at some frames, and what may stand before it.
        camera: where to look from.
    """

    def __init__(self, run: Run) -> None:
        task = run.task
        self.run = run
        self._model = task.arm.model
        self._data = self._model.createData()
        rows = _key_rows(run)
        self.time, self.q = run.time[rows] - run.time[0], run.q[rows]
        origin = task.arm.origin
        nearest = _nearest(run, rows)
        self.closest = [replace(pair, points=pair.points - origin) for pair in nearest if pair]
        self.robot = arm_bodies(task.arm)
        self.solids = obstacle_bodies(task.scene, origin)
        points = self._points_to_see()
        middle, width = _extent(points)
        boards = half_space_bodies(task.scene, middle, width, origin)
        bodies = (*self.solids, *boards)
        if run.phases:
            self.obstacle_poses = carried = _poses_in_phases(run, rows, bodies)
            self.solids = tuple(
                replace(body, color=CARRIED) if body.name in carried else body
                for body in self.solids
            )
        else:
            self.obstacle_poses = _poses_in_motion(task.scene, bodies, run.time[rows], origin)
        self.obstacles = (*self.solids, *boards)
        self.sensing_distance = task.margin + task.sensing.distance
        self.clearance = np.array([pair.distance for pair in self.closest])
        self.scale = ClearanceScale.fitting(self.clearance)
        start = np.vstack([body.corners(self.joint_poses(run.q[0])) for body in self.robot])
        self.line_radius = _PATH_RADIUS * float(np.ptp(start, axis=0).max())
        self.closest_line = closest_line(self.closest, _CLOSEST_RADIUS * self.line_radius)
        way = np.array([self._end_effector(q) for q in self.q])
        self.path = self._path(way)
        self.ground, self.floor = _floor(middle, width, min(0.0, points[:, 2].min()), boards)
        watched = np.unique(np.linspace(0, len(way) - 1, _WATCHED_SAMPLES).astype(int))
        self.watched = [self._sight(way[k], k) for k in watched.tolist()]
        self.camera = Camera.facing(points, self.watched)

    @property
    def joints(self) -> list[str]:
        """Name of each joint, the world first."""
        return list(self._model.names)

    def joint_poses(self, q: Array) -> list[pin.SE3]:
        """Return the pose of each joint in the world at q (nq,)."""
        pin.forwardKinematics(self._model, self._data, q)
        return [pin.SE3(pose) for pose in self._data.oMi]

    def _end_effector(self, q: Array) -> Array:
        frame = self._model.frames[self.run.task.arm.end_effector_frame]
        pose = self.joint_poses(q)[frame.parentJoint] * frame.placement
        return np.array(pose.translation)

    def _sight(self, point: Array, k: int) -> Sight:
        """Return the end effector's point at frame k, and what may stand before it."""
        arm, poses = self.run.task.arm, self.joint_poses(self.q[k])
        hand = self._model.subtrees[self._model.frames[arm.end_effector_frame].parentJoint]
        before = [
            (item.geometry, poses[item.parentJoint] * item.placement, 1.0)
            for item in arm.collision_model.geometryObjects
            if item.parentJoint not in hand and item.name not in arm.self_pieces
        ]
        for body in self.solids:
            moved = self.obstacle_poses.get(body.name)
            before.append((body.shape, moved[k] if moved else body.placement, OBSTACLE_OPACITY))
        return Sight(point, before)

    def _path(self, way: Array) -> TriangleMesh | None:
        steps = [np.linalg.norm(after - before) for before, after in pairwise(way)]
        travelled = np.concatenate([[0.0], np.cumsum(steps)])
        count = int(travelled[-1] / self.line_radius)
        if count < 2:
            return None
        at = np.linspace(0.0, travelled[-1], count)
        points = np.column_stack([np.interp(at, travelled, way[:, axis]) for axis in range(3)])
        distance = self.clearance if self.closest else np.full(len(way), np.inf)
        clearance = np.interp(at, travelled, np.minimum(distance, self.scale.top))
        return tube(points, self.line_radius, self.scale.colors(clearance))

    def _points_to_see(self) -> Array:
        rows = np.unique(np.linspace(0, len(self.q) - 1, _VIEWED_SAMPLES).astype(int))
        goal = self.run.task.goal
        poses = [self.joint_poses(q) for q in [*self.q[rows], *([] if goal is None else [goal])]]
        points = np.vstack([body.corners(pose) for pose in poses for body in self.robot])
        if not self.solids:
            return points
        low, high = points.min(axis=0), points.max(axis=0)
        margin = _SURROUNDINGS * np.max(high - low)
        corners = np.vstack([body.corners(poses[0]) for body in self.solids])
        return np.vstack([points, np.clip(corners, low - margin, high + margin)])


def _nearest(run: Run, rows: NDArray[np.int64]) -> list[NearestPair | None]:
    """Return the nearest pair at samples of a run, each in the world of its phase."""
    parts = run.phases or (run,)
    worlds = {id(part): World(part.task.arm, part.task.scene) for part in parts}
    found = []
    for part, row in run.located(rows.tolist()):
        world = worlds[id(part)]
        world.set_time(float(part.time[row]))
        found.append(world.nearest(part.q[row]))
    return found


def _poses_in_phases(
    run: Run, rows: NDArray[np.int64], bodies: Sequence[Body]
) -> dict[str, list[pin.SE3]]:
    """Return the poses of the bodies that phases move, at samples."""
    origin = pin.SE3(np.eye(3), -run.task.arm.origin)
    now = [body_poses(part.task, part.q[row]) for part, row in run.located(rows.tolist())]
    placed, found = {body.name: body.placement for body in bodies}, {}
    for obstacle in run.task.scene:
        poses = [origin * poses[obstacle.name][1] for poses in now]
        if all(pose.isApprox(poses[0], _SAME) for pose in poses):
            continue
        begin = (origin * obstacle.pose_at(0.0)).inverse()
        for name in numbered(obstacle.name, len(obstacle.convex_shapes())):
            found[name] = [pose * begin * placed[name] for pose in poses]
    return found


def _poses_in_motion(
    scene: Scene, bodies: Sequence[Body], time: Array, origin: Array
) -> dict[str, list[pin.SE3]]:
    """Return the poses of the bodies of obstacles with a motion at times (N,) [s]."""
    placed, shift = {body.name: body.placement for body in bodies}, pin.SE3(np.eye(3), -origin)
    found = {}
    for obstacle in (item for item in scene if item.motion is not None):
        begin = (shift * obstacle.pose_at(0.0)).inverse()
        moves = [shift * obstacle.pose_at(each) * begin for each in time.tolist()]
        for name in numbered(obstacle.name, len(obstacle.convex_shapes())):
            found[name] = [move * placed[name] for move in moves]
    return found


def closest_line(
    closest: list[NearestPair], radius: float
) -> dict[str, tuple[TriangleMesh, Array]]:
    """Return a rod of a radius [m] and its two ends, each with its transforms (N, 4, 4)."""
    if not closest:
        return {}
    corners = np.array(list(product((-1.0, 1.0), (-1.0, 1.0), (0.0, 1.0))))
    rod, ball = sphere_swept_hull(corners, 0.0), sphere_swept_hull(np.zeros((1, 3)), 1.0)
    first, second = np.stack([pair.points for pair in closest], axis=1)
    return {
        "line": (rod, np.array([_rod(a, b, radius) for a, b in zip(first, second, strict=True)])),
        "first": (ball, _balls(first, _END * radius)),
        "second": (ball, _balls(second, _END * radius)),
    }


def _rod(start: Array, end: Array, radius: float) -> Array:
    """Return the transform that leads the unit rod along z from start to end."""
    length = max(float(np.linalg.norm(end - start)), _SHORTEST)
    up = np.array([0.0, 0.0, 1.0])
    rotation = pin.Quaternion.FromTwoVectors(up, end - start + 1e-12 * up).matrix()
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * [radius, radius, length]
    matrix[:3, 3] = start
    return matrix


def _balls(centres: Array, radius: float) -> Array:
    matrices = np.tile(np.diag([radius, radius, radius, 1.0]), (len(centres), 1, 1))
    matrices[:, :3, 3] = centres
    return matrices


def _key_rows(run: Run) -> NDArray[np.int64]:
    """Return the samples that are frames: evenly spaced ones, the closest and the last."""
    frames = np.arange(run.time[0], run.time[-1], 1.0 / _FRAMES_PER_SECOND)
    others = [int(run.clearance.argmin()), len(run.time) - 1]
    return np.unique([*np.searchsorted(run.time, frames), *others])


def _extent(points: Array) -> tuple[Array, float]:
    """Return the middle (3,) and the width of a square floor for points (N, 3), in whole cells."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = np.array([*(_FLOOR_CELL * np.round((low + high)[:2] / 2.0 / _FLOOR_CELL)), low[2]])
    cells = np.ceil(np.max(high - low) / 2.0 / _FLOOR_CELL) + 1.0
    return middle, float(2.0 * _FLOOR_CELL * cells)


def _floor(
    middle: Array, width: float, height: float, boards: Sequence[Body]
) -> tuple[float, Array]:
    """Return the height of the floor and the lines of grids: at a height if no board is a floor."""
    poses = [body.placement for body in boards]
    heights = [pose.translation[2] for pose in poses if pose.rotation[2, 2] > 1.0 - _SAME]
    if not heights:
        poses.append(pin.SE3(np.eye(3), np.array([*middle[:2], height - _ABOVE])))
    return max(heights, default=height), np.vstack([_grid(pose, width) for pose in poses])


def _grid(pose: pin.SE3, width: float) -> Array:
    """Return the lines (K, 2, 3) of a square grid about a pose, a little above it."""
    at = np.linspace(-width / 2.0, width / 2.0, round(width / _FLOOR_CELL) + 1)
    ends = np.tile([-width / 2.0, width / 2.0], (len(at), 1))
    along_x = np.stack([ends, np.tile(at[:, np.newaxis], 2), np.full_like(ends, _ABOVE)], axis=-1)
    lines = np.concatenate([along_x[..., [1, 0, 2]], along_x])
    return np.asarray(lines @ pose.rotation.T + pose.translation)


def _millimetres(length: float) -> str:
    value = 1e3 * length
    return f"{value:.3g} mm" if abs(value) < 1e3 else f"{value:.0f} mm"
