"""From a RobotDescription to Pinocchio's models: URDF, locked joints, base placement, shapes."""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from densarm.errors import RobotDescriptionError, UnknownNameError
from densarm.robot.attached_bodies import (
    add_attached_inertia,
    add_attached_pairs,
    add_attached_shapes,
)
from densarm.robot.locked_joints import lock_joints, locked_positions, refuse_mimics
from densarm.robot.robot_description import RobotDescription
from densarm.robot.self_collision import (
    ExcludedPair,
    add_self_collision_pairs,
    remove_always_colliding_pairs,
)
from densarm.robot.urdf import Urdf
from densarm.shapes import differentiable_geometry
from densarm.validation import finite_vector, unit_quaternion

_SAMPLES = 5
_SINGULAR = 1e-10
_FARTHEST = 1e6  # [m]


class RobotModels(NamedTuple):
    """Pinocchio's models of one arm; the collision model holds its self-collision pairs."""

    model: pin.Model
    collision: pin.GeometryModel
    excluded_pairs: tuple[ExcludedPair, ...]
    """The pairs of shapes that it leaves out."""
    mesh_files: dict[str, Path]
    """The collision meshes that were read, by their path from the folder that holds them all."""
    links_without_collision: tuple[str, ...]
    """The links that the URDF draws and gives no collision geometry."""


def build_models(description: RobotDescription) -> RobotModels:
    """Build Pinocchio's model and collision geometry.

    Args:
        description: the arm.

    Raises:
        RobotDescriptionError: the URDF or SRDF cannot be used, with the reason.
        UnknownNameError: a locked joint that the URDF does not have, or a link of the SRDF or of
            an attachment.
        InvalidValueError: a locked position or base placement that is not finite, or an attached
            body named like a shape of the arm.
    """
    urdf = Urdf(description)
    try:
        model, collision = placed_models(description, urdf, pin.GeometryType.COLLISION)
        _require_arm(model)
        if collision.ngeoms == 0:
            raise RobotDescriptionError(
                f"robot {description.name!r}: the URDF has no <collision> geometry, so no distance "
                "can be computed: add shapes or meshes to its links"
            )
        files = _mesh_files(collision)
        collision = differentiable_geometry(model, collision, description.shapes)
    except RobotDescriptionError as error:
        raise _with_advice(error, urdf.links_without_collision) from None
    excluded = add_self_collision_pairs(model, collision, description.srdf)
    excluded += remove_always_colliding_pairs(model, collision)
    held = description.attachments
    add_attached_shapes(model, collision, held)
    add_attached_pairs(model, collision, held)
    add_attached_inertia(model, held)
    return RobotModels(model, collision, excluded, files, urdf.links_without_collision)


def build_visual_model(description: RobotDescription) -> pin.GeometryModel:
    """Build Pinocchio's visual geometry, whose meshes take most of an arm's loading time.

    Args:
        description: the arm.

    Raises:
        RobotDescriptionError: a mesh is missing.
    """
    model, visual = placed_models(description, Urdf(description), pin.GeometryType.VISUAL)
    add_attached_shapes(model, visual, description.attachments)
    return visual


def end_effector_frame(model: pin.Model, name: str | None) -> int:
    """Return the index of a frame: the link, where a joint shares its name.

    Args:
        model: the arm.
        name: of the frame; None for the last that the last joint carries.

    Raises:
        UnknownNameError: the model has no such frame.
    """
    frames = list(model.frames)
    if name is None:
        last = model.njoints - 1
        return max(k for k, frame in enumerate(frames) if frame.parentJoint == last)
    named = [k for k, frame in enumerate(frames) if frame.name == name]
    if not named:
        raise UnknownNameError("end-effector frame", name, [frame.name for frame in frames])
    return max(named, key=lambda k: bool(frames[k].type == pin.FrameType.BODY))


def joint_names(description: RobotDescription) -> list[str]:
    """Return the names of the joints that the arm keeps, in Pinocchio's order.

    Raises:
        RobotDescriptionError: the URDF cannot be used.
    """
    urdf = Urdf(description)
    locked = locked_positions(urdf, description.locked_joints)
    return [name for name in list(urdf.model.names)[1:] if name not in locked]


def placed_models(
    description: RobotDescription, urdf: Urdf, kind: pin.GeometryType
) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the model without locked joints and the geometry as the URDF has it, on their base.

    Args:
        description: the arm.
        urdf: its URDF.
        kind: collision or visual geometry.

    Raises:
        RobotDescriptionError: a joint that mimics one that moves, or a mesh that is missing.
        UnknownNameError: a locked joint that the URDF does not have.
        InvalidValueError: a locked position or base placement that is not finite.
    """
    locked = locked_positions(urdf, description.locked_joints)
    refuse_mimics(urdf, locked)
    model, geometry = lock_joints(urdf.model, urdf.geometry(kind), locked)
    placement = finite_vector("base_placement", description.base_placement, 7)
    placement[3:] = unit_quaternion("base_placement orientation", placement[3:])
    _place_base(model, geometry, pin.XYZQUATToSE3(placement))
    return model, geometry


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
    if not (np.abs(model.jointPlacements[joint.id].translation) < _FARTHEST).all():
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
