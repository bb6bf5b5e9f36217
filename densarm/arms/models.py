"""From a RobotDescription to Pinocchio's models: URDF, locked joints, base, shapes, held bodies."""

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from densarm.arms.collision_shapes import differentiable_geometry, evenly_filled
from densarm.arms.description import RobotDescription, parse_robot_xml
from densarm.arms.joints import lock_joints
from densarm.arms.link_pieces import CutGeometry, cut_into_pieces
from densarm.arms.self_collision import (
    ExcludedPair,
    add_self_collision_pairs,
    remove_always_colliding_pairs,
)
from densarm.arms.urdf import Urdf
from densarm.errors import InvalidValueError, RobotDescriptionError, UnknownNameError
from densarm.scene.obstacles import geometry_objects
from densarm.scene.scene import Attachment
from densarm.scene.shapes import FARTHEST
from densarm.values.checks import finite_vector, unit_quaternion

_SAMPLES = 5
_SINGULAR = 1e-10
_COLOR = np.array([0.36, 0.42, 0.58, 1.0])  # of held bodies; links are as a rule white or grey


class RobotModels(NamedTuple):
    """Pinocchio's models of one arm; the collision model holds its self-collision pairs."""

    model: pin.Model
    collision: pin.GeometryModel
    excluded_pairs: tuple[ExcludedPair, ...]
    """The pairs of shapes that it leaves out."""
    self_pieces: frozenset[str]
    """Names of the shapes that are in self-collision pairs alone."""
    mesh_files: dict[str, Path]
    """The collision meshes that were read, by their path from the folder that holds them all."""
    links_without_collision: tuple[str, ...]
    """The links that the URDF draws and gives no collision geometry."""


class RobotOutline(NamedTuple):
    """Joints, shapes and pairs of an arm.

    Pairs that always collide count among the others: to find them takes the meshes.
    """

    n_joints: int
    """Joints that move."""
    n_moving_shapes: int
    """Collision shapes that a joint moves."""
    n_pairs: int
    """Self-collision pairs."""
    n_excluded: int
    """Pairs of shapes that move against each other and are left out."""


def build_models(description: RobotDescription) -> RobotModels:
    """Build Pinocchio's model and collision geometry of an arm."""
    urdf = Urdf(description)
    try:
        model, collision = _placed_models(description, urdf, pin.GeometryType.COLLISION)
        _require_arm(model)
        if collision.ngeoms == 0:
            raise RobotDescriptionError(
                f"robot {description.name!r}: the URDF has no <collision> geometry, so no distance "
                "can be computed: add shapes or meshes to its links"
            )
        files = _mesh_files(collision)
        drawn = collision
        collision = differentiable_geometry(model, drawn, description.shapes)
    except RobotDescriptionError as error:
        raise _with_advice(error, urdf.links_without_collision) from None
    excluded = add_self_collision_pairs(model, collision, description.srdf)
    excluded += remove_always_colliding_pairs(model, collision)
    cut = CutGeometry(collision, excluded, frozenset())
    if description.shapes != "capsule":
        everywhere = description.shapes == "pieces"
        cut = cut_into_pieces(model, collision, drawn, excluded, everywhere=everywhere)
    collision = cut.geometry
    _attach(model, collision, description.attachments, cut.self_pieces)
    for attachment in description.attachments:
        if attachment.mass > 0.0:
            items = _attached_shapes(model, attachment)
            inertia = evenly_filled(items, attachment.mass)
            model.appendBodyToJoint(items[0].parentJoint, inertia, pin.SE3.Identity())
    without_collision = urdf.links_without_collision
    return RobotModels(model, *cut, files, without_collision)


def build_collision_meshes(description: RobotDescription) -> pin.GeometryModel:
    """Build Pinocchio's collision geometry as the URDF has it, which an arm's shapes enclose."""
    return _placed_models(description, Urdf(description), pin.GeometryType.COLLISION)[1]


def build_visual_model(description: RobotDescription) -> pin.GeometryModel:
    """Build Pinocchio's visual geometry, whose meshes take most of an arm's loading time."""
    model, visual = _placed_models(description, Urdf(description), pin.GeometryType.VISUAL)
    _attach(model, visual, description.attachments)
    return visual


def robot_outline(description: RobotDescription) -> RobotOutline:
    """Return what can be told of an arm without a look into its meshes."""
    root = parse_robot_xml(description.urdf, "URDF")
    for mesh in root.iter("mesh"):
        mesh.tag = "box"
        mesh.attrib = {"size": "1 1 1"}
    description = replace(description, urdf=ElementTree.tostring(root, encoding="unicode"))
    model, geometry = _placed_models(description, Urdf(description), pin.GeometryType.COLLISION)
    geometry = differentiable_geometry(model, geometry)
    excluded = add_self_collision_pairs(model, geometry, description.srdf)
    _attach(model, geometry, description.attachments)
    moving = [item for item in geometry.geometryObjects if item.parentJoint > 0]
    return RobotOutline(model.nv, len(moving), len(geometry.collisionPairs), len(excluded))


def end_effector_frame(model: pin.Model, name: str | None) -> int:
    """Return the index of a frame, of the link where a joint shares its name; None for the last."""
    frames = list(model.frames)
    if name is None:
        last = model.njoints - 1
        return max(k for k, frame in enumerate(frames) if frame.parentJoint == last)
    named = [k for k, frame in enumerate(frames) if frame.name == name]
    if not named:
        raise UnknownNameError("end-effector frame", name, [frame.name for frame in frames])
    return max(named, key=lambda k: bool(frames[k].type == pin.FrameType.BODY))


