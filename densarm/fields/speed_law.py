"""SpeedLaw: how fast the arm may go along a direction and still stop in the free space ahead."""

import math
from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.density.distance_bounds import (
    DistanceBounds,
    ExactDistances,
    all_exceed,
    least_room,
)
from densarm.errors import InvalidValueError
from densarm.proof.straight_brake import StraightBrake
from densarm.proof.swept_bound import SweptBound

_HALVINGS = 6  # of a speed from which no brake is within the limits


@dataclass(frozen=True)
class SpeedParameters:
    """Parameters of the speed law.

    Raises:
        InvalidValueError: a share outside (0, 1].
    """

    braking_share: float = 0.3
    """Share that planned braking uses of the deceleration that the limits leave."""
    velocity_share: float = 1.0
    """Share of the velocity limits."""

    def __post_init__(self) -> None:
        for name in ("braking_share", "velocity_share"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise InvalidValueError(name, getattr(self, name), "in (0, 1]")


class SpeedLaw:
    r"""The largest speed along a unit direction u.

    .. math::

        s = \min\Big\{ \frac{\nu v_i^{max}}{|u_i|},\ \sqrt{2 \beta a \ell},\
        \sqrt{2 \beta a h_k / r_k} \Big\}, \qquad r_k = \sum_j r_{kj} |u_j|

    The straight brake at β of the deceleration a then ends before the goal and before a pair's
    clearance h_k can be used up: ℓ is the length of the way left, r_kj the swept bound. a is what
    the acceleration limits and the dynamics on the way of the brake leave.

    Args:
        bound: the swept bound, whose margin is kept.
        parameters: β and ν.
    """

    def __init__(self, bound: SweptBound, parameters: SpeedParameters) -> None:
        self._arm = bound.arm
        self._velocity_limit = parameters.velocity_share * bound.arm.limits.velocity
        self._lever = bound.lever
        self._margin = bound.margin
        self._parameters = parameters
        self._brake = StraightBrake(bound.arm)
        least_room(ExactDistances(np.zeros(0)), 0.0, np.zeros(0))  # loads its kernel before a loop

    def speed(
        self, q: Array, direction: Array, distances: DistanceBounds, way_left: float
    ) -> float:
        """Return the speed s [rad/s]; zero where no brake is within the limits.

        Args:
            q: configuration (nq,).
            direction: unit vector u (nv,).
            distances: of all pairs at q.
            way_left: length ℓ of the way to the goal [rad].
        """
        turn = np.abs(direction)
        slowness = float((turn / self._velocity_limit).max())
        fastest = 1.0 / slowness if slowness > 0.0 else np.inf
        room = least_room(distances, self._margin, self._lever @ turn, enough=way_left)
        room = min(max(room, 0.0), way_left)
        deceleration = 1.0 / float((turn / self._arm.limits.acceleration).max())
        share = self._parameters.braking_share
        speed = min(fastest, math.sqrt(2.0 * share * deceleration * room))
        if not 0.0 < speed < np.inf:
            return speed
        for _ in range(_HALVINGS):
            duration = self._brake.duration(q, speed * direction)
            if math.isfinite(duration):
                break
            speed *= 0.5
        return min(speed, math.sqrt(2.0 * share * (speed / duration) * room))

    def limit(self, q: Array, velocity: Array, distances: DistanceBounds, way_left: float) -> Array:
        """Return a velocity (nv,), shortened to the speed s along it where it is faster.

        Args:
            q: configuration (nq,).
            velocity: shape (nv,) [rad/s or m/s].
            distances: of all pairs at q.
            way_left: length ℓ of the way to the goal [rad].
        """
        norm = float(np.hypot.reduce(velocity))  # of entries as large as 1e200
        if norm == 0.0:
            return velocity
        return velocity * min(1.0, self.speed(q, velocity / norm, distances, way_left) / norm)

    def can_stop(self, q: Array, v: Array, distances: DistanceBounds, motion: Array) -> bool:
        """Return whether the straight brake is proved to end in free space, inside all limits.

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            distances: of all pairs, from where the arm came to q.
            motion: bound on the motion of each joint since then (nv,) [rad or m].
        """
        duration = self._brake.duration(q, v)
        if not math.isfinite(duration):
            return False
        end, limits = self._arm.angles(q) + 0.5 * duration * v, self._arm.limits
        outward = ((end > limits.upper) & (v > 0.0)) | ((end < limits.lower) & (v < 0.0))
        used = self._lever @ (motion + 0.5 * duration * np.abs(v))
        need = np.where(used > 0.0, self._margin + used, -np.inf)
        return not outward.any() and all_exceed(distances, need)
