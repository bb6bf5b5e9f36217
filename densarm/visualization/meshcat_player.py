"""MeshcatPlayer: an arm, its obstacles, its goal and its motion, drawn by meshcat."""

from itertools import pairwise

import meshcat
import meshcat.animation
import meshcat.geometry
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.scene import Scene
from densarm.visualization.bodies import (
    WORLD,
    Tube,
    arm_bodies,
    scene_boards,
    scene_bodies,
)
from densarm.visualization.camera import FIELD_OF_VIEW, Camera

_OBSTACLE_COLOR = 0xCF7D56
_BOARD_COLOR = 0xD9CFC6  # of half-spaces, which are everywhere
_GOAL_COLOR = 0x2A9D6F
_PATH_COLOR = 0x7B2CBF
_FLOOR_COLOR = 0xB4BEC8
_SKY, _HORIZON = [1.0, 1.0, 1.0], [0.86, 0.89, 0.92]

_LIGHTS = {"AmbientLight": 0.5, "FillLight": 0.3}  # meshcat's own values bleach light colours
_FLOOR_CELL = 0.25  # [m]
_PATH_RADIUS = 0.005  # of the drawn end-effector path, as a part of its and the arm's extent
_SURROUNDINGS = 0.75  # seen around the motion where obstacles stand, as a part of its extent
_VIEWED_SAMPLES = 60  # configurations of a motion that the camera is placed for


