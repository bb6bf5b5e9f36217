"""Bodies: geometry that moves with joints, as meshcat draws it."""

from collections.abc import Iterable
from typing import Any

import coal
import meshcat
import meshcat.geometry
import numpy as np
import pinocchio as pin
from pinocchio.visualize.meshcat_visualizer import loadMesh, loadPrimitive

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.obstacles import geometry_objects
from densarm.scene import Scene

WORLD = 0
"""Index of the joint that carries what does not move."""

_BOARD_WIDTH, _BOARD_THICKNESS = 3.0, 0.01  # [m], of what is drawn of a half-space


class Sphere(meshcat.geometry.Sphere):
    """Meshcat's sphere with a round outline."""

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        """Return the sphere as three.js reads it."""
        return {**super().lower(object_data), "widthSegments": 48, "heightSegments": 32}


class Tube(meshcat.geometry.Geometry):
    """A tube along a curve, since browsers draw every line one pixel wide.

    Args:
        points: (N, 3) on the curve [m], N ≥ 2, all different from their neighbours.
        radius: of the tube [m].
    """

    def __init__(self, points: Array, radius: float) -> None:
        super().__init__()
        self.points = points
        self.radius = radius

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:  # noqa: ARG002
        """Return the tube as three.js reads it."""
        curve = {
            "type": "CatmullRomCurve3",
            "arcLengthDivisions": 4 * len(self.points),
            "points": self.points.tolist(),
            "closed": False,
            "curveType": "centripetal",
        }
        return {
            "uuid": self.uuid,
            "type": "TubeGeometry",
            "path": curve,
            "tubularSegments": 2 * len(self.points),
            "radius": self.radius,
            "radialSegments": 10,
            "closed": False,
        }


class Bodies:
    """Geometry objects with their meshes, which several drawings of them share.

    Args:
        objects: Pinocchio's geometry objects, placed in the frames of their parent joints.
    """

    def __init__(self, objects: Iterable[pin.GeometryObject]) -> None:
        self.objects = tuple(objects)
        self._meshes = [_mesh(item) for item in self.objects]

    def draw(self, viewer: meshcat.Visualizer, names: list[str], **material: Any) -> None:
        """Draw each object below the node of its joint.

        Args:
            viewer: the node that the joints' nodes belong under.
            names: node name of each joint.
            material: properties of three.js' Phong material; `color` defaults to the object's own.
        """
        for item, mesh in zip(self.objects, self._meshes, strict=True):
            look = {
                "color": _hexadecimal(item.meshColor),
                "opacity": float(item.meshColor[3]),
                "flatShading": isinstance(item.geometry, coal.ConvexBase),
                **material,
            }
            node = viewer[names[item.parentJoint]][item.name]
            node.set_object(mesh, meshcat.geometry.MeshPhongMaterial(**look))
            node.set_transform(item.placement.homogeneous)

    def corners(self, joint_poses: list[pin.SE3]) -> Array:
        """Return the corners (8 K, 3) of the objects' bounding boxes in the world frame [m].

        Args:
            joint_poses: pose of each joint in the world.
        """
        return np.vstack(
            [
                _box_corners(item.geometry) @ pose.rotation.T + pose.translation
                for item in self.objects
                for pose in [joint_poses[item.parentJoint] * item.placement]
            ]
        )


def arm_bodies(arm: Arm) -> Bodies:
    """Return the visual geometry of an arm, and the collision geometry of links without one."""
    visual = list(arm.visual_model.geometryObjects)
    seen = {item.parentFrame for item in visual}
    plain = [item for item in arm.collision_model.geometryObjects if item.parentFrame not in seen]
    return Bodies(visual + plain)


def scene_bodies(scene: Scene) -> Bodies:
    """Return the obstacles but half-spaces, in the shapes that distances are measured to."""
    return Bodies(item for item in _scene_objects(scene) if not _is_endless(item))


def scene_boards(scene: Scene) -> Bodies:
    """Return a thin board for each half-space, at the part of its surface nearest the origin."""
    return Bodies(_board(item) for item in _scene_objects(scene) if _is_endless(item))


def _scene_objects(scene: Scene) -> list[pin.GeometryObject]:
    return [item for obstacle in scene for item in geometry_objects(obstacle)]


def _is_endless(item: pin.GeometryObject) -> bool:
    return isinstance(item.geometry, coal.Halfspace)


def _board(item: pin.GeometryObject) -> pin.GeometryObject:
    normal = item.placement.rotation @ item.geometry.n
    surface = item.geometry.d + normal @ item.placement.translation
    board = coal.Box(_BOARD_WIDTH, _BOARD_WIDTH, _BOARD_THICKNESS)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).toRotationMatrix()
    pose = pin.SE3(turn, (surface - 0.5 * _BOARD_THICKNESS) * normal)
    return pin.GeometryObject(item.name, WORLD, WORLD, pose, board)


def _mesh(item: pin.GeometryObject) -> meshcat.geometry.Geometry:
    if isinstance(item.geometry, coal.Sphere):
        return Sphere(item.geometry.radius)
    if isinstance(item.geometry, coal.ShapeBase):
        return loadPrimitive(item)
    return loadMesh(item.geometry)


def _hexadecimal(rgba: Array) -> int:
    red, green, blue = (round(255 * float(part)) for part in rgba[:3])
    return red << 16 | green << 8 | blue


def _box_corners(geometry: coal.CollisionGeometry) -> Array:
    geometry.computeLocalAABB()
    low, high = geometry.aabb_local.min_, geometry.aabb_local.max_
    signs = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, 8).T
    return np.asarray(low + signs * (high - low))
