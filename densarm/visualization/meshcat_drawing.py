"""A render scene, drawn by meshcat's commands."""

from collections.abc import Mapping, Sequence
from typing import Any

import meshcat
import meshcat.animation
import meshcat.geometry
import numpy as np
import pinocchio as pin

from densarm.arms.pose import Pose
from densarm.values.arrays import Array
from densarm.visualization import palette
from densarm.visualization.bodies import Body, sensing_bodies
from densarm.visualization.camera import FIELD_OF_VIEW
from densarm.visualization.palette import Color, hexadecimal
from densarm.visualization.render_scene import RenderScene
from densarm.visualization.triangle_mesh import TriangleMesh

_SKY, _HORIZON = [1.0, 1.0, 1.0], [0.86, 0.89, 0.92]
_LIGHTS = {"AmbientLight": 0.5, "FillLight": 0.3}  # meshcat's own values bleach light colours
_AXES = 25.0  # length of a goal's axes, in radii of the path
_GOAL_LOOK = {
    "color": hexadecimal(palette.GOAL),
    "opacity": palette.GOAL_OPACITY,
    "side": 0,
    "depthWrite": False,
    # The arm at its goal covers its copy instead of flickering with it.
    "polygonOffset": True,
    "polygonOffsetFactor": 1.0,
    "polygonOffsetUnits": 1.0,
}


class MeshGeometry(meshcat.geometry.Geometry):
    """A triangle mesh as three.js reads it."""

    def __init__(self, mesh: TriangleMesh) -> None:
        super().__init__()
        self.mesh = mesh

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:  # noqa: ARG002
        """Return the mesh's arrays; the viewer finds the normals of a smooth mesh by itself."""
        mesh, pack = self.mesh, meshcat.geometry.pack_numpy_array
        attributes = {"position": pack(mesh.vertices.T)}
        if not mesh.is_smooth:
            attributes["normal"] = pack(mesh.normals.T)
        if mesh.colors is not None:
            attributes["color"] = pack(mesh.colors.T)
        index = pack(mesh.faces.astype(np.uint32).T)
        data = {"attributes": attributes, "index": index}
        return {"uuid": self.uuid, "type": "BufferGeometry", "data": data}


def draw(scene: RenderScene, viewer: meshcat.Visualizer) -> None:
    """Draw a render scene with its motion as an animation, the sensing region hidden."""
    _draw_surroundings(viewer, scene)
    _place_camera(viewer, scene)
    meshes = [MeshGeometry(body.mesh) for body in scene.robot]
    _draw_arm(viewer["robot"], scene, meshes, scene.q[0])
    if (goal := scene.run.task.goal) is not None:
        _draw_arm(viewer["goal"], scene, meshes, goal, _GOAL_LOOK)
    _draw_poses(viewer["goal"], scene)
    _draw_obstacles(viewer, scene)
    if scene.path is not None:
        look = meshcat.geometry.MeshBasicMaterial(vertexColors=True)
        viewer["path"].set_object(MeshGeometry(scene.path), look)
    look = meshcat.geometry.MeshBasicMaterial(color=hexadecimal(palette.CLOSEST))
    for name, (mesh, transforms) in scene.closest_line.items():
        viewer["closest"][name].set_object(MeshGeometry(mesh), look)
        viewer["closest"][name].set_transform(transforms[0])
    viewer.set_animation(_animation(viewer, scene), play=False)


def _draw_arm(
    node: meshcat.Visualizer,
    scene: RenderScene,
    meshes: Sequence[MeshGeometry],
    q: Array,
    look: dict[str, Any] | None = None,
) -> None:
    """Draw the arm at q (nq,), in its own colours or with another look."""
    for body, mesh in zip(scene.robot, meshes, strict=True):
        own_look = {"color": hexadecimal(body.color)}
        _draw_body(node[scene.joints[body.joint]][body.name], body, mesh, **(look or own_look))
    for name, pose in zip(scene.joints, scene.joint_poses(q), strict=True):
        node[name].set_transform(pose.homogeneous)


