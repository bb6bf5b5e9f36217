"""MoveIt's planning-scene message as YAML, as MotionBenchMaker and rosbag tools write it."""

from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import Any, TypeVar

import pinocchio as pin

from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.scene.mesh import Mesh
from densarm.scene.moveit import moveit_mesh, moveit_obstacle, moveit_pose
from densarm.scene.obstacles import Obstacle, numbered, pose_fields
from densarm.scene.scene import Attachment, Scene
from densarm.values.files import read_text

T = TypeVar("T")

_KINDS = {"1": "box", "2": "sphere", "3": "cylinder", "4": "cone"}
"""Constants of shape_msgs/SolidPrimitive."""

_DEEPEST = 32  # nesting of a document; a planning scene has about ten levels


def read_moveit_yaml(path: Path) -> Scene:
    """Return the obstacles and the attached bodies of a planning scene; errors name line or key.

    Read are ``world.collision_objects`` and ``robot_state.attached_collision_objects``: boxes,
    spheres, cylinders, cones, planes (the half-space behind), and meshes (their hull), each pose
    the object's times the shape's. Obstacle poses are taken as in the world and so must name one
    frame; those of an attached body as in its link.

    Source: moveit_msgs/PlanningScene, CollisionObject, AttachedCollisionObject.
    """
    data = _load(path)
    try:
        scene = _table("the file", data)
        if "world" not in scene:
            raise InvalidValueError("world", None, "given: this is no planning scene")
        world = _table("world", scene["world"])
        state = _table("robot_state", scene.get("robot_state"))
        if _table("octomap", _table("octomap", world.get("octomap")).get("octomap")).get("data"):
            raise InvalidValueError("world.octomap", "cells", "empty: use meshes or boxes")
        for key, size, plain in (("link_padding", "padding", 0.0), ("link_scale", "scale", 1.0)):
            for item in _list(key, scene.get(key)):
                entry = _table(key, item)
                value, name = _numbers(key, [entry.get(size, plain)])[0], entry.get("link_name")
                if value != plain:
                    allowed = f"{plain:g}: set control.margin, the distance that all links keep"
                    raise InvalidValueError(f"{key} of {name!r}", value, allowed)
        objects = _list("world.collision_objects", world.get("collision_objects"))
        held = _list("attached_collision_objects", state.get("attached_collision_objects"))
        frames = {_frame(_table("collision object", item)) for item in objects} - {""}
        if len(frames) > 1:
            allowed = "one frame for all collision objects"
            raise InvalidValueError("frame_id", sorted(frames), allowed)
        return Scene(
            chain.from_iterable(_obstacles(item, path.parent) for item in objects),
            chain.from_iterable(_attachments(item, path.parent) for item in held),
        )
    except FileContentError:
        raise
    except DensarmError as error:
        raise FileContentError(path, str(error)) from None


def _load(path: Path) -> Any:
    """Return the document, every scalar as text: YAML 1.1 would misread 1e-05 and names like 7.

    Empty documents do not count, as ROS writes ``---`` after each message.
    Aliases, which make small files huge, and deep nesting are refused.
    """
    import yaml

    text = read_text(path)
    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    depth = 0
    try:
        for event in yaml.parse(text, Loader=loader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or depth > _DEEPEST:
                line = event.start_mark.line + 1
                raise FileContentError(path, f"line {line}: an alias, or nested too deeply")
        documents = [item for item in yaml.load_all(text, Loader=loader) if item not in (None, "")]
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}: " if mark is not None else ""
        raise FileContentError(path, f"{where}not YAML: {error.problem}") from None
    except yaml.YAMLError as error:
        raise FileContentError(path, f"not YAML: {str(error).splitlines()[0]}") from None
    if len(documents) > 1:
        raise FileContentError(path, f"holds {len(documents)} planning scenes, not one")
    return documents[0] if documents else None


def _obstacles(data: Any, folder: Path) -> list[Obstacle]:
    table = _table("collision object", data)
    name = _text("id of a collision object", table.get("id"))
    if table.get("operation", "0") != "0":
        raise InvalidValueError(f"operation of {name!r}", table["operation"], "0, which adds it")
    pose = _pose(f"object {name!r}", table.get("pose"))
    shapes = [
        (kind, _table(f"{kind} of {name!r}", shape), pose * placement)
        for kind in ("primitive", "mesh", "plane")
        for shape, placement in _placed(name, kind, table)
    ]
    return [
        _obstacle(own, *shape, folder)
        for own, shape in zip(numbered(name, len(shapes)), shapes, strict=True)
    ]


