"""How an obstacle moves: at a constant velocity, through way points, or back and forth."""

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError
from densarm.scene.shapes import FARTHEST
from densarm.values.arrays import Array, Vector
from densarm.values.checks import finite_tuple, finite_vector, positive, unit_quaternion
from densarm.values.documented import documented

FASTEST = 100.0
"""No obstacle moves faster than this [m/s], or turns faster [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class ObstacleMotion(ABC):
    """Where an obstacle is at each time [s], given the pose that is its own.

    Poses are those of its frame in the world; of a scene that does not move on, at time zero.
    """

    @abstractmethod
    def pose(self, time: float, own: pin.SE3) -> pin.SE3:
        """Return where it is."""

    @abstractmethod
    def velocity(self, time: float, own: pin.SE3) -> Array:
        """Return the velocity of its frame's origin [m/s] and of its turning [rad/s], (6,).

        Both are in the world frame. Where they jump, those to come count.
        """

    @abstractmethod
    def speed_bounds(self, begin: float, end: float, own: pin.SE3) -> tuple[float, float]:
        """Return bounds between two times, which may be infinite.

        They are of the speed of the point about which it turns [m/s] and of its turning [rad/s].
        """

    @property
    def pivot(self) -> Array:
        """The point of the body about which it turns, in its frame (3,) [m]."""
        return np.zeros(3)


@documented
@dataclass(frozen=True, kw_only=True)
class ConstantVelocity(ObstacleMotion):
    """From its own pose at time zero at a constant velocity, turning about its frame's origin.

    Raises:
        InvalidValueError: a velocity that is not finite.
    """

    linear: Vector
    """Velocity of the frame's origin [m/s]."""
    angular: Vector = (0.0, 0.0, 0.0)
    """Angular velocity, in the world frame [rad/s]."""

    def __post_init__(self) -> None:
        for key in ("linear", "angular"):
            object.__setattr__(self, key, finite_tuple(f"motion.{key}", getattr(self, key), 3))

    def pose(self, time: float, own: pin.SE3) -> pin.SE3:
        """Act as `ObstacleMotion.pose`."""
        linear, angular = self._vectors
        return pin.SE3(pin.exp3(time * angular) @ own.rotation, own.translation + time * linear)

    def velocity(self, time: float, own: pin.SE3) -> Array:  # noqa: ARG002
        """Act as `ObstacleMotion.velocity`."""
        return self._vectors.ravel()

    def speed_bounds(self, begin: float, end: float, own: pin.SE3) -> tuple[float, float]:  # noqa: ARG002
        """Act as `ObstacleMotion.speed_bounds`."""
        linear, angular = np.linalg.norm(self._vectors, axis=1).tolist()
        return linear, angular

    @cached_property
    def _vectors(self) -> Array:
        return np.array([self.linear, self.angular])


