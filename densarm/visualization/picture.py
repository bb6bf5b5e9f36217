"""Picture: a stage's frames as images, without a display, a browser or a graphics card."""

from dataclasses import replace

import numpy as np
from PIL import Image

from densarm.arrays import Array
from densarm.visualization import palette
from densarm.visualization.caption import Caption
from densarm.visualization.rasterizer import Rasterizer
from densarm.visualization.stage import Stage
from densarm.visualization.triangle_mesh import TriangleMesh

_BEHIND = 0.998  # lift of the goal posture, so that the arm covers it once it is there
_EDGE_WIDTH, _FLOOR_WIDTH = 1.3, 1.0  # of lines in a picture 1280 pixels wide [pixels]
_EDGE_OPACITY = 0.8
_SHADOW, _SHADOW_OPACITY = (0.25, 0.30, 0.38), 0.16
_SUN = np.array([0.15, -0.1, 1.0])  # direction to the light that casts shadows


class Picture:
    """Renders the frames of a stage.

    Args:
        stage: what to render.
        width: of the pictures [pixels].
        height: of the pictures [pixels].
    """

    def __init__(self, stage: Stage, width: int, height: int) -> None:
        self._stage = stage
        self._raster = Rasterizer(stage.camera, width, height)
        self._line_scale = width / 1280.0
        self._caption = Caption(stage, width, height)
        self._obstacles = [
            _painted(body.mesh, body.placement.homogeneous, body.color) for body in stage.obstacles
        ]
        self._goal = self._posed(stage.run.scenario.goal, palette.GOAL)

    def frame(self, k: int) -> Image.Image:
        """Return the picture of the stage's frame k."""
        stage, raster = self._stage, self._raster
        raster.clear()
        robot = self._posed(stage.q[k])
        raster.lines(stage.floor, palette.FLOOR, _FLOOR_WIDTH * self._line_scale, 1.0)
        shadow = _shadow([robot, *self._obstacles], stage.floor[0, 0, 2])
        raster.fill(shadow, _SHADOW_OPACITY)
        raster.fill(robot)
        if stage.path is not None:
            raster.fill(_unlit(stage.path))
        for mesh, transforms in stage.closest_line.values():
            raster.fill(_unlit(_painted(mesh, transforms[k], palette.CLOSEST)))
        self._draw_translucent()
        image = Image.fromarray(raster.pixels())
        has_pairs = len(stage.closest.distance) > 0
        label = raster.position(stage.closest.points[k, 1]) if has_pairs else None
        self._caption.write(image, k, label)
        return image

    def _posed(self, q: Array, color: palette.Color | None = None) -> TriangleMesh:
        """Return the arm at q (nq,), in its own colours or in one."""
        poses = self._stage.joint_poses(q)
        return _joined(
            [
                _painted(body.mesh, placement.homogeneous, color or body.color)
                for body in self._stage.robot
                for placement in [poses[body.joint] * body.placement]
            ]
        )

    def _draw_translucent(self) -> None:
        """Draw goal and obstacles from the farthest to the nearest."""
        eye = self._stage.camera.target + self._stage.camera.offset
        meshes = [*self._obstacles, self._goal]
        away = [np.linalg.norm(mesh.vertices.mean(axis=0) - eye) for mesh in meshes]
        for k in np.argsort(away)[::-1]:
            if meshes[k] is self._goal:
                self._raster.fill(self._goal, palette.GOAL_OPACITY, _BEHIND)
                continue
            mesh, width = meshes[k], _EDGE_WIDTH * self._line_scale
            self._raster.fill(mesh, palette.OBSTACLE_OPACITY)
            self._raster.lines(mesh.edges, palette.EDGE, width, _EDGE_OPACITY)


def _painted(mesh: TriangleMesh, transform: Array, color: palette.Color) -> TriangleMesh:
    """Return a mesh of one colour, moved by a transform (4, 4)."""
    turn = transform[:3, :3].T
    return replace(
        mesh,
        vertices=mesh.vertices @ turn + transform[:3, 3],
        normals=mesh.normals @ turn,
        edges=mesh.edges @ turn + transform[:3, 3],
        colors=np.tile(color, (len(mesh.vertices), 1)),
    )


def _joined(meshes: list[TriangleMesh]) -> TriangleMesh:
    before = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + first for mesh, first in zip(meshes, before, strict=True)]
    return TriangleMesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.normals for mesh in meshes]),
        np.vstack(faces),
        np.concatenate([mesh.edges for mesh in meshes]),
        colors=np.vstack([mesh.colors for mesh in meshes if mesh.colors is not None]),
    )


def _unlit(mesh: TriangleMesh) -> TriangleMesh:
    return replace(mesh, normals=np.zeros_like(mesh.normals))


def _shadow(meshes: list[TriangleMesh], height: float) -> TriangleMesh:
    """Return the shadows on the floor at a height [m]."""
    mesh = _unlit(_joined(meshes))
    fallen = mesh.vertices - (mesh.vertices[:, 2:] - height) * _SUN / _SUN[2]
    return replace(mesh, vertices=fallen, colors=np.tile(_SHADOW, (len(fallen), 1)))
