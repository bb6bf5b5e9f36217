"""Line: a straight way of a frame from where an arm has it, and the joint positions along it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from densarm.arms.arm import Arm
from densarm.arms.inverse_kinematics import InverseKinematics, Target, mechanism_of, solve
from densarm.arms.joint_space import pose_row
from densarm.arms.models import frame_index
from densarm.arms.pose import Pose
from densarm.errors import DensarmError, InvalidValueError
from densarm.values.arrays import Array, Vector
from densarm.values.checks import finite_tuple
from densarm.values.documented import documented

_SPACING, _TURN = 2.5e-3, 0.02  # [m, rad] at most between poses that joint positions are found for
_SHORTEST = 1e-4  # [m], of which the direction is known
_AT_LIMIT = 1e-6  # [rad or m]
_NO_TURN = 1e-12  # [rad]


@documented
@dataclass(frozen=True)
class Line:
    """A straight way of a frame from where it is, as of a hand that approaches along its axis.

    One of `to`, `by` and `along` tells where it ends.

    Raises:
        InvalidValueError: none or several of them, numbers that are no vector, or a pose that is
            of another frame, or free about an axis.
    """

    frame: str
    """Name of a frame, as `Pose.frame`."""
    to: Pose | Vector | None = None
    """Its end in the world: a pose, to which the frame turns evenly on the way, or a position,
    where it keeps its orientation [m]."""
    by: Vector | None = None
    """Its way along the world's axes [m]."""
    along: Vector | None = None
    """Its way along the axes that the frame has at first [m]."""

    def __post_init__(self) -> None:
        if not isinstance(self.frame, str):
            raise InvalidValueError("frame", self.frame, "the name of a frame")
        given = [key for key in ("to", "by", "along") if getattr(self, key) is not None]
        if len(given) != 1:
            raise InvalidValueError("line", given, "told by one of to, by and along")
        (key,) = given
        if not isinstance(self.to, Pose):
            object.__setattr__(self, key, finite_tuple(key, getattr(self, key), 3))
        elif self.to.frame != self.frame:
            raise InvalidValueError("to.frame", self.to.frame, f"the line's, {self.frame!r}")
        elif self.to.free is not None:
            raise InvalidValueError("to.free", self.to.free, "none: a line turns as its ends tell")

    def segment(self, arm: Arm, q: Array) -> "Segment":
        """Return where it begins and ends for an arm at a configuration (nq,).

        Raises:
            UnknownNameError: no such frame.
            InvalidValueError: a way of next to no length.
        """
        start = arm.pose(q, self.frame).placement
        end = pin.SE3(start)
        if isinstance(self.to, Pose):
            end.translation = np.array(self.to.position)
            if self.to.orientation_xyzw is not None:
                end.rotation = self.to.placement.rotation
        elif self.to is not None:
            end.translation = np.array(self.to)
        elif self.by is not None:
            end.translation += np.array(self.by)
        else:
            end.translation += start.rotation @ np.array(self.along)
        segment = Segment(self.frame, start, end)
        if segment.length < _SHORTEST:
            raise InvalidValueError("length of the line [m]", segment.length, "at least 0.1 mm")
        return segment

    def __str__(self) -> str:
        (way,) = (
            f"{key} ({', '.join(f'{x:.4g}' for x in value)}) m"
            for key in ("to", "by", "along")
            if (value := getattr(getattr(self, key), "position", getattr(self, key))) is not None
        )
        return f"line of {self.frame!r} {way}"