@documented
@dataclass(frozen=True, kw_only=True)
class Waypoints(ObstacleMotion):
    """Through poses at given times, straight and turning evenly from each to the next.

    Before the first time and after the last it stands still. Bodies of a chain, such as a
    person's upper arm and forearm, stay joined if their pivots are the joint between them, and
    have the same times and positions.

    Raises:
        InvalidValueError: fewer than two way points, not as many positions or orientations as
            times, times that do not increase, or an entry that is not finite.
    """

    times: Sequence[float]
    """Increasing times (N,) [s]."""
    positions: Sequence[Vector]
    """Positions of the pivot (N, 3) [m]."""
    orientations_xyzw: Sequence[Vector] = ()
    """Unit quaternions x y z w of the frame (N, 4); none for the obstacle's own throughout."""
    of_point: Vector = (0.0, 0.0, 0.0)
    """Point of the body, in its frame, that the positions are of: its pivot [m]."""

    def __post_init__(self) -> None:
        times = tuple(finite_vector("motion.times", self.times, np.size(self.times)).tolist())
        if len(times) < 2 or not (np.diff(times) > 0.0).all():
            raise InvalidValueError("motion.times", times, "two or more times that increase")
        for key in ("positions", "orientations_xyzw"):
            given = getattr(self, key)
            if not isinstance(given, Sequence | np.ndarray):
                raise InvalidValueError(f"motion.{key}", given, "one for each time")
            if len(given) != len(times) and (len(given) or key == "positions"):
                allowed = f"as many as times, {len(times)}"
                raise InvalidValueError(f"motion.{key}", len(given), allowed)
        values: dict[str, Any] = {
            "times": times,
            "positions": tuple(
                near_position(f"motion.positions[{k}]", item)
                for k, item in enumerate(self.positions)
            ),
            "orientations_xyzw": tuple(
                unit_quaternion(f"motion.orientations_xyzw[{k}]", item)
                for k, item in enumerate(self.orientations_xyzw)
            ),
            "of_point": finite_tuple("motion.of_point", self.of_point, 3),
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def pose(self, time: float, own: pin.SE3) -> pin.SE3:
        """Act as `ObstacleMotion.pose`."""
        k = self._segment(time)
        linear, angular = self._rates
        gone = min(max(time, self.times[0]), self.times[-1]) - self.times[k]
        before = self._rotations[k] if self._rotations else own.rotation
        rotation = pin.exp3(gone * angular[k]) @ before
        position = np.array(self.positions[k]) + gone * linear[k]
        return pin.SE3(rotation, position - rotation @ self.pivot)

    def velocity(self, time: float, own: pin.SE3) -> Array:
        """Act as `ObstacleMotion.velocity`."""
        if not self.times[0] <= time < self.times[-1]:
            return np.zeros(6)
        k = self._segment(time)
        linear, angular = (rates[k] for rates in self._rates)
        offset = self.pose(time, own).rotation @ self.pivot
        return np.concatenate([linear - np.cross(angular, offset), angular])

    def speed_bounds(self, begin: float, end: float, own: pin.SE3) -> tuple[float, float]:  # noqa: ARG002
        """Act as `ObstacleMotion.speed_bounds`."""
        if end <= self.times[0] or begin >= self.times[-1]:
            return 0.0, 0.0
        passed = slice(self._segment(begin), self._segment(end) + 1)
        linear, angular = (np.linalg.norm(rates[passed], axis=1).max() for rates in self._rates)
        return float(linear), float(angular)

    @cached_property
    def pivot(self) -> Array:
        """As `ObstacleMotion.pivot`."""
        return np.array(self.of_point)

    def _segment(self, time: float) -> int:
        return min(max(bisect_right(self.times, time) - 1, 0), len(self.times) - 2)

    @cached_property
    def _rotations(self) -> list[Array]:
        return [pin.Quaternion(np.array(x)).matrix() for x in self.orientations_xyzw]

    @cached_property
    def _rates(self) -> tuple[Array, Array]:
        """Velocity of the pivot and angular velocity on each segment (N - 1, 3)."""
        spans = np.diff(self.times)[:, np.newaxis]
        turns = np.zeros((len(spans), 3))
        for k, (a, b) in enumerate(zip(self._rotations[:-1], self._rotations[1:], strict=True)):
            turns[k] = pin.log3(b @ a.T)
        return np.diff(np.array(self.positions), axis=0) / spans, turns / spans


@documented
@dataclass(frozen=True, kw_only=True)
class BackAndForth(ObstacleMotion):
    r"""Between its own pose and another, for ever: a share s(t) of the way.

    .. math:: s(t) = \tfrac12 (1 - \cos(2\pi t/T))

    if smooth, else as fast forth as back.

    Raises:
        InvalidValueError: a period that is not positive, or an entry that is not finite.
    """

    position: Vector
    """Position of the frame's origin at the other end [m]."""
    orientation_xyzw: Vector | None = None
    """Unit quaternion of the frame there; None for its own."""
    period: float
    """Time T from an end until it is there again [s]."""
    smooth: bool = True
    """Whether it slows down before it turns back."""

    def __post_init__(self) -> None:
        values: dict[str, Any] = {
            "position": near_position("motion.position", self.position),
            "period": positive("motion.period", self.period),
        }
        if not isinstance(self.smooth, bool):
            raise InvalidValueError("motion.smooth", self.smooth, "true or false")
        if self.orientation_xyzw is not None:
            given = unit_quaternion("motion.orientation_xyzw", self.orientation_xyzw)
            values["orientation_xyzw"] = given
        for key, value in values.items():
            object.__setattr__(self, key, value)

    def pose(self, time: float, own: pin.SE3) -> pin.SE3:
        """Act as `ObstacleMotion.pose`."""
        way, turn = self._way(own)
        share = abs((2.0 * time / self.period + 1.0) % 2.0 - 1.0)
        if self.smooth:
            share = 0.5 * (1.0 - np.cos(np.pi * share))
        return pin.SE3(pin.exp3(share * turn) @ own.rotation, own.translation + share * way)

    def velocity(self, time: float, own: pin.SE3) -> Array:
        """Act as `ObstacleMotion.velocity`."""
        phase = (time / self.period) % 1.0
        rate = 2.0 if phase < 0.5 else -2.0
        if self.smooth:
            rate = np.pi * np.sin(2.0 * np.pi * phase)
        return rate / self.period * np.concatenate(self._way(own))

    def speed_bounds(self, begin: float, end: float, own: pin.SE3) -> tuple[float, float]:  # noqa: ARG002
        """Act as `ObstacleMotion.speed_bounds`."""
        largest = (np.pi if self.smooth else 2.0) / self.period
        way, turn = (float(np.linalg.norm(each)) for each in self._way(own))
        return largest * way, largest * turn

    def _way(self, own: pin.SE3) -> tuple[Array, Array]:
        """Return the way (3,) [m] and the turn (3,) [rad] from one end to the other."""
        turn = np.zeros(3)
        if self.orientation_xyzw is not None:
            other = pin.Quaternion(np.array(self.orientation_xyzw)).matrix()
            turn = pin.log3(other @ own.rotation.T)
        return np.array(self.position) - own.translation, turn


MOTION_TYPES: Mapping[str, type[ObstacleMotion]] = {
    "constant_velocity": ConstantVelocity,
    "waypoints": Waypoints,
    "back_and_forth": BackAndForth,
}
"""Every kind of motion by the word that files use for it."""


def near_position(name: str, value: ArrayLike) -> tuple[float, ...]:
    """Return a position (3,) [m] as a tuple; errors as `finite_vector`, or where it is far away."""
    position = finite_tuple(name, value, 3)
    if not max(map(abs, position)) < FARTHEST:
        raise InvalidValueError(name, position, "less than 1000 km away")
    return position
