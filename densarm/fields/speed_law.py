"""SpeedLaw: how fast the arm may go along a direction and still stop in the free space ahead."""

import math
from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.errors import InvalidValueError
from densarm.swept_bound import SweptBound


@dataclass(frozen=True)
class SpeedParameters:
    """Parameters of the speed law.

    Raises:
        InvalidValueError: a share outside (0, 1].
    """

    braking_share: float = 0.3
    """Share of the acceleration limits that planned braking uses."""
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
        \sqrt{2 \beta a h_k / r_k} \Big\}, \qquad
        a = \min_i \frac{a_i^{max}}{|u_i|}, \quad r_k = \sum_j r_{kj} |u_j|

    The straight-line brake at β of the acceleration limits then ends before the goal and before a
    pair's clearance h_k can be used up: ℓ is the length of the way left, r_kj the swept bound.

    Args:
        bound: the swept bound, whose margin is kept.
        parameters: β and ν.
    """

    def __init__(self, bound: SweptBound, parameters: SpeedParameters) -> None:
        self._limits = bound.arm.limits
        self._velocity_limit = parameters.velocity_share * bound.arm.limits.velocity
        self._lever = bound.lever
        self._margin = bound.margin
        self._parameters = parameters

    def speed(self, direction: Array, distance: Array, way_left: float) -> float:
        """Return the speed s [rad/s].

        Args:
            direction: unit vector u (nv,).
            distance: signed distances of all pairs (K,) [m].
            way_left: length ℓ of the way to the goal [rad].
        """
        return float(
            _speed(
                direction,
                distance,
                self._margin,
                self._lever,
                self._velocity_limit,
                self._limits.acceleration,
                way_left,
                self._parameters.braking_share,
            )
        )

    def limit(self, velocity: Array, distance: Array, way_left: float) -> Array:
        """Return a velocity (nv,), shortened to the speed s along it where it is faster.

        Args:
            velocity: shape (nv,) [rad/s or m/s].
            distance: signed distances of all pairs (K,) [m].
            way_left: length ℓ of the way to the goal [rad].
        """
        norm = float(np.sqrt(velocity @ velocity))
        if norm == 0.0:
            return velocity
        return velocity * min(1.0, self.speed(velocity / norm, distance, way_left) / norm)

    def must_brake(self, v: Array, distance: Array, reaction: float) -> bool:
        """Return whether the full straight-line brake from v would leave the proved free space.

        Args:
            v: velocity (nv,).
            distance: signed distances of all pairs (K,) [m].
            reaction: time before the brake acts [s].
        """
        return _must_brake(
            v, distance, self._margin, self._lever, self._limits.acceleration, reaction
        )


@compiled
def _speed(
    direction: Array,
    distance: Array,
    margin: float,
    lever: Array,
    velocity_limit: Array,
    acceleration_limit: Array,
    way_left: float,
    braking_share: float,
) -> float:
    speed, braking = np.inf, np.inf
    for j in range(direction.shape[0]):
        part = abs(direction[j])
        if part > 0.0:
            speed = min(speed, velocity_limit[j] / part)
            braking = min(braking, braking_share * acceleration_limit[j] / part)
    room = way_left
    for k in range(distance.shape[0]):
        rate = 0.0
        for j in range(direction.shape[0]):
            rate += lever[k, j] * abs(direction[j])
        if rate > 0.0:
            room = min(room, max(distance[k] - margin, 0.0) / rate)
    return min(speed, math.sqrt(2.0 * braking * room))


@compiled
def _must_brake(
    v: Array,
    distance: Array,
    margin: float,
    lever: Array,
    acceleration_limit: Array,
    reaction: float,
) -> bool:
    time = 0.0
    for j in range(v.shape[0]):
        time = max(time, abs(v[j]) / acceleration_limit[j])
    path_time = 0.5 * time + reaction
    for k in range(distance.shape[0]):
        rate = 0.0
        for j in range(v.shape[0]):
            rate += lever[k, j] * abs(v[j])
        if rate * path_time > 0.0 and rate * path_time >= distance[k] - margin:
            return True
    return False