def _draw_poses(node: meshcat.Visualizer, scene: RenderScene) -> None:
    """Draw the poses that a scenario has for goals: axes, or where a position is all, a ball."""
    tables = scene.run.task.settings.get("goals", ())
    for k, table in enumerate(table for table in tables if isinstance(table, Mapping)):
        pose, size = Pose.of_table("goal", table), _AXES * scene.line_radius
        placement = pose.placement
        placement.translation -= scene.run.task.arm.origin
        if pose.orientation_xyzw is None:
            look = meshcat.geometry.MeshPhongMaterial(color=hexadecimal(palette.GOAL))
            node[f"pose_{k}"].set_object(meshcat.geometry.Sphere(0.1 * size), look)
        else:
            node[f"pose_{k}"].set_object(meshcat.geometry.triad(size))
        node[f"pose_{k}"].set_transform(placement.homogeneous)


def _draw_body(
    node: meshcat.Visualizer, body: Body, geometry: meshcat.geometry.Geometry, **look: Any
) -> None:
    node.set_object(geometry, meshcat.geometry.MeshPhongMaterial(**look))
    node.set_transform(body.placement.homogeneous)


def _draw_obstacles(viewer: meshcat.Visualizer, scene: RenderScene) -> None:
    sensing = sensing_bodies(scene.solids, scene.sensing_distance)
    for group, bodies, opacity in (
        ("obstacles", scene.obstacles, palette.OBSTACLE_OPACITY),
        ("sensing", sensing, palette.SENSING_OPACITY),
    ):
        for body in bodies:
            look = {"color": hexadecimal(body.color), "opacity": opacity}
            node = viewer[group][body.name]
            _draw_body(node, body, MeshGeometry(body.mesh), side=0, depthWrite=False, **look)
            if len(body.mesh.edges):
                _draw_lines(node["edges"], body.mesh.edges, palette.EDGE)
    viewer["sensing"].set_property("visible", False)


def _draw_lines(node: meshcat.Visualizer, lines: Array, color: Color) -> None:
    ends = meshcat.geometry.PointsGeometry(lines.reshape(-1, 3).T)
    look = meshcat.geometry.LineBasicMaterial(color=hexadecimal(color))
    node.set_object(meshcat.geometry.LineSegments(ends, look))


def _draw_surroundings(viewer: meshcat.Visualizer, scene: RenderScene) -> None:
    background = viewer["/Background"]
    background.set_property("top_color", _SKY)
    background.set_property("bottom_color", _HORIZON)
    for node in ("/Axes", "/Grid"):
        viewer[node].set_property("visible", False)
    for light, intensity in _LIGHTS.items():
        viewer[f"/Lights/{light}/<object>"].set_property("intensity", intensity)
    _draw_lines(viewer["floor"], scene.floor, palette.FLOOR)


def _place_camera(viewer: meshcat.Visualizer, scene: RenderScene) -> None:
    # The camera always looks at its node's origin, so the drawing moves instead.
    shift = np.eye(4)
    shift[:3, 3] = -scene.camera.target
    viewer.set_transform(shift)
    lens = viewer["/Cameras/default/rotated/<object>"]
    lens.set_property("fov", FIELD_OF_VIEW)
    x, y, z = scene.camera.offset.tolist()
    lens.set_property("position", [x, z, -y])  # this node has y upwards


def _animation(viewer: meshcat.Visualizer, scene: RenderScene) -> meshcat.animation.Animation:
    """Return the motion of joints and obstacles for meshcat's time line, which counts seconds."""
    poses = np.array([[pin.SE3ToXYZQUAT(pose) for pose in scene.joint_poses(q)] for q in scene.q])
    seconds = scene.time.tolist()
    animation = meshcat.animation.Animation()
    moving = [
        (viewer["robot"][name], poses[:, joint]) for joint, name in enumerate(scene.joints) if joint
    ]
    for name, placements in scene.obstacle_poses.items():
        rows = np.array([pin.SE3ToXYZQUAT(pose) for pose in placements])
        moving += [(viewer[group][name], rows) for group in ("obstacles", "sensing")]
    for node, rows in moving:
        tracks = {"position": ("vector3", rows[:, :3]), "quaternion": ("quaternion", rows[:, 3:])}
        animation.clips[node.path] = meshcat.animation.AnimationClip(
            {
                key: meshcat.animation.AnimationTrack(key, kind, seconds, values.tolist())
                for key, (kind, values) in tracks.items()
            },
            fps=1,
        )
    return animation