def _placed_models(
    description: RobotDescription, urdf: Urdf, kind: pin.GeometryType
) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the model without locked joints and the geometry as the URDF has it, on their base."""
    model, geometry = lock_joints(urdf, urdf.geometry(kind), description.locked_joints)
    placement = finite_vector("base_placement", description.base_placement, 7)
    placement[3:] = unit_quaternion("base_placement orientation", placement[3:])
    _place_base(model, geometry, pin.XYZQUATToSE3(placement))
    return model, geometry


def _place_base(model: pin.Model, geometry: pin.GeometryModel, base: pin.SE3) -> None:
    """Move the joints, frames and shapes fixed to the world; gravity stays as it is."""
    for item in geometry.geometryObjects:
        if item.parentJoint == 0:
            item.placement = base * item.placement
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = base * model.jointPlacements[joint]
    for frame in list(model.frames)[1:]:
        if frame.parentJoint == 0:
            frame.placement = base * frame.placement


def _mesh_files(geometry: pin.GeometryModel) -> dict[str, Path]:
    items = dict.fromkeys(Path(item.meshPath) for item in geometry.geometryObjects)
    files = [path.resolve() for path in items if path.is_file()]
    common = os.path.commonpath([file.parent for file in files]) if files else ""
    return {file.relative_to(common).as_posix(): file for file in files}


def _with_advice(error: RobotDescriptionError, drawn_only: tuple[str, ...]) -> Exception:
    """Return an error that, where it is about a visual mesh, says how to do without."""
    for link in drawn_only:
        if f"link {link!r}" in str(error):
            advice = "it has no <collision>; collision_from_visual='never' leaves it out"
            return RobotDescriptionError(f"{error} ({advice})")
    return error


def _require_arm(model: pin.Model) -> None:
    if model.nv == 0:
        raise RobotDescriptionError("the robot has no joint to move")
    for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
        reason = _unusable(model, joint) or _immovable(model, joint)
        if reason:
            raise RobotDescriptionError(f"joint {name!r} {reason}")
    for name, inertia in zip(model.names, model.inertias, strict=True):
        if inertia.mass < 0.0:
            raise RobotDescriptionError(f"the links that joint {name!r} moves have a negative mass")
    _require_inertia(model)


def _unusable(model: pin.Model, joint: pin.JointModel) -> str:
    if joint.nv != 1:
        return (
            f"has {joint.nv} degrees of freedom: only revolute, continuous and prismatic joints "
            "are supported (locked_joints takes it at 0, its neutral pose)"
        )
    if not (np.abs(model.jointPlacements[joint.id].translation) < FARTHEST).all():
        return "has an origin that is not finite, or beyond 1000 km"
    if np.abs(joint.createData().S).max() == 0.0:
        return "has the axis 0 0 0, which has no direction"
    return ""


def _immovable(model: pin.Model, joint: pin.JointModel) -> str:
    low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
    if joint.nq == 2 or low < high:
        return ""
    if low == high:
        mend = "widen them, make it continuous, or lock it"
        return f"cannot move, as both its limits are {low:g}: {mend}"
    return f"has a lower limit {low:g} above its upper limit {high:g}"


def _require_inertia(model: pin.Model) -> None:
    """Refuse joints that make the mass matrix singular, at rest or at random configurations."""
    data = model.createData()
    random = np.random.default_rng(0)
    for k in range(_SAMPLES):
        step = np.minimum(k, 1) * random.uniform(-np.pi, np.pi, model.nv)
        mass = pin.crba(model, data, pin.integrate(model, pin.neutral(model), step))
        pin.cholesky.decompose(model, data)
        # The inertia about a joint while the joints after it are free, and while they are held.
        enough = (_SINGULAR * np.diagonal(mass) < data.D) & np.isfinite(data.D)
        if not enough.all():
            name = list(model.names)[1:][int(np.flatnonzero(~enough)[-1])]
            raise RobotDescriptionError(
                f"joint {name!r} moves no mass, or an inertia that is not positive, so the mass "
                "matrix is singular: give its links an <inertial> with their mass, or lock it"
            )


def _attach(
    model: pin.Model,
    geometry: pin.GeometryModel,
    attachments: Iterable[Attachment],
    self_pieces: frozenset[str] = frozenset(),
) -> None:
    """Add the shapes of held bodies; each pairs with what moves against it and it may not touch."""
    held = [(body, item) for body in attachments for item in _attached_shapes(model, body)]
    for _, item in held:
        if geometry.existGeometryName(item.name):
            allowed = "other than the names of the arm's shapes and attached bodies"
            raise InvalidValueError("name of attached body", item.name, allowed)
        item.meshColor = _COLOR
        geometry.addGeometryObject(item)
    links = [model.frames[item.parentFrame].name for item in geometry.geometryObjects]
    joints = [item.parentJoint for item in geometry.geometryObjects]
    whole = [k for k, o in enumerate(geometry.geometryObjects) if o.name not in self_pieces]
    for attachment, item in held:
        for link in attachment.touch_links:
            _frame(model, link, attachment)
        index = geometry.getGeometryId(item.name)
        for other in whole:
            if joints[other] != item.parentJoint and links[other] not in attachment.touch_links:
                # Pinocchio refuses the pair that two attached bodies both ask for.
                pair = pin.CollisionPair(min(index, other), max(index, other))
                if not geometry.existCollisionPair(pair):
                    geometry.addCollisionPair(pair)


def _attached_shapes(model: pin.Model, attachment: Attachment) -> list[pin.GeometryObject]:
    index = _frame(model, attachment.link, attachment)
    frame = model.frames[index]
    return geometry_objects(attachment.body, frame.parentJoint, index, frame.placement)


def _frame(model: pin.Model, link: str, attachment: Attachment) -> int:
    names = [frame.name for frame in model.frames]
    if link not in names:
        raise UnknownNameError(f"link for {attachment.body.name!r}", link, names)
    return names.index(link)
