"""RobotDescription: everything that an arm is built from, as plain data."""

import importlib.metadata
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.parsers import expat

from densarm.arms.pose import Pose
from densarm.errors import DensarmError, InvalidValueError, RobotDescriptionError
from densarm.scene.scene import Attachment
from densarm.values.arrays import Vector
from densarm.values.checks import one_of, positive

DATA_WHEEL = "example-robot-data"
"""Prefix ``example-robot-data:`` of a path inside that wheel's folder of robots."""


@dataclass(frozen=True)
class RobotDescription:
    """URDF and SRDF as text, with what Pinocchio needs beside them.

    Holding text, not paths, lets a recorded run rebuild its own arm. Sequences are kept as tuples.

    Raises:
        InvalidValueError: shapes, links to collide as drawn or an inertia of another name, or a
            density that is not positive or not read.
    """

    name: str
    urdf: str
    """The URDF's text."""
    srdf: str | None = None
    """The SRDF's text; None where there is none."""
    package_dirs: Sequence[str] = ()
    """Folders that ``package://`` and relative mesh paths are looked up in."""
    locked_joints: Mapping[str, float] = field(default_factory=dict)
    """Joint name to its fixed position [rad or m]; may lie outside the joint's limits."""
    base_placement: Vector = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    """Pose of the base in the world: x y z [m], quaternion x y z w."""
    acceleration: Vector | None = None
    """Acceleration limits (nv,) [rad/s² or m/s²]; None for the default on every joint."""
    torque_rate: Vector | float | None = None
    """Limits of the change of torque, but for gravity's, (nv,) or one for all [N·m/s or N/s]; None
    for none, as infinity."""
    torque_rate_is_hard: bool = False
    """Whether it holds in emergencies too, as an arm wants that else stops by itself."""
    jerk: Vector | float | None = None
    """Jerk limits (nv,), or one for all [rad/s³ or m/s³]; None for none, as infinity."""
    armature: Vector | float | None = None
    """Inertia of rotors, times their gears' ratios squared, (nv,) or one for all [kg·m² or kg];
    None for none."""
    deceleration: Vector | float | None = None
    """a of `JointLimits.fastest`, with which velocity limits fall towards position limits, (nv,) or
    one for all [rad/s² or m/s²]; None for limits that do not fall."""
    velocity_offset: Vector | float | None = None
    """o there, the same [rad/s or m/s]; None for zero."""
    end_effector: str | None = None
    """Frame whose path is drawn; None for the last link."""
    postures: Mapping[str, Vector] = field(default_factory=dict)
    """Named joint positions, one number per joint [rad or m]."""
    shapes: str = "hull"
    """What distances are measured to: each "hull", "pieces" of it, or a "capsule" around it.

    With hulls, pieces stand in where two links' hulls overlap and their meshes do not.
    """
    collision_from_visual: str = "missing"
    """Which links collide as drawn: "never", those "missing" collision geometry, or "always"."""
    inertia: str = "given"
    """Masses of links that have none: as "given", or "from_shapes", of a density."""
    density: float | None = None
    """Of masses from shapes [kg/m³]; None for 1000."""
    attachments: Sequence[Attachment] = ()
    """Bodies that the arm holds."""
    frames: Mapping[str, Pose] = field(default_factory=dict)
    """Frames of one's own by name, each at a pose in the frame of a link."""
    remarks: Sequence[str] = ()
    """What the URDF has not of the file that it was made of, one phrase each."""

    def __post_init__(self) -> None:
        one_of("shapes", self.shapes, ["hull", "pieces", "capsule"])
        drawn = ["never", "missing", "always"]
        one_of("collision_from_visual", self.collision_from_visual, drawn)
        one_of("inertia", self.inertia, ["given", "from_shapes"])
        if self.density is not None and self.inertia == "given":
            raise InvalidValueError("density", self.density, "with inertia = 'from_shapes' only")
        if self.density is not None:
            positive("density", self.density)
        for key in ("package_dirs", "base_placement", *PER_JOINT, "attachments", "remarks"):
            object.__setattr__(self, key, _frozen(getattr(self, key)))
        for key in ("torque_rate", "jerk"):
            if getattr(self, key) == math.inf:
                object.__setattr__(self, key, None)
        postures = {name: _frozen(angles) for name, angles in self.postures.items()}
        object.__setattr__(self, "postures", postures)

    def to_json(self) -> dict[str, Any]:
        """Return the description as JSON data; `from_json` is its inverse."""
        attachments = [item.to_json() for item in self.attachments]
        return {**asdict(replace(self, attachments=())), "attachments": attachments}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "RobotDescription":
        """Rebuild a description from the data of `to_json`.

        Raises:
            DensarmError: a field is missing or unknown, or an attachment is not one.
        """
        try:
            if absent := [key for key in _ALWAYS_RECORDED if key not in data]:
                raise KeyError(absent[0])
            # Absent from what earlier versions wrote.
            values = {"collision_from_visual": "never", "attachments": (), **data}
            values["attachments"] = [Attachment.from_json(item) for item in values["attachments"]]
            values["frames"] = own_frames(values.get("frames", {}))
            return cls(**values)
        except (TypeError, KeyError, AttributeError, ValueError) as error:
            raise DensarmError(f"robot description: {error}") from None


PER_JOINT = (
    "acceleration",
    "torque_rate",
    "jerk",
    "armature",
    "deceleration",
    "velocity_offset",
)
"""Fields that hold one number per joint."""

_ALWAYS_RECORDED = ("postures", "package_dirs", "base_placement", "acceleration")


def own_frames(tables: Any) -> dict[str, Pose]:
    """Return `RobotDescription.frames` from tables of TOML or JSON."""
    if not isinstance(tables, Mapping):
        raise InvalidValueError("frames", tables, "a table of frames, each a table of its pose")
    return {name: Pose.of_table(f"frames.{name}", table) for name, table in tables.items()}


def _frozen(values: Any) -> Any:
    return tuple(values) if isinstance(values, Iterable) else values


def data_wheel_folder() -> Path:
    """Return the share folder of the example-robot-data wheel, which must be installed."""
    try:
        distribution = importlib.metadata.distribution(DATA_WHEEL)
    except importlib.metadata.PackageNotFoundError:
        raise RobotDescriptionError(
            f"the package {DATA_WHEEL!r} is not installed: pip install {DATA_WHEEL}"
        ) from None
    return Path(str(distribution.locate_file("cmeel.prefix/share")))


def resolve_path(path: str, beside: Path) -> Path:
    """Return the file that a path of an ``arm.toml`` names, beside it or in the data wheel."""
    prefix, _, rest = path.partition(":")
    if prefix == DATA_WHEEL:
        return data_wheel_folder() / DATA_WHEEL / "robots" / rest
    return beside / path


def parse_robot_xml(text: str, kind: str) -> ElementTree.Element:
    """Return the root ``<robot>`` of a text, whose kind is "URDF" or "SRDF" for errors.

    Prefixes are parts of names and need not be declared: simulators' tags as a rule are not.
    """
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text, True)
        root = builder.close()
    except (expat.ExpatError, ValueError) as error:
        raise RobotDescriptionError(f"{kind}: not well-formed XML ({error})") from None
    if root.tag != "robot":
        raise RobotDescriptionError(f"{kind}: the root element is <{root.tag}>, not <robot>")
    return root
