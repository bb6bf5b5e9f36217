"""RobotDescription: everything that an arm is built from, as plain data."""

from __future__ import annotations

import importlib.metadata
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from densarm.errors import DensarmError, FileContentError, RobotDescriptionError
from densarm.robot.drawn_links import CollisionFromVisual

if TYPE_CHECKING:
    from densarm.attachment import Attachment

DATA_WHEEL = "example-robot-data"
"""Prefix ``example-robot-data:`` of a path inside that wheel's folder of robots."""

MAX_BYTES = 20_000_000
"""Size of the largest text file that is read."""

SHAPES = ("hull", "capsule")
"""What stands for collision geometry: convex hulls, or the smallest capsule around each."""


@dataclass(frozen=True)
class RobotDescription:
    """URDF and SRDF as text, with what Pinocchio needs beside them.

    Holding text, not paths, lets a recorded run rebuild its own arm.

    Raises:
        InvalidValueError: shapes of another name, or links of another name to collide as drawn.
    """

    name: str
    urdf: str
    """The URDF's text."""
    srdf: str | None = None
    """The SRDF's text; None where there is none."""
    package_dirs: tuple[str, ...] = ()
    """Folders that ``package://`` and relative mesh paths are looked up in."""
    locked_joints: Mapping[str, float] = field(default_factory=dict)
    """Joint name to its fixed position [rad or m]; may lie outside the joint's limits."""
    base_placement: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    """Pose of the base in the world: x y z [m], quaternion x y z w."""
    acceleration: tuple[float, ...] | None = None
    """Acceleration limits (nv,) [rad/s² or m/s²]; None for the default on every joint."""
    end_effector: str | None = None
    """Frame whose path is drawn; None for the last link."""
    postures: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Named joint positions, one number per joint [rad or m]."""
    shapes: str = "hull"
    """What distances are measured to: "hull" or "capsule"."""
    collision_from_visual: str = "missing"
    """Which links collide as they are drawn: "never", "missing" or "always"."""
    attachments: tuple[Attachment, ...] = ()
    """Bodies that the arm holds."""

    def __post_init__(self) -> None:
        from densarm.validation import one_of  # it imports NumPy, which listing does without

        one_of("shapes", self.shapes, SHAPES)
        one_of("collision_from_visual", self.collision_from_visual, list(CollisionFromVisual))

    def to_json(self) -> dict[str, Any]:
        """Return the description as JSON data; `from_json` is its inverse."""
        attachments = [item.to_json() for item in self.attachments]
        return {**asdict(replace(self, attachments=())), "attachments": attachments}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> RobotDescription:
        """Rebuild a description from the data of `to_json`.

        Raises:
            DensarmError: a field is missing or unknown, or an attachment is not one.
        """
        from densarm.attachment import Attachment  # with Pinocchio, which `densarm list` spares

        try:
            values = dict(data)
            values["postures"] = {k: tuple(v) for k, v in values["postures"].items()}
            for key in ("package_dirs", "base_placement", "acceleration"):
                values[key] = None if values[key] is None else tuple(values[key])
            # Absent from what earlier versions wrote.
            values.setdefault("collision_from_visual", "never")
            held = values.get("attachments", ())
            values["attachments"] = tuple(Attachment.from_json(item) for item in held)
            return cls(**values)
        except (TypeError, KeyError, AttributeError, ValueError) as error:
            raise DensarmError(f"robot description: {error}") from None


def data_wheel_folder() -> Path:
    """Return the share folder of the example-robot-data wheel.

    Raises:
        RobotDescriptionError: the wheel is not installed.
    """
    try:
        distribution = importlib.metadata.distribution(DATA_WHEEL)
    except importlib.metadata.PackageNotFoundError:
        raise RobotDescriptionError(
            f"the package {DATA_WHEEL!r} is not installed: pip install {DATA_WHEEL}"
        ) from None
    return Path(str(distribution.locate_file("cmeel.prefix/share")))


def resolve_path(path: str, beside: Path) -> Path:
    """Return the file that a path of an ``arm.toml`` names.

    Args:
        path: relative to `beside`, or ``example-robot-data:`` and a path in that wheel's robots.
        beside: the folder of the ``arm.toml``.
    """
    prefix, _, rest = path.partition(":")
    if prefix == DATA_WHEEL:
        return data_wheel_folder() / DATA_WHEEL / "robots" / rest
    return beside / path


def resolve_package_dir(folder: str) -> str:
    """Return the folder to look up meshes in; the name of the data wheel stands for its own."""
    return str(data_wheel_folder()) if folder == DATA_WHEEL else folder


def read_text(path: Path) -> str:
    """Return a text file's content.

    Raises:
        FileContentError: there is no such file, it is not text, or it is too large.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
        if len(content) > MAX_BYTES:
            raise FileContentError(path, f"larger than {MAX_BYTES / 1e6:g} MB")
        return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a UTF-8 text file"
        raise FileContentError(path, str(reason)) from None


def parse_robot_xml(text: str, kind: str) -> ElementTree.Element:
    """Return the root element of a URDF or SRDF.

    Args:
        text: the file's content.
        kind: "URDF" or "SRDF", for the error.

    Raises:
        RobotDescriptionError: not XML, or its root is not ``<robot>``.
    """
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise RobotDescriptionError(f"{kind}: not well-formed XML ({error})") from None
    if root.tag != "robot":
        raise RobotDescriptionError(f"{kind}: the root element is <{root.tag}>, not <robot>")
    return root
