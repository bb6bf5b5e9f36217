"""A URDF's text to Pinocchio's models, with the reason in one line where that fails."""

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from copy import copy, deepcopy
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import coal
import pinocchio as pin

from densarm.arms.description import (
    DATA_WHEEL,
    RobotDescription,
    data_wheel_folder,
    parse_robot_xml,
)
from densarm.errors import DensarmError, InvalidValueError, RobotDescriptionError
from densarm.scene.mesh_file import read_mesh
from densarm.values.arrays import Array, Vector
from densarm.values.checks import finite_vector
from densarm.values.files import captured_stderr

T = TypeVar("T")

_ELEMENTS = ("collision", "visual")
_SIZES = ("size", "radius", "length", "scale")

_URDFDOM_MESSAGES = rb"(?:Error|Warning): (?:.*\n)+? +at line \d+ in .*\n"


class Urdf:
    """A URDF that Pinocchio can parse: capsules as cylinders, meshes by absolute paths."""

    def __init__(self, description: RobotDescription) -> None:
        self.root = parse_robot_xml(description.urdf, "URDF")
        self.root.attrib.setdefault("name", description.name)
        if self.root.find("link") is None:
            raise RobotDescriptionError("URDF: it has no <link>")
        _require_one_parent(self.root)
        _require_positive_limits(self.root)
        self.remarks = _without_empty_shapes(self.root)
        """What it leaves out, one phrase each."""
        drawn = [link for link in self.root.findall("link") if link.find("visual") is not None]
        self.links_without_collision = tuple(
            link.get("name", "") for link in drawn if link.find("collision") is None
        )
        """Links that it draws and gives no collision geometry."""
        for link in drawn:
            _collide_as_drawn(link, description.collision_from_visual)
        self._folders = [
            str(data_wheel_folder()) if folder == DATA_WHEEL else folder
            for folder in description.package_dirs
        ]
        self._capsules = {name: _rename_capsules(self.root, name) for name in _ELEMENTS}
        self._meshes = {name: _take_meshes(self.root, name) for name in _ELEMENTS}
        self.model: pin.Model = _from_urdf(lambda: pin.buildModelFromXML(self._text()))
        """The model, of all joints that the URDF has."""
        for link in self.root.findall("link"):
            if not self.model.existBodyName(link.get("name", "")):  # the parser leaves it out
                raise RobotDescriptionError(
                    f"URDF: link {link.get('name')!r} cannot be reached from the root link: "
                    "joints form a circle"
                )

    def geometry(self, kind: pin.GeometryType) -> pin.GeometryModel:
        """Return the collision or visual geometry."""
        element = kind.name.lower()
        text = self._text()
        geometry = _from_urdf(lambda: pin.buildGeomFromUrdfString(self.model, text, kind))
        for item in geometry.geometryObjects:
            if item.name in self._capsules[element] and isinstance(item.geometry, coal.Cylinder):
                radius, length = item.geometry.radius, 2.0 * item.geometry.halfLength
                item.geometry = coal.Capsule(radius, length) if length else coal.Sphere(radius)
            if item.name in self._meshes[element]:
                link = self.model.frames[item.parentFrame].name
                self._put_mesh(item, self._meshes[element][item.name], link)
        return geometry

    def _put_mesh(self, item: pin.GeometryObject, mesh: ElementTree.Element, link: str) -> None:
        """Let a shape have the mesh that the URDF names."""
        name = mesh.get("filename", "")
        file = _mesh_file(name, self._folders)
        if file is None:
            folders = ", ".join(self._folders)
            raise RobotDescriptionError(
                f"URDF: mesh {name!r} of link {link!r} could not be found in {folders}; "
                "name the folders that hold its package as package_dirs"
            )
        try:
            scale, status = _scale(mesh.get("scale", "1 1 1")), file.stat()
            item.meshScale, item.meshPath = scale, str(file)
            item.geometry = _kept_mesh(file, tuple(scale), status.st_mtime_ns, status.st_size)
        except DensarmError as error:
            raise RobotDescriptionError(f"URDF: mesh {name!r} of link {link!r}: {error}") from None

    def masses(self) -> dict[str, float]:
        """Return the masses [kg] that it gives its links."""
        given = {link.get("name", ""): link.find("inertial/mass") for link in self.root}
        return {
            name: float(mass.get("value", 0)) for name, mass in given.items() if mass is not None
        }

    def _text(self) -> str:
        return ElementTree.tostring(self.root, encoding="unicode")


# coal's CachedMeshLoader reads each file every time, and arms of one robot are made again and again
# where what they hold changes.
@lru_cache(maxsize=512)
def _kept_mesh(path: Path, scale: Vector, _changed: int, _size: int) -> coal.BVHModelBase:
    """Return the triangles of a mesh file, read again once it has changed."""
    return read_mesh(path, scale)


def _collide_as_drawn(link: ElementTree.Element, which: str) -> None:
    """Give a link that is drawn its visual geometry as collision geometry, if it is to have it."""
    own = link.findall("collision")
    if which == "never" or (own and which == "missing"):
        return
    for element in own:
        link.remove(element)
    for visual in link.findall("visual"):
        collision = deepcopy(visual)
        collision.tag = "collision"
        link.append(collision)


