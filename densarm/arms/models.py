"""From a RobotDescription to Pinocchio's models: URDF, locked joints, base, shapes, held bodies."""

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from densarm.arms.collision_shapes import (
    differentiable_geometry,
    evenly_filled,
    thicken_flat_shapes,
)
from densarm.arms.description import RobotDescription, parse_robot_xml
from densarm.arms.joints import lock_joints
from densarm.arms.link_pieces import CutGeometry, cut_into_pieces
from densarm.arms.masses import (
    DEFAULT_DENSITY,
    add_masses,
    links_without_inertial,
    needed_masses,
)
from densarm.arms.pose import Pose
from densarm.arms.self_collision import (
    ExcludedPair,
    add_self_collision_pairs,
    remove_always_colliding_pairs,
    unknown_links,
)
from densarm.arms.urdf import Urdf
from densarm.errors import InvalidValueError, RobotDescriptionError, UnknownNameError
from densarm.scene.obstacles import geometry_objects
from densarm.scene.scene import Attachment
from densarm.scene.shapes import FARTHEST
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, unit_quaternion

_NEAR = 10.0  # [m] from the world's origin, up to which models are about that
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
    remarks: tuple[str, ...]
    """What was taken otherwise than the URDF and SRDF have it, one phrase each."""
    links_without_mass: tuple[str, ...]
    """The links that joints move without any mass, where the mass matrix is singular for them."""
    origin: Array
    """The point of the world about which they are (3,) [m].

    It is that of the first joint, if that is far from the world's own: dynamics about a point 1 km
    off lose six digits, and about one 500 km off all of them.
    """


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
        model, collision, origin = _placed_models(description, urdf, pin.GeometryType.COLLISION)
        _require_arm(model, urdf)
        if collision.ngeoms == 0:
            raise RobotDescriptionError(
                f"robot {description.name!r}: the URDF has no <collision> geometry, so no distance "
                "can be computed: add shapes or meshes to its links"
            )
        files = _mesh_files(collision)
        flat = thicken_flat_shapes(model, collision)
        described = collision
        collision = differentiable_geometry(model, described, description.shapes)
    except RobotDescriptionError as error:
        raise _with_advice(error, urdf.links_without_collision) from None
    if description.inertia == "from_shapes":
        lacking = links_without_inertial(urdf.root)
        add_masses(model, described, lacking, description.density or DEFAULT_DENSITY)
    needed = needed_masses(model)
    excluded = add_self_collision_pairs(model, collision, description.srdf)
    excluded += remove_always_colliding_pairs(model, collision)
    cut = CutGeometry(collision, excluded, frozenset())
    if description.shapes != "capsule":
        everywhere = description.shapes == "pieces"
        cut = cut_into_pieces(model, collision, described, excluded, everywhere=everywhere)
    collision = cut.geometry
    _attach(model, collision, description.attachments, cut.self_pieces)
    for attachment in description.attachments:
        if attachment.mass > 0.0:
            items = _attached_shapes(model, attachment)
            inertia = evenly_filled(items, attachment.mass)
            model.appendBodyToJoint(items[0].parentJoint, inertia, pin.SE3.Identity())
    _add_frames(model, description.frames)
    remarks = (*description.remarks, *urdf.remarks, *flat, *unknown_links(model, description.srdf))
    drawn = urdf.links_without_collision
    return RobotModels(model, *cut, files, drawn, remarks, needed, origin)


def build_collision_meshes(description: RobotDescription) -> pin.GeometryModel:
    """Build Pinocchio's collision geometry as the URDF has it, which an arm's shapes enclose."""
    return _placed_models(description, Urdf(description), pin.GeometryType.COLLISION)[1]


def build_visual_model(description: RobotDescription) -> pin.GeometryModel:
    """Build Pinocchio's visual geometry, whose meshes take most of an arm's loading time."""
    model, visual, _ = _placed_models(description, Urdf(description), pin.GeometryType.VISUAL)
    _attach(model, visual, description.attachments)
    return visual


def robot_outline(description: RobotDescription) -> RobotOutline:
    """Return what can be told of an arm without a look into its meshes."""
    root = parse_robot_xml(description.urdf, "URDF")
    for mesh in root.iter("mesh"):
        mesh.tag = "box"
        mesh.attrib = {"size": "1 1 1"}
    description = replace(description, urdf=ElementTree.tostring(root, encoding="unicode"))
    model, geometry, _ = _placed_models(description, Urdf(description), pin.GeometryType.COLLISION)
    geometry = differentiable_geometry(model, geometry)
    excluded = add_self_collision_pairs(model, geometry, description.srdf)
    _attach(model, geometry, description.attachments)
    moving = [item for item in geometry.geometryObjects if item.parentJoint > 0]
    return RobotOutline(model.nv, len(moving), len(geometry.collisionPairs), len(excluded))


