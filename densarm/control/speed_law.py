"""SpeedLaw: how fast the arm may go along a direction and still stop in the free space ahead."""

import math
from dataclasses import dataclass

import numpy as np

from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.documented import documented
from densarm.world.active_pairs import (
    DistanceBounds,
    ExactDistances,
    all_exceed,
    longest_travel,
)
from densarm.world.stopping import StoppingTrajectory
from densarm.world.world import World

_HALVINGS = 6  # of a speed from which no way to stop is within the limits


@documented
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

    The stopping trajectory at β of the deceleration a then ends before the goal and before a pair's
    clearance h_k can be used up: ℓ is the length of the way left, r_kj the Lipschitz constants, and
    a what the acceleration limits and the dynamics on its way leave.

    The margin [m] is kept; the parameters are β and ν.
    """

    def __init__(
        self, world: World, margin: float, parameters: SpeedParameters = SpeedParameters()
    ) -> None:
        self._arm = world.arm
        self._velocity_limit = parameters.velocity_share * world.arm.limits.velocity
        self._world = world
        self._margin = margin
        self._parameters = parameters
        self._stopping = StoppingTrajectory(world.arm)
        longest_travel(ExactDistances(np.zeros(0)), 0.0, np.zeros(0))  # loads its kernel

    def speed(
        self, q: Array, direction: Array, distances: DistanceBounds, way_left: float
    ) -> float:
        """Return s [rad/s] at q (nq,) along u (nv,); zero where nothing stops within the limits.

        The distances are those of all pairs at q, and the way left is ℓ [rad].
        """
        turn = np.abs(direction)
        slowness = float((turn / self._velocity_limit).max())
        fastest = 1.0 / slowness if slowness > 0.0 else np.inf
        rate = self._world.motion_bound(turn)
        free = longest_travel(distances, self._margin, rate, enough=way_left)
        free = min(max(free, 0.0), way_left)
        deceleration = 1.0 / float((turn / self._arm.limits.acceleration).max())
        share = self._parameters.braking_share
        speed = min(fastest, math.sqrt(2.0 * share * deceleration * free))
        if not 0.0 < speed < np.inf:
            return speed
        for _ in range(_HALVINGS):
            duration = self._stopping.duration(q, speed * direction)
            if math.isfinite(duration):
                break
            speed *= 0.5
        return min(speed, math.sqrt(2.0 * share * (speed / duration) * free))

    def limit(self, q: Array, velocity: Array, distances: DistanceBounds, way_left: float) -> Array:
        """Return a velocity (nv,) [rad/s or m/s], shortened to s along it where it is faster."""
        norm = float(np.hypot.reduce(velocity))  # of entries as large as 1e200
        if norm == 0.0:
            return velocity
        return velocity * min(1.0, self.speed(q, velocity / norm, distances, way_left) / norm)

    def can_stop(self, q: Array, v: Array, distances: DistanceBounds, motion: Array) -> bool:
        """Return whether stopping from q (nq,) and v (nv,) is proved clear, inside all limits.

        The distances are those from where the arm came, each joint having moved since by the bound
        `motion` (nv,) [rad or m] at most.
        """
        duration = self._stopping.duration(q, v)
        if not math.isfinite(duration):
            return False
        end, limits = self._arm.angles(q) + 0.5 * duration * v, self._arm.limits
        outward = ((end > limits.upper) & (v > 0.0)) | ((end < limits.lower) & (v < 0.0))
        used = self._world.motion_bound(motion + 0.5 * duration * np.abs(v))
        need = np.where(used > 0.0, self._margin + used, -np.inf)
        return not outward.any() and all_exceed(distances, need)