class Segment(NamedTuple):
    """A straight way of a frame in the world, on which it turns evenly."""

    frame: str
    """Name of the frame."""
    start: pin.SE3
    """Where it begins."""
    end: pin.SE3
    """Where it ends."""

    @property
    def length(self) -> float:
        """How far the frame goes [m]."""
        return float(np.linalg.norm(self.end.translation - self.start.translation))

    @property
    def turn(self) -> Array:
        """How the frame turns on the way, seen from it (3,) [rad]."""
        return np.array(pin.log3(self.start.rotation.T @ self.end.rotation))

    def placement(self, share: float) -> pin.SE3:
        """Return where the frame is after a share of the way."""
        turned = self.start.rotation @ pin.exp3(share * self.turn)
        way = self.end.translation - self.start.translation
        return pin.SE3(turned, self.start.translation + share * way)

    def off(self, arm: Arm, q: Array) -> tuple[Array, Array]:
        """Return how far the frame is off at configurations (N, nq).

        Returns:
            Distance from the segment (N,) [m], and the turn from the orientation that it has at
            the nearest point of it (N,) [rad].
        """
        begin, way = self.start.translation, self.end.translation - self.start.translation
        poses = list(_placements(arm, self.frame, q))
        points = np.array([pose.translation for pose in poses])
        share = np.clip((points - begin) @ way / (way @ way), 0.0, 1.0)
        wanted = self.start.rotation
        if np.linalg.norm(self.turn) > _NO_TURN:
            wanted = np.array([self.placement(x).rotation for x in share.tolist()])
        far = np.linalg.norm(points - begin - share[:, np.newaxis] * way, axis=1)
        apart = np.linalg.norm(np.array([pose.rotation for pose in poses]) - wanted, axis=(1, 2))
        return far, 2.0 * np.arcsin(np.minimum(1.0, apart / np.sqrt(8.0)))

    def joint_positions(self, arm: Arm, q: Array) -> Array:
        """Return joint positions (N, nv) that lead the frame along it, from q (nq,) on.

        Raises:
            InvalidValueError: a frame that no joint moves.
            DensarmError: not all of it can be followed, with how far, and why.
        """
        mechanism, angles = mechanism_of(arm, self.frame), [arm.angles(q)]
        steps = max(self.length / _SPACING, float(np.linalg.norm(self.turn)) / _TURN)
        for share in np.linspace(0.0, 1.0, 2 + int(steps))[1:]:
            placement, out = self.placement(share), np.empty((2, arm.nv))
            placement.translation -= arm.origin
            target, last = Target(pose_row(placement), np.zeros(3), turns=True), angles[-1]
            if solve(mechanism, target, last[np.newaxis], 0, last, out) < 0:
                raise DensarmError(self._fault(arm, q, share, last))
            angles.append(out[0].copy())
        return np.array(angles)

    def to_json(self) -> dict[str, Any]:
        """Return it as JSON data; `from_json` is its inverse."""
        ends = {key: pin.SE3ToXYZQUAT(getattr(self, key)).tolist() for key in ("start", "end")}
        return {"frame": self.frame, **ends}

    @classmethod
    def from_json(cls, data: Any) -> "Segment":
        """Return the segment of the data of `to_json`."""
        ends = (pin.XYZQUATToSE3(np.array(data[key], np.float64)) for key in ("start", "end"))
        return cls(str(data["frame"]), *ends)

    def _fault(self, arm: Arm, q: Array, share: float, angles: Array) -> str:
        """Return why it can be followed up to joint positions (nv,) alone."""
        ends = (pin.SE3ToXYZQUAT(self.end).round(9) + 0.0).tolist()
        pose = Pose(self.frame, ends[:3], ends[3:])
        search = InverseKinematics(arm, pose)
        if next(search.solutions(q, 0), None) is None:
            return f"the line ends at a pose of {pose} that {search.shortfall()}"
        limits = arm.limits
        at = np.minimum(angles - limits.lower, limits.upper - angles) < _AT_LIMIT
        names = ", ".join(arm.joint_names[j] for j in np.flatnonzero(at))
        why = f"{names} is at its limit" if names else "the posture is nearly singular"
        far = 1e3 * self.length * share
        return (
            f"the line of {self.frame!r} can be followed for {far:.3g} of {1e3 * self.length:.4g} "
            f"mm, where {why}: begin it in another posture"
        )


def _placements(arm: Arm, frame: str, q: Array) -> Iterator[pin.SE3]:
    """Yield where a frame is in the world at configurations (N, nq)."""
    at = frame_index(arm.model, frame)
    for row in q:
        pin.forwardKinematics(arm.model, arm.data, row)
        pose = pin.SE3(pin.updateFramePlacement(arm.model, arm.data, at))
        pose.translation += arm.origin
        yield pose
