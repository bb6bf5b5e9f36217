"""From a RobotDescription to Pinocchio's models: URDF, locked joints, base placement, shapes."""

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import pinocchio as pin

from densarm.captured_stderr import captured_stderr
from densarm.errors import RobotDescriptionError, UnknownNameError
from densarm.robot_description import RobotDescription, parse_robot_xml, resolve_package_dir
from densarm.self_collision import add_self_collision_pairs
from densarm.shapes import differentiable_geometry
from densarm.validation import finite_vector, unit_quaternion

T = TypeVar("T")


class RobotModels(NamedTuple):
    """Pinocchio's models of one arm; the collision model holds its self-collision pairs."""

    model: pin.Model
    collision: pin.GeometryModel
    mesh_files: dict[str, Path]
    """The collision meshes that were read, by their path from the folder that holds them all."""


def build_models(description: RobotDescription) -> RobotModels:
    """Build Pinocchio's model and collision geometry.

    Args:
        description: the arm.

    Raises:
        RobotDescriptionError: the URDF or SRDF cannot be used, with the reason.
        UnknownNameError: a locked joint that the URDF does not have, or a link of the SRDF.
        InvalidValueError: a locked position or base placement that is not finite.
    """
    root = parse_robot_xml(description.urdf, "URDF")
    _refuse_mimic_joints(root, description)
    model, collision = _parse(description, pin.GeometryType.COLLISION)
    _require_arm(model)
    if collision.ngeoms == 0:
        raise RobotDescriptionError(
            f"robot {description.name!r}: the URDF has no <collision> geometry, so no distance "
            "can be computed: add shapes or meshes to its links"
        )
    files = _mesh_files(collision)
    collision = differentiable_geometry(model, collision)
    add_self_collision_pairs(model, collision, description.srdf)
    return RobotModels(model, collision, files)


def build_visual_model(description: RobotDescription) -> pin.GeometryModel:
    """Build Pinocchio's visual geometry, whose meshes take most of an arm's loading time.

    Args:
        description: the arm.

    Raises:
        RobotDescriptionError: a mesh is missing.
    """
    return _parse(description, pin.GeometryType.VISUAL)[1]


def joint_names(description: RobotDescription) -> list[str]:
    """Return the names of the joints that the arm keeps, in Pinocchio's order.

    Raises:
        RobotDescriptionError: the URDF cannot be used.
    """
    model = _from_urdf(lambda: pin.buildModelFromXML(description.urdf))
    return [name for name in list(model.names)[1:] if name not in description.locked_joints]


def _parse(
    description: RobotDescription, kind: pin.GeometryType
) -> tuple[pin.Model, pin.GeometryModel]:
    model = _from_urdf(lambda: pin.buildModelFromXML(description.urdf))
    geometry = _parse_geometry(model, description, kind)
    model, geometry = _lock_joints(model, geometry, description)
    placement = finite_vector("base_placement", description.base_placement, 7)
    placement[3:] = unit_quaternion("base_placement orientation", placement[3:])
    _place_base(model, geometry, pin.XYZQUATToSE3(placement))
    return model, geometry


def _parse_geometry(
    model: pin.Model, description: RobotDescription, kind: pin.GeometryType
) -> pin.GeometryModel:
    folders = [resolve_package_dir(folder) for folder in description.package_dirs]
    urdf = _absolute_mesh_paths(description.urdf, folders)
    return _from_urdf(lambda: pin.buildGeomFromUrdfString(model, urdf, kind, package_dirs=folders))


def _absolute_mesh_paths(urdf: str, folders: list[str]) -> str:
    """Resolve plain relative mesh paths, which Pinocchio takes as relative to the process."""
    root = ElementTree.fromstring(urdf)
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        found = [Path(folder) / name for folder in folders if (Path(folder) / name).is_file()]
        if "://" not in name and found:
            mesh.set("filename", str(found[0].resolve()))
    return ElementTree.tostring(root, encoding="unicode")


def _refuse_mimic_joints(root: ElementTree.Element, description: RobotDescription) -> None:
    for joint in root.iter("joint"):
        name = joint.get("name", "")
        if joint.find("mimic") is not None and name not in description.locked_joints:
            raise RobotDescriptionError(
                f"joint {name!r} mimics another joint, which is not supported: "
                f"lock it by locked_joints={{{name!r}: position}}"
            )


def _lock_joints(
    model: pin.Model, geometry: pin.GeometryModel, description: RobotDescription
) -> tuple[pin.Model, pin.GeometryModel]:
    if not description.locked_joints:
        return model, geometry
    names = list(model.names)[1:]
    q = pin.neutral(model)
    ids = []
    for name, position in description.locked_joints.items():
        if name not in names:
            raise UnknownNameError("joint to lock", name, names)
        value = float(finite_vector(f"locked_joints.{name}", [position], 1)[0])
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1:
            raise RobotDescriptionError(f"joint {name!r} cannot be locked: it has no single axis")
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            [np.cos(value), np.sin(value)] if joint.nq == 2 else value
        )
        ids.append(joint.id)
    model, (geometry,) = pin.buildReducedModel(model, [geometry], ids, q)
    return model, geometry


def _require_arm(model: pin.Model) -> None:
    """Refuse joints without a single axis or with crossed limits, and negative masses."""
    for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
        if joint.nv != 1:
            raise RobotDescriptionError(
                f"joint {name!r} has {joint.nv} degrees of freedom: "
                "only revolute, continuous and prismatic joints are supported"
            )
        if np.abs(joint.createData().S).max() == 0.0:
            raise RobotDescriptionError(
                f"joint {name!r} has the axis 0 0 0, which has no direction"
            )
        low, high = model.lowerPositionLimit[joint.idx_q], model.upperPositionLimit[joint.idx_q]
        if joint.nq == 1 and low > high:
            raise RobotDescriptionError(
                f"joint {name!r} has a lower limit {low:g} above its upper limit {high:g}"
            )
    for name, inertia in zip(model.names, model.inertias, strict=True):
        if inertia.mass < 0.0:
            raise RobotDescriptionError(f"the links that joint {name!r} moves have a negative mass")
    if model.nv == 0:
        raise RobotDescriptionError("the robot has no joint to move")


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


def _from_urdf(parse: Callable[[], T]) -> T:
    """Return what a parser of Pinocchio makes of a URDF, or raise the reason that it prints.

    It also prints, and goes on without them, about shapes and inertias that it cannot read.
    """
    raised = ""
    with captured_stderr() as printed:
        try:
            result = parse()
        except (ValueError, RuntimeError) as error:
            raised = str(error) or type(error).__name__
    # urdfdom marks its lines by "Error:", coal the line that matters by "message:".
    reasons = [line.partition("Error:")[2].strip() for line in printed if "Error:" in line]
    if reasons or raised:
        reason = [*reasons, *raised.split("message: ")[-1].splitlines()][0]
        hint = "; name the folders that hold its package as package_dirs"
        missing = "could not be found" in reason
        raise RobotDescriptionError(f"URDF: {reason.rstrip('.')}{hint if missing else ''}")
    return result