def frame_index(model: pin.Model, name: str | None, kind: str = "frame") -> int:
    """Return the index of a frame, of the link where a joint shares its name; None for the last."""
    frames = list(model.frames)
    if name is None:
        last = model.njoints - 1
        return max(k for k, frame in enumerate(frames) if frame.parentJoint == last)
    named = [k for k, frame in enumerate(frames) if frame.name == name]
    if not named:
        raise UnknownNameError(kind, name, {frame.name for frame in frames[1:]})
    return max(named, key=lambda k: bool(frames[k].type == pin.FrameType.BODY))


def _placed_models(
    description: RobotDescription, urdf: Urdf, kind: pin.GeometryType
) -> tuple[pin.Model, pin.GeometryModel, Array]:
    """Return the model without locked joints, the geometry as the URDF has it, and their origin."""
    model, geometry = lock_joints(urdf, urdf.geometry(kind), description.locked_joints)
    placement = finite_vector("base_placement", description.base_placement, 7)
    placement[3:] = unit_quaternion("base_placement orientation", placement[3:])
    base = pin.XYZQUATToSE3(placement)
    first = base.act(model.jointPlacements[1].translation) if model.njoints > 1 else np.zeros(3)
    origin = first if _NEAR < np.linalg.norm(first) < FARTHEST else np.zeros(3)
    base.translation -= origin
    _place_base(model, geometry, base)
    return model, geometry, origin


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


def _require_arm(model: pin.Model, urdf: Urdf) -> None:
    if model.nv == 0:
        raise RobotDescriptionError("the robot has no joint to move")
    joints = list(zip(list(model.joints)[1:], list(model.names)[1:], strict=True))
    stuck = [name for joint, name in joints if joint.nq == 1 and len({*_limits(model, joint)}) == 1]
    for joint, name in joints:
        reason = _unusable(model, joint) or _immovable(model, joint, stuck)
        if reason:
            raise RobotDescriptionError(f"joint {name!r} {reason}")
    for joint, inertia in enumerate(model.inertias):
        if inertia.mass < 0.0:
            fixed = {frame.name for frame in model.frames if frame.parentJoint == joint}
            link, mass = min(
                urdf.masses().items(), key=lambda item: (item[0] not in fixed, item[1])
            )
            raise RobotDescriptionError(
                f"link {link!r} has the negative mass {mass:g}: its <inertial> needs one above zero"
            )


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


def _limits(model: pin.Model, joint: pin.JointModel) -> tuple[float, float]:
    return model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]


def _immovable(model: pin.Model, joint: pin.JointModel, stuck: list[str]) -> str:
    low, high = _limits(model, joint)
    if joint.nq == 2 or low < high:
        return ""
    if low == high:
        listed = ", ".join(f"{name!r}: position" for name in stuck)
        mend = f"widen them, make it continuous, or lock by locked_joints={{{listed}}}"
        return f"cannot move, as both its limits are {low:g}: {mend}"
    return f"has a lower limit {low:g} above its upper limit {high:g}"


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


def _add_frames(model: pin.Model, frames: Mapping[str, Pose]) -> None:
    """Add frames of one's own, each given by its pose in the frame of a link."""
    for name, pose in frames.items():
        if pose.free is not None:
            raise InvalidValueError(f"frames.{name}.free", pose.free, "none: a frame has one pose")
        if model.existFrame(name):
            raise InvalidValueError("name of frame", name, "other than those of the URDF's frames")
        index = frame_index(model, pose.frame, f"link for frame {name!r}")
        joint, link = model.frames[index].parentJoint, model.frames[index].placement
        kind = pin.FrameType.OP_FRAME
        model.addFrame(pin.Frame(name, joint, index, link * pose.placement, kind))


def _attached_shapes(model: pin.Model, attachment: Attachment) -> list[pin.GeometryObject]:
    index = _frame(model, attachment.link, attachment)
    frame = model.frames[index]
    return geometry_objects(attachment.body, frame.parentJoint, index, frame.placement)


def _frame(model: pin.Model, link: str, attachment: Attachment) -> int:
    names = [frame.name for frame in model.frames]
    if link not in names:
        raise UnknownNameError(f"link for {attachment.body.name!r}", link, names)
    return names.index(link)
