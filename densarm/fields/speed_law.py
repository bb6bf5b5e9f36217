"""SpeedLaw: how fast the arm may go along a direction and still stop in the free space ahead."""

import math
from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.compiled import compiled
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

    def speed(self, q: Array, direction: Array, distance: Array, way_left: float) -> float:
        """Return the speed s [rad/s]; zero where no brake is within the limits.

        Args:
            q: configuration (nq,).
            direction: unit vector u (nv,).
            distance: signed distances of all pairs (K,) [m].
            way_left: length ℓ of the way to the goal [rad].
        """
        limits = self._arm.limits
        fastest, room = _fastest(
            direction, distance, self._margin, self._lever, self._velocity_limit, way_left
        )
        deceleration = 1.0 / float((np.abs(direction) / limits.acceleration).max())
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

    def limit(self, q: Array, velocity: Array, distance: Array, way_left: float) -> Array:
        """Return a velocity (nv,), shortened to the speed s along it where it is faster.

        Args:
            q: configuration (nq,).
            velocity: shape (nv,) [rad/s or m/s].
            distance: signed distances of all pairs (K,) [m].
            way_left: length ℓ of the way to the goal [rad].
        """
        norm = float(np.hypot.reduce(velocity))  # of entries as large as 1e200
        if norm == 0.0:
            return velocity
        return velocity * min(1.0, self.speed(q, velocity / norm, distance, way_left) / norm)

    def can_stop(self, q: Array, v: Array, distance: Array, motion: Array) -> bool:
        """Return whether the straight brake is proved to end in free space, inside all limits.

        Args:
            q: configuration (nq,).
            v: velocity (nv,) [rad/s or m/s].
            distance: signed distances of all pairs (K,) [m], known before the arm came to q.
            motion: bound on the motion of each joint since then (nv,) [rad or m].
        """
        duration = self._brake.duration(q, v)
        if not math.isfinite(duration):
            return False
        end, limits = self._arm.angles(q) + 0.5 * duration * v, self._arm.limits
        outward = ((end > limits.upper) & (v > 0.0)) | ((end < limits.lower) & (v < 0.0))
        used = self._lever @ (motion + 0.5 * duration * np.abs(v))
        return not outward.any() and bool(((used < distance - self._margin) | (used == 0.0)).all())


@compiled
def _fastest(
    direction: Array,
    distance: Array,
    margin: float,
    lever: Array,
    velocity_limit: Array,
    way_left: float,
) -> tuple[float, float]:
    """Return the speed that the velocity limits allow, and the room along the direction [rad]."""
    speed, room = np.inf, way_left
    for j in range(direction.shape[0]):
        if direction[j] != 0.0:
            speed = min(speed, velocity_limit[j] / abs(direction[j]))
    for k in range(distance.shape[0]):
        rate = 0.0
        for j in range(direction.shape[0]):
            rate += lever[k, j] * abs(direction[j])
        if rate > 0.0:
            room = min(room, max(distance[k] - margin, 0.0) / rate)
    return speed, room
