"""From a RobotDescription to Pinocchio's models: URDF, locked joints, base placement, shapes."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from densarm.errors import RobotDescriptionError, UnknownNameError
from densarm.robot_description import RobotDescription, parse_robot_xml, resolve_package_dir
from densarm.self_collision import add_self_collision_pairs
from densarm.shapes import differentiable_geometry
from densarm.validation import finite_vector


class RobotModels(NamedTuple):
    """Pinocchio's models of one arm; the collision model holds its self-collision pairs."""

    model: pin.Model
    collision: pin.GeometryModel
    mesh_files: tuple[Path, ...]
    """The collision meshes that were read, in the URDF's order."""


def build_models(description: RobotDescription) -> RobotModels:
    """Build Pinocchio's model and collision geometry.

    Args:
        description: the arm.

    Raises:
        RobotDescriptionError: the URDF or SRDF cannot be used, with the reason.
        UnknownNameError: a locked joint that the URDF does not have.
        InvalidValueError: a locked position or base placement that is not finite.
    """
    root = parse_robot_xml(description.urdf, "URDF")
    _refuse_mimic_joints(root, description)
    model, collision = _parse(description, pin.GeometryType.COLLISION)
    _require_arm_joints(model)
    if collision.ngeoms == 0:
        raise RobotDescriptionError(
            f"robot {description.name!r}: the URDF has no <collision> geometry, so no distance "
            "can be computed: add shapes or meshes to its links"
        )
    paths = dict.fromkeys(item.meshPath for item in collision.geometryObjects)
    files = tuple(Path(path) for path in paths if Path(path).is_file())
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


def _parse(
    description: RobotDescription, kind: pin.GeometryType
) -> tuple[pin.Model, pin.GeometryModel]:
    try:
        model = pin.buildModelFromXML(description.urdf)
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f"URDF: {_first_line(error)}") from None
    geometry = _parse_geometry(model, description, kind)
    model, geometry = _lock_joints(model, geometry, description)
    base = pin.XYZQUATToSE3(finite_vector("base_placement", description.base_placement, 7))
    _place_base(model, geometry, base)
    return model, geometry


def _parse_geometry(
    model: pin.Model, description: RobotDescription, kind: pin.GeometryType
) -> pin.GeometryModel:
    folders = [resolve_package_dir(folder) for folder in description.package_dirs]
    try:
        return pin.buildGeomFromUrdfString(
            model, _absolute_mesh_paths(description.urdf, folders), kind, package_dirs=folders
        )
    except (ValueError, RuntimeError) as error:
        looked = ", ".join(folders) or "no folder"
        raise RobotDescriptionError(
            f"URDF geometry: {_first_line(error)} (looked in: {looked}; name others as package_dirs)"
        ) from None


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
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            [np.cos(value), np.sin(value)] if joint.nq == 2 else value
        )
        ids.append(joint.id)
    model, (geometry,) = pin.buildReducedModel(model, [geometry], ids, q)
    return model, geometry


def _require_arm_joints(model: pin.Model) -> None:
    """Refuse joints that are not a single revolute, continuous or prismatic axis."""
    for joint, name in zip(list(model.joints)[1:], list(model.names)[1:], strict=True):
        if joint.nv != 1:
            raise RobotDescriptionError(
                f"joint {name!r} has {joint.nv} degrees of freedom: "
                "only revolute, continuous and prismatic joints are supported"
            )
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


def _first_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0] if lines else type(error).__name__