def _require_one_parent(root: ElementTree.Element) -> None:
    parents: dict[str, tuple[str, str]] = {}
    for joint in root.findall("joint"):
        name, link = joint.get("name", ""), end_link(joint, "child")
        parent = end_link(joint, "parent")
        if link and link in parents:
            first, other = parents[link]
            raise RobotDescriptionError(
                f"URDF: link {link!r} has two parents, {first!r} by joint {other!r} and {parent!r} "
                f"by joint {name!r}: let one joint carry it"
            )
        parents[link] = parent, name


def _require_positive_limits(root: ElementTree.Element) -> None:
    """Refuse by the joint's name what the parser refuses without."""
    for joint in [joint for joint in root.findall("joint") if joint.get("type") != "fixed"]:
        for limit in joint.findall("limit"):
            for key in ("effort", "velocity"):
                if max(_numbers(limit.get(key, "")), default=0.0) < 0.0:
                    raise RobotDescriptionError(
                        f"URDF: joint {joint.get('name')!r} has the {key} limit {limit.get(key)}: "
                        "it must be above zero, or zero for none"
                    )


def _without_empty_shapes(root: ElementTree.Element) -> tuple[str, ...]:
    """Take out shapes whose every size is zero, and tell of those meant for collision."""
    remarks = []
    for link in root.findall("link"):
        for item in [item for element in _ELEMENTS for item in link.findall(element)]:
            shapes = [shape for geometry in item.findall("geometry") for shape in geometry]
            sizes = [_numbers(shape.get(key, "")) for shape in shapes[:1] for key in _SIZES]
            if any(sizes) and not any(x != 0.0 for numbers in sizes for x in numbers):
                link.remove(item)
                if item.tag == "collision":
                    shape = f"collision {shapes[0].tag} of link {link.get('name')!r}"
                    remarks.append(f"{shape} has no size: left out")
    return tuple(remarks)


def _numbers(text: str) -> list[float]:
    """Return the numbers of a text; none where the parser is to say what is wrong with it."""
    try:
        return [float(part) for part in text.split()]
    except ValueError:
        return []


def end_link(joint: ElementTree.Element, kind: str) -> str:
    """Return the name of a joint's "parent" or "child"."""
    end = joint.find(kind)
    return "" if end is None else end.get("link", "")


def _rename_capsules(root: ElementTree.Element, element: str) -> set[str]:
    """Call capsules cylinders, which the parser knows, and return their names in Pinocchio."""
    names = set()
    for link in root.findall("link"):
        for index, item in enumerate(link.findall(element)):
            capsule = item.find("geometry/capsule")
            if capsule is not None:
                capsule.tag = "cylinder"
                names.add(f"{link.get('name')}_{index}")
    return names


def _take_meshes(root: ElementTree.Element, element: str) -> dict[str, ElementTree.Element]:
    """Call meshes boxes, which need no file, and return them by their names in Pinocchio."""
    meshes = {}
    for link in root.findall("link"):
        for index, item in enumerate(link.findall(element)):
            shape = item.find("geometry/*[1]")
            if shape is not None and shape.tag == "mesh":
                meshes[f"{link.get('name')}_{index}"] = copy(shape)
                shape.tag, shape.attrib = "box", {"size": "1 1 1"}
    return meshes


def _scale(text: str) -> Array:
    try:
        return finite_vector("scale", [float(word) for word in text.split()], 3)
    except ValueError:
        raise InvalidValueError("scale", text, "three finite numbers") from None


def _mesh_file(name: str, folders: Sequence[str]) -> Path | None:
    """Return the file that a path, ``file://``, ``package://`` or ``model://`` names.

    A package may lie in a folder of another name, as after unpacking an archive.
    """
    scheme, _, path = name.rpartition("://")
    inside = path.partition("/")[2] if scheme in {"package", "model"} else path
    for candidate in (Path(folder) / part for part in (path, inside) for folder in folders):
        # Not Path.is_file, which raises where a name is too long.
        if os.path.isfile(candidate):  # noqa: PTH113
            return candidate.resolve()
    return None


def _from_urdf(parse: Callable[[], T]) -> T:
    """Return what a parser of Pinocchio makes of a URDF, or raise the reason that it prints.

    It also prints, and goes on without them, about shapes and inertias that it cannot read.
    """
    raised = ""
    with captured_stderr(_URDFDOM_MESSAGES) as printed:
        try:
            result = parse()
        except (ValueError, RuntimeError) as error:
            raised = str(error) or type(error).__name__
    # urdfdom ends by the line of its code, coal marks the line that matters by "message:".
    errors = [text.rstrip().rpartition("\n")[0] for text in printed if text.startswith("Error:")]
    reasons = [text.removeprefix("Error:").strip().replace("\n", " ") for text in errors]
    if reasons or raised:
        reason = [*reasons, *raised.split("message: ")[-1].splitlines()][0]
        raise RobotDescriptionError(f"URDF: {reason.rstrip('.')}")
    return result
