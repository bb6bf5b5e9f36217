"""Pose: where a frame of an arm shall be, in whole or in part."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.values.arrays import Array, Vector
from densarm.values.checks import finite_tuple, finite_vector, one_of, unit_quaternion
from densarm.values.documented import documented

AXES = ("x", "y", "z")
"""Axes of a frame about which it may be free to turn."""

_KEYS = ("frame", "position", "orientation_xyzw", "orientation_rpy_deg", "free")
_IN_RADIANS = 1e-3  # of a multiple of π/4, near which a whole rpy in degrees is none


@documented
@dataclass(frozen=True)
class Pose:
    """Where a frame shall be in the world: all of it, its position alone, or free about an axis.

    Raises:
        InvalidValueError: numbers that are no position or no unit quaternion, another axis, or one
            without an orientation.
    """

    frame: str
    """Name of a frame: any of the URDF, link or joint, or one of the arm's own."""
    position: Vector
    """Of its origin, x y z [m]."""
    orientation_xyzw: Vector | None = None
    """Unit quaternion x y z w; None for any orientation."""
    free: str | None = None
    """Axis of the frame itself, "x", "y" or "z", about which it may be turned in any way."""

    def __post_init__(self) -> None:
        if not isinstance(self.frame, str):
            raise InvalidValueError("frame", self.frame, "the name of a frame")
        position = finite_tuple("position", self.position, 3)
        object.__setattr__(self, "position", position)
        if (given := self.orientation_xyzw) is not None:
            if np.size(given) == 3:
                allowed = "a unit quaternion x y z w, or orientation_rpy_deg: three angles"
                raise InvalidValueError("orientation_xyzw", given, allowed)
            quaternion = unit_quaternion("orientation_xyzw", given)
            object.__setattr__(self, "orientation_xyzw", quaternion)
        if self.free is not None:
            one_of("free", self.free, AXES)
            if given is None:
                raise InvalidValueError("free", self.free, "given with an orientation only")

    @classmethod
    def of_table(cls, name: str, table: Any) -> "Pose":
        """Return the pose that a table of TOML or JSON describes, by its fields.

        In place of a quaternion there may be ``orientation_rpy_deg``: turns about the world's x, y
        and z in this order [degrees], as URDF's rpy.

        Args:
            name: what errors call it.
            table: the table.

        Raises:
            UnknownNameError: a key that a pose does not have.
            InvalidValueError: as `Pose`, with the key, both orientations, or angles in radians.
        """
        if not isinstance(table, Mapping):
            raise InvalidValueError(name, table, "a table with the keys frame and position")
        values = dict(table)
        for key in values:
            if key not in _KEYS:
                raise UnknownNameError(f"key of {name}", key, _KEYS)
        for key in _KEYS[:2]:
            if key not in values:
                raise InvalidValueError(f"{name}.{key}", None, "given for a pose")
        try:
            if (rpy := values.pop(_KEYS[3], None)) is not None:
                if values.get("orientation_xyzw") is not None:
                    raise InvalidValueError(_KEYS[3], rpy, "the only orientation given")
                values["orientation_xyzw"] = _quaternion(rpy)
            return cls(**values)
        except InvalidValueError as error:
            raise InvalidValueError(f"{name}.{error.name}", error.value, error.allowed) from None

    def to_json(self) -> dict[str, Any]:
        """Return the pose as JSON data; `of_table` is its inverse."""
        values = asdict(self).items()
        return {key: list(value) if isinstance(value, tuple) else value for key, value in values}

    @property
    def placement(self) -> pin.SE3:
        """The pose as Pinocchio has it, without a turn where any will do."""
        return pin.XYZQUATToSE3(np.array([*self.position, *(self.orientation_xyzw or _NO_TURN)]))

    def moved(self, step: Array) -> "Pose":
        """Return the pose moved by a step (6,), linear [m] and a turn [rad], both in the world."""
        position, turned = np.add(self.position, step[:3]), self.orientation_xyzw
        if turned is not None:
            turn = pin.exp3(step[3:]) @ self.placement.rotation
            turned = tuple(pin.Quaternion(turn).normalized().coeffs().tolist())
        return replace(self, position=tuple(position.tolist()), orientation_xyzw=turned)

    def __str__(self) -> str:
        where = ", ".join(f"{x:.4g}" for x in self.position)
        turn = "" if self.free is None else f", free about {self.free}"
        if self.orientation_xyzw is not None:
            turn = f", turned by ({', '.join(f'{x:.3g}' for x in self.orientation_xyzw)}){turn}"
        return f"{self.frame!r} at ({where}) m{turn}"


_NO_TURN = (0.0, 0.0, 0.0, 1.0)


def _quaternion(rpy: Any) -> tuple[float, ...]:
    angles = finite_vector("orientation_rpy_deg", rpy, 3)
    eighths = angles / (0.25 * np.pi)
    like_radians = np.abs(eighths - np.rint(eighths)) < _IN_RADIANS
    if np.abs(angles).max() < 6.3 and like_radians.all() and np.rint(eighths).any():
        raise InvalidValueError("orientation_rpy_deg", rpy, "in degrees: are these radians?")
    turn: Array = pin.rpy.rpyToMatrix(*np.radians(angles))
    return tuple(pin.Quaternion(turn).coeffs().tolist())
