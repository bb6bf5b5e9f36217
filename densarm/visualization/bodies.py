"""Bodies: named surfaces that move with the joints of an arm."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.scene.obstacles import Obstacle, geometry_objects
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene
from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array
from densarm.visualization.palette import BOARD, OBSTACLE, SENSING, Color
from densarm.visualization.triangle_mesh import TriangleMesh, mesh_of, octahedra, sphere_swept_hull

WORLD = 0
"""Index of the joint that carries what does not move."""

_MOST_POINTS = 20_000  # of a cloud that are drawn
_DRAWN_SHARE = 0.4  # of their radius, so that one can see through
_BOARD_THICKNESS = 0.01  # [m], of what is drawn of a half-space


@dataclass(frozen=True)
class Body:
    """A surface in the frame of a joint."""

    name: str
    joint: int
    """Index of the joint that carries it."""
    placement: pin.SE3
    """Pose of the mesh in the joint's frame."""
    mesh: TriangleMesh
    color: Color
    shape: coal.CollisionGeometry
    """What the mesh is the surface of; of a cloud, each of its balls."""
    is_cloud: bool = False

    def corners(self, joint_poses: Sequence[pin.SE3]) -> Array:
        """Return the bounding box's corners (8, 3) in the world [m], given the joints' poses."""
        pose = joint_poses[self.joint] * self.placement
        return np.asarray(self._local_corners @ pose.rotation.T + pose.translation)

    @cached_property
    def _local_corners(self) -> Array:
        low, high = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        signs = np.array(list(product((0, 1), repeat=3)))
        return np.asarray(low + signs * (high - low))


def arm_bodies(arm: Arm) -> tuple[Body, ...]:
    """Return the visual geometry of an arm, and the collision geometry of links without one."""
    visual = list(arm.visual_model.geometryObjects)
    seen = {item.parentFrame for item in visual}
    whole = [x for x in arm.collision_model.geometryObjects if x.name not in arm.self_pieces]
    plain = [item for item in whole if item.parentFrame not in seen]
    return tuple(_body(item, tuple(item.meshColor[:3].tolist())) for item in visual + plain)


def obstacle_bodies(scene: Scene, origin: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Body, ...]:
    """Return the obstacles that have an end, seen from a point (3,) [m], as distances are of.

    A cloud is a small octahedron for each point, of 20,000 points at most.
    """
    return tuple(
        _drawn(obstacle, item)
        for obstacle, item in _items(scene, origin)
        if not isinstance(item.geometry, coal.Halfspace)
    )


def half_space_bodies(
    scene: Scene, middle: Array, width: float, origin: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[Body, ...]:
    """Return boards for half-spaces, square, of a width [m], where they are nearest a middle (3,).

    The z axis of each points out of the half-space; its placement is on the surface.
    """
    return tuple(
        _board(item, middle, width)
        for _, item in _items(scene, origin)
        if isinstance(item.geometry, coal.Halfspace)
    )


def spoken_names(arm: Arm, names: Iterable[str]) -> dict[str, str]:
    """Return for names of bodies what a person would say: without a robot's own prefix, as words.

    That is "link 4" for the shape ``j2s6s200_link_4_0``, and "left ball" for ``left_ball``.
    """
    shapes, frames = arm.collision_model.geometryObjects, arm.model.frames
    links = {item.name: frames[item.parentFrame].name for item in shapes}
    links = {shape: link for shape, link in links.items() if shape.startswith(f"{link}_")}
    prefix = next(iter(links.values()), "").partition("_")[0] + "_"
    if all(re.match(rf"{re.escape(prefix)}[a-zA-Z]", link) for link in links.values()):
        links = {shape: link.removeprefix(prefix) for shape, link in links.items()}
    links = {shape: _link_in_words(link) for shape, link in links.items()}
    return {name: links.get(name, name.replace("_", " ")) for name in names}


def _link_in_words(link: str) -> str:
    """Return "left finger" for ``leftfinger``, "link 1" for ``link01``, "base" for ``link_base``.

    A "forearm link" is a forearm, but an "upper link" is no "upper".
    """
    words = re.sub(r"^(left|right)(?=[a-z])", r"\1 ", link.replace("_", " "))
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", words).lower()
    words = re.sub(r"(?<=[a-z])0*(?=\d)", " ", words)
    words = re.sub(r"^link (?=[a-z])", "", words)
    return re.sub(r"(arm|base|shoulder|elbow|wrist|hand)( \d)? link$", r"\1\2", words)


def sensing_bodies(obstacles: Sequence[Body], distance: float) -> tuple[Body, ...]:
    """Return all that is within a distance [m] of each obstacle but clouds, none a half-space."""
    return tuple(
        replace(body, mesh=sphere_swept_hull(points, radius + distance), color=SENSING)
        for body in obstacles
        if not body.is_cloud
        for points, radius in [extreme_points(body.shape)]
    )


def _items(scene: Scene, origin: ArrayLike) -> Iterator[tuple[Obstacle, pin.GeometryObject]]:
    for obstacle in scene:
        for item in geometry_objects(obstacle, origin=origin):
            yield obstacle, item


def _drawn(obstacle: Obstacle, item: pin.GeometryObject) -> Body:
    if isinstance(obstacle, PointCloud):
        every = -(-len(obstacle.points) // _MOST_POINTS)
        mesh = octahedra(obstacle.points[::every], _DRAWN_SHARE * obstacle.radius)
        return Body(item.name, WORLD, item.placement, mesh, OBSTACLE, item.geometry, is_cloud=True)
    return _body(item, OBSTACLE)


def _board(item: pin.GeometryObject, middle: Array, width: float) -> Body:
    normal = item.placement.rotation @ item.geometry.n
    above = normal @ (middle - item.placement.translation) - item.geometry.d
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).toRotationMatrix()
    corners = np.array(list(product((-0.5, 0.5), (-0.5, 0.5), (-1.0, 0.0))))
    mesh = sphere_swept_hull(corners * [width, width, _BOARD_THICKNESS], 0.0)
    mesh = replace(mesh, edges=mesh.edges[:0])  # which are not the half-space's
    return Body(
        item.name, WORLD, pin.SE3(turn, middle - above * normal), mesh, BOARD, item.geometry
    )


def _body(item: pin.GeometryObject, color: Color) -> Body:
    shape = item.geometry
    return Body(item.name, item.parentJoint, item.placement, mesh_of(shape), color, shape)