class MeshcatPlayer:
    """Draw an arm among obstacles.

    Args:
        arm: the arm, drawn by its visual geometry; links without any by their collision geometry.
        scene: the obstacles.
        viewer: where to draw.
    """

    def __init__(self, arm: Arm, scene: Scene, viewer: meshcat.Visualizer) -> None:
        self.arm = arm
        self.viewer = viewer
        self._data = arm.model.createData()
        self._joints = list(arm.model.names)
        self._bodies = arm_bodies(arm)
        self._obstacles = scene_bodies(scene)
        self._draw_surroundings()
        self._bodies.draw(viewer["robot"], self._joints)
        self._obstacles.draw(
            viewer, ["obstacles"], color=_OBSTACLE_COLOR, opacity=0.75, side=0, depthWrite=False
        )
        scene_boards(scene).draw(
            viewer, ["obstacles"], color=_BOARD_COLOR, opacity=0.5, side=0, depthWrite=False
        )

    def display(self, q: Array) -> None:
        """Show the arm at q (nq,)."""
        self._place("robot", q)

    def draw_goal(self, q: Array) -> None:
        """Draw a translucent copy of the arm at the goal q (nq,)."""
        self._bodies.draw(
            self.viewer["goal"],
            self._joints,
            color=_GOAL_COLOR,
            opacity=0.35,
            side=0,
            depthWrite=False,
            # The arm at its goal covers its copy instead of flickering with it.
            polygonOffset=True,
            polygonOffsetFactor=1.0,
            polygonOffsetUnits=1.0,
        )
        self._place("goal", q)

    def draw_path(self, q: Array) -> None:
        """Draw the curve of the end effector.

        Args:
            q: (N, nq) configurations along the motion. A motion that moves the end effector by
                less than the line's width draws nothing.
        """
        points = np.array([self._end_effector(row) for row in q])
        drawn = np.vstack([points, self._bodies.corners(self._poses(q[0]))])
        radius = _PATH_RADIUS * float(np.ptp(drawn, axis=0).max())
        points = _spaced(points, radius)
        if len(points) > 1:
            material = meshcat.geometry.MeshBasicMaterial(color=_PATH_COLOR)
            self.viewer["path"].set_object(Tube(points, radius), material)

    def place_camera(self, q: Array) -> None:
        """Place camera and floor for the arm at all of q (N, nq) and the obstacles around it."""
        rows = np.unique(np.linspace(0, len(q) - 1, _VIEWED_SAMPLES).astype(int))
        points = np.vstack([self._bodies.corners(self._poses(q[row])) for row in rows])
        if self._obstacles.objects:
            low, high = points.min(axis=0), points.max(axis=0)
            margin = _SURROUNDINGS * np.max(high - low)
            obstacles = self._obstacles.corners([pin.SE3.Identity()])
            points = np.vstack([points, np.clip(obstacles, low - margin, high + margin)])
        self._draw_floor(points)
        camera = Camera.facing(points)
        # The camera always looks at its node's origin, so the drawing moves instead.
        self.viewer.set_transform(_translation(-camera.target))
        lens = self.viewer["/Cameras/default/rotated/<object>"]
        lens.set_property("fov", FIELD_OF_VIEW)
        x, y, z = camera.offset.tolist()
        lens.set_property("position", [x, z, -y])  # this node has y upwards

    def animation(
        self, time: Array, q: Array, frames_per_second: float = 30.0
    ) -> meshcat.animation.Animation:
        """Return the motion for meshcat's time line, which counts seconds.

        Args:
            time: (N,) increasing [s].
            q: (N, nq) the configuration at each time.
            frames_per_second: rate of the key frames, each a sample of the run; the browser
                interpolates between them [1/s].
        """
        rows = _key_rows(time, frames_per_second)
        seconds = (time[rows] - time[0]).tolist()
        poses = np.array([[pin.SE3ToXYZQUAT(pose) for pose in self._poses(q[row])] for row in rows])
        animation = meshcat.animation.Animation()
        for joint, name in enumerate(self._joints):
            if joint == WORLD:
                continue
            tracks = {
                "position": poses[:, joint, :3].tolist(),
                "quaternion": poses[:, joint, 3:].tolist(),
            }
            kinds = {"position": "vector3", "quaternion": "quaternion"}
            animation.clips[self.viewer["robot"][name].path] = meshcat.animation.AnimationClip(
                {
                    key: meshcat.animation.AnimationTrack(key, kinds[key], seconds, values)
                    for key, values in tracks.items()
                },
                fps=1,
            )
        return animation

    def _draw_surroundings(self) -> None:
        background = self.viewer["/Background"]
        background.set_property("top_color", _SKY)
        background.set_property("bottom_color", _HORIZON)
        for node in ("/Axes", "/Grid"):
            self.viewer[node].set_property("visible", False)
        for light, intensity in _LIGHTS.items():
            self.viewer[f"/Lights/{light}/<object>"].set_property("intensity", intensity)

    def _draw_floor(self, points: Array) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        middle = (low + high)[:2] / 2.0
        half = np.max(high - low) / 2.0 + _FLOOR_CELL
        first, last = (np.round((middle + side * half) / _FLOOR_CELL) for side in (-1, 1))
        lines = _grid(first * _FLOOR_CELL, last * _FLOOR_CELL, _FLOOR_CELL)
        vertices = np.column_stack([lines, np.full(len(lines), min(0.0, low[2]))])
        grid = meshcat.geometry.PointsGeometry(vertices.T)
        material = meshcat.geometry.LineBasicMaterial(color=_FLOOR_COLOR)
        self.viewer["floor"].set_object(meshcat.geometry.LineSegments(grid, material))

    def _place(self, node: str, q: Array) -> None:
        for name, pose in zip(self._joints, self._poses(q), strict=True):
            self.viewer[node][name].set_transform(pose.homogeneous)

    def _poses(self, q: Array) -> list[pin.SE3]:
        pin.forwardKinematics(self.arm.model, self._data, q)
        return list(self._data.oMi)

    def _end_effector(self, q: Array) -> Array:
        frame = self.arm.model.frames[self.arm.end_effector_frame]
        poses = self._poses(q)
        return np.array((poses[frame.parentJoint] * frame.placement).translation)


def _key_rows(time: Array, frames_per_second: float) -> NDArray[np.int64]:
    frames = np.arange(time[0], time[-1], 1.0 / frames_per_second)
    return np.unique([*np.searchsorted(time, frames), len(time) - 1])


def _grid(low: Array, high: Array, cell: float) -> Array:
    """Return the ends (2 K, 2) of the lines of a grid from corner to corner."""
    x, y = (np.arange(low[axis], high[axis] + cell / 2.0, cell) for axis in range(2))
    along_y = [(at, end) for at in x for end in (y[0], y[-1])]
    along_x = [(end, at) for at in y for end in (x[0], x[-1])]
    return np.array(along_y + along_x)


def _spaced(points: Array, spacing: float) -> Array:
    """Return the points at about equal steps along the polyline through them."""
    steps = [np.linalg.norm(after - before) for before, after in pairwise(points)]
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    count = int(travelled[-1] / spacing)
    at = np.linspace(0.0, travelled[-1], count)
    return np.column_stack([np.interp(at, travelled, points[:, axis]) for axis in range(3)])


def _translation(vector: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix
