"""SDFormat, the worlds of Gazebo: what collides in them, as obstacles."""

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.scene.mesh import Mesh
from densarm.scene.moveit import moveit_obstacle
from densarm.scene.obstacles import Capsule, HalfSpace, Obstacle, numbered, pose_fields
from densarm.scene.scene import Scene
from densarm.values.checks import finite_vector, unit_quaternion
from densarm.values.files import read_text

_SIZES = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "cone": ("radius", "length"),
}
_FOLDERS = ("GZ_SIM_RESOURCE_PATH", "SDF_PATH", "GAZEBO_MODEL_PATH")
_DEEPEST = 16  # models in models


class _Collision(NamedTuple):
    """What collides of a model, and where."""

    model: str
    label: str
    pose: pin.SE3
    shape: ElementTree.Element
    file: Path


def read_sdf_scene(path: Path) -> Scene:
    """Return what collides in the models of an SDF world, or of a file of models, as obstacles.

    They are at rest where the file has them, those that Gazebo would move too. Files that it
    includes are looked for beside it, in the folders above, and where Gazebo does so. An obstacle
    has the name of its model, with a number where that has several shapes.

    Raises:
        FileContentError: a file that cannot be read, or has what has no place here: with model,
            link and collision, and with what to do.

    Source: http://sdformat.org/spec
    """
    root = _root(path)
    world = root.find("world")
    found = list(_collisions(root if world is None else world, path))
    by_model: dict[str, list[_Collision]] = {}
    for item in found:
        by_model.setdefault(item.model, []).append(item)
    obstacles = list[Obstacle]()
    for model, items in by_model.items():
        for name, item in zip(numbered(model, len(items)), items, strict=True):
            try:
                obstacles.append(_obstacle(name, item))
            except DensarmError as error:
                raise FileContentError(path, f"{item.label}: {error}") from None
    try:
        return Scene(obstacles)
    except DensarmError as error:
        raise FileContentError(path, str(error)) from None


def _root(path: Path) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(read_text(path))
    except ElementTree.ParseError as error:
        raise FileContentError(path, f"not well-formed XML ({error})") from None
    if root.tag != "sdf":
        raise FileContentError(path, f"the root element is <{root.tag}>, not <sdf>")
    return root


@dataclass
class _Frames:
    """The elements of a world or model by name, whose poses may refer to each other."""

    own: pin.SE3
    """Pose of the world or model itself."""
    elements: dict[str, ElementTree.Element]
    label: str
    waiting: list[str] = field(default_factory=list)

    def pose(self, element: ElementTree.Element, attached_to: str = "") -> pin.SE3:
        """Return the pose of an element in the world."""
        given = element.find("pose")
        own = pin.SE3.Identity() if given is None else _pose(given)
        to = attached_to if given is None else given.get("relative_to", "") or attached_to
        return self._named(to) * own

    def _named(self, name: str) -> pin.SE3:
        if name in ("", "world", "__model__"):
            return self.own
        if name not in self.elements or name in self.waiting:
            allowed = "the name of a link, model or frame beside it, and no circle"
            raise InvalidValueError(f"{self.label}: relative_to", name, allowed)
        element = self.elements[name]
        self.waiting.append(name)
        pose = self.pose(element, element.get("attached_to", ""))
        self.waiting.remove(name)
        return pose


def _collisions(
    parent: ElementTree.Element,
    file: Path,
    own: pin.SE3 | None = None,
    scope: str = "",
    depth: int = 0,
) -> Iterator[_Collision]:
    """Yield the collisions of the models, and of the links, of a world or a model."""
    label = f"model {scope!r}" if scope else "the world"
    if depth > _DEEPEST:
        raise FileContentError(file, f"{label} is nested more than {_DEEPEST} deep")
    named = {
        x.get("name", ""): x for tag in ("link", "model", "frame") for x in parent.findall(tag)
    }
    frames = _Frames(pin.SE3.Identity() if own is None else own, named, label)
    try:
        for link in parent.findall("link"):
            place = frames.pose(link)
            for item in link.findall("collision"):
                where = f"{label}, link {link.get('name')!r}, collision {item.get('name')!r}"
                inner = _Frames(place, {}, where)
                yield _Collision(scope, where, inner.pose(item), _shape(where, item), file)
        for model in parent.findall("model"):
            name = _scoped(scope, model.get("name", ""))
            yield from _collisions(model, file, _placed(frames, model), name, depth + 1)
        for include in parent.findall("include"):
            uri = (include.findtext("uri") or "").strip()
            other, model = _included(uri, file)
            name = _scoped(scope, (include.findtext("name") or model.get("name") or "").strip())
            there = model if include.find("pose") is None else include
            yield from _collisions(model, other, _placed(frames, there), name, depth + 1)
    except FileContentError:
        raise
    except DensarmError as error:
        raise FileContentError(file, str(error)) from None