def _placed(name: str, kind: str, table: Mapping[str, Any]) -> list[tuple[Any, pin.SE3]]:
    plural = {"primitive": "primitives", "mesh": "meshes", "plane": "planes"}[kind]
    shapes = _list(f"{plural} of {name!r}", table.get(plural))
    poses = _list(f"{kind}_poses of {name!r}", table.get(f"{kind}_poses"))
    # A message may leave out poses at the object's own.
    if poses and len(poses) != len(shapes):
        raise InvalidValueError(f"{kind}_poses of {name!r}", len(poses), f"{len(shapes)} poses")
    placements = [_pose(f"{kind} of {name!r}", item) for item in poses]
    return list(zip(shapes, placements or [pin.SE3.Identity()] * len(shapes), strict=True))


def _obstacle(
    name: str, kind: str, shape: Mapping[str, Any], pose: pin.SE3, folder: Path
) -> Obstacle:
    if kind == "plane":
        return moveit_obstacle(name, kind, _numbers(f"coef of {name!r}", shape.get("coef")), pose)
    if kind == "mesh" and "resource" in shape:
        return _mesh_of_file(name, shape, pose, folder)
    if kind == "mesh":
        vertices = _list(f"vertices of {name!r}", shape.get("vertices"))
        return moveit_mesh(name, [_numbers("vertex", item, "xyz") for item in vertices], pose)
    word = _text(f"type of {name!r}", shape.get("type")).lower()
    word = _KINDS.get(word, word)
    sizes = _numbers(f"dimensions of {name!r}", shape.get("dimensions"))
    if word in ("cylinder", "cone"):
        sizes = sizes[::-1]  # height, radius in the message
    return moveit_obstacle(name, word, sizes, pose)


def _mesh_of_file(name: str, shape: Mapping[str, Any], pose: pin.SE3, folder: Path) -> Obstacle:
    """Return a mesh that robowflex's form of the message names by its file."""
    resource = _text(f"resource of {name!r}", shape["resource"])
    if "://" in resource and not resource.startswith("file://"):
        allowed = "the path of a mesh file, absolute or beside the scene"
        raise InvalidValueError(f"resource of {name!r}", resource, allowed)
    scale = _numbers(f"dimensions of {name!r}", shape.get("dimensions", ["1"] * 3))
    path = folder / resource.removeprefix("file://")
    return Mesh(name=name, path=path, scale=scale, **pose_fields(pose))


def _attachments(data: Any, folder: Path) -> list[Attachment]:
    table = _table("attached collision object", data)
    bodies = _obstacles(table.get("object"), folder)
    link = _text("link_name of an attached object", table.get("link_name"))
    frame = _frame(table["object"])
    if frame not in ("", link):
        raise InvalidValueError("frame_id of an attached object", frame, f"its link, {link!r}")
    touched = [
        _text("touch_links", item) for item in _list("touch_links", table.get("touch_links"))
    ]
    (mass,) = _numbers("weight", [table.get("weight", "0")])
    return [Attachment(body, link, touched, mass / len(bodies)) for body in bodies]


def _frame(table: Mapping[str, Any]) -> str:
    return str(_table("header", table.get("header")).get("frame_id", ""))


def _pose(name: str, data: Any) -> pin.SE3:
    table = _table(f"pose of {name}", data)
    position = _numbers(f"position of {name}", table.get("position", {}), "xyz")
    orientation = _numbers(f"orientation of {name}", table.get("orientation", {}), "xyzw")
    return moveit_pose(name, position, orientation)


def _numbers(name: str, data: Any, keys: str = "") -> list[float]:
    """Return numbers from a list, or from a table with one-letter keys, zero where left out."""
    if isinstance(data, Mapping) and keys and set(data) <= set(keys):
        data = [data.get(key, "0") for key in keys]
    try:
        return [float(item) for item in _list(name, data)]
    except (TypeError, ValueError):
        raise InvalidValueError(name, data, "a list of numbers") from None


def _table(name: str, data: Any) -> dict[str, Any]:
    return _given(name, data, dict, "a table")


def _list(name: str, data: Any) -> list[Any]:
    return _given(name, data, list, "a list")


def _given(name: str, data: Any, kind: type[T], allowed: str) -> T:
    """Return a table or list; what a message leaves out is an empty one."""
    if data is None or data in ("", "~", "null"):
        return kind()
    if not isinstance(data, kind):
        raise InvalidValueError(name, data, allowed)
    return data


def _text(name: str, data: Any) -> str:
    if not isinstance(data, str) or not data:
        raise InvalidValueError(name, data, "a non-empty string")
    return data
