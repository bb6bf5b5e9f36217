"""RobotOutline: joints, shapes and pairs of an arm, without a look into its meshes."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from typing import NamedTuple

import pinocchio as pin

from densarm.robot.attached_bodies import add_attached_pairs, add_attached_shapes
from densarm.robot.robot_description import RobotDescription, parse_robot_xml
from densarm.robot.robot_models import placed_models
from densarm.robot.self_collision import add_self_collision_pairs
from densarm.robot.urdf import Urdf
from densarm.shapes import differentiable_geometry


class RobotOutline(NamedTuple):
    """What can be told of an arm in milliseconds.

    Pairs that collide in every random configuration count among the others: to find them takes the
    meshes. No robot of the catalogue has any.
    """

    n_joints: int
    """Joints that move."""
    n_moving_shapes: int
    """Collision shapes that a joint moves."""
    n_pairs: int
    """Self-collision pairs."""
    n_excluded: int
    """Pairs of shapes that move against each other and are left out."""


def robot_outline(description: RobotDescription) -> RobotOutline:
    """Return the outline of an arm.

    Args:
        description: the arm.

    Raises:
        RobotDescriptionError: the URDF or SRDF cannot be used, with the reason.
        UnknownNameError: a locked joint or a link that the URDF does not have.
    """
    description = _without_meshes(description)
    model, geometry = placed_models(description, Urdf(description), pin.GeometryType.COLLISION)
    geometry = differentiable_geometry(model, geometry)
    excluded = add_self_collision_pairs(model, geometry, description.srdf)
    add_attached_shapes(model, geometry, description.attachments)
    add_attached_pairs(model, geometry, description.attachments)
    moving = [item for item in geometry.geometryObjects if item.parentJoint > 0]
    return RobotOutline(model.nv, len(moving), len(geometry.collisionPairs), len(excluded))


def _without_meshes(description: RobotDescription) -> RobotDescription:
    """Put a box in place of each mesh."""
    root = parse_robot_xml(description.urdf, "URDF")
    for mesh in root.iter("mesh"):
        mesh.tag = "box"
        mesh.attrib = {"size": "1 1 1"}
    return replace(description, urdf=ElementTree.tostring(root, encoding="unicode"))