def _scoped(scope: str, name: str) -> str:
    return f"{scope}::{name}" if scope else name


def _placed(frames: _Frames, model: ElementTree.Element) -> pin.SE3:
    frame = model.get("placement_frame") or model.findtext("placement_frame")
    if frame:
        raise InvalidValueError("placement_frame", frame, "left out: pose the model itself")
    return frames.pose(model)


def _pose(element: ElementTree.Element) -> pin.SE3:
    """Return x y z [m] and roll pitch yaw, or a quaternion, of a <pose>."""
    text, form = element.text or "0 0 0 0 0 0", element.get("rotation_format", "euler_rpy")
    numbers = _numbers("pose", text)
    if form == "quat_xyzw":
        place = finite_vector("pose", numbers, 7)
        place[3:] = unit_quaternion("quaternion of a pose", place[3:])
        return pin.XYZQUATToSE3(place)
    values = finite_vector("pose", numbers, 6)
    angles = np.radians(values[3:]) if element.get("degrees") == "true" else values[3:]
    return pin.SE3(pin.rpy.rpyToMatrix(*angles), values[:3])


def _numbers(name: str, text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        raise InvalidValueError(name, text, "numbers") from None


def _shape(where: str, collision: ElementTree.Element) -> ElementTree.Element:
    shape = collision.find("geometry/*")
    if shape is None:
        raise InvalidValueError(f"{where}: geometry", None, "given")
    return shape


def _obstacle(name: str, item: _Collision) -> Obstacle:
    kind, shape, pose = item.shape.tag, item.shape, item.pose
    sizes = [
        number
        for key in _SIZES.get(kind, ())
        for number in _numbers(key, shape.findtext(key) or "")
    ]
    if kind == "capsule" and len(sizes) == 2:
        return Capsule(name=name, radius=sizes[0], length=sizes[1], **pose_fields(pose))
    if kind in _SIZES and kind != "capsule":
        return moveit_obstacle(name, kind, sizes, pose)
    if kind == "plane":
        normal = _numbers("normal", shape.findtext("normal") or "0 0 1")
        return HalfSpace(name=name, normal=normal, **pose_fields(pose))
    if kind == "mesh" and shape.find("submesh") is None:
        uri, scale = (shape.findtext("uri") or "").strip(), shape.findtext("scale") or "1 1 1"
        file, numbers = _file(uri, item.file), _numbers("scale", scale)
        return Mesh(name=name, path=file, scale=numbers, **pose_fields(pose))
    word = "submesh" if kind == "mesh" else kind
    allowed = ", ".join(_SIZES)
    raise DensarmError(f"<{word}> has no place here: use one of {allowed}, plane or a whole mesh")


def _included(uri: str, file: Path) -> tuple[Path, ElementTree.Element]:
    """Return the file that an <include> names, or a folder of, and its model."""
    found = _file(uri, file)
    if found.is_dir():
        found = found / "model.sdf"
    model = _root(found).find("model")
    if model is None:
        raise FileContentError(found, "no <model> in it")
    return found, model


def _file(uri: str, file: Path) -> Path:
    """Return what a URI names, beside a file, in a folder above it, or where Gazebo looks."""
    scheme, _, path = uri.rpartition("://")
    if scheme in ("", "file", "model", "package"):
        told = [Path(x) for key in _FOLDERS for x in os.environ.get(key, "").split(":") if x]
        for folder in [*file.resolve().parents, *told]:
            if path and (folder / path).exists():
                return folder / path
    allowed = f"a file beside {file.name} or above it, or in a folder of {_FOLDERS[0]}"
    raise InvalidValueError("uri", uri, allowed)
