"""Reference: the trajectory q_d(t) that the controller tracks."""

from typing import NamedTuple

import numpy as np

from densarm.arrays import Array
from densarm.compiled import compiled


class ReferencePoint(NamedTuple):
    """One instant of a reference; continuous joints count their turns."""

    position: Array
    """Joint positions (nv,) [rad or m]."""
    velocity: Array
    """Joint velocities (nv,) [rad/s or m/s]."""
    acceleration: Array
    """Joint accelerations (nv,) [rad/s² or m/s²]."""


class Reference:
    """A sampled trajectory, interpolated by cubic Hermite polynomials; at rest beyond its ends.

    Args:
        period: time between samples [s].
        position: joint positions (N, nv) [rad or m], N >= 2.
        velocity: joint velocities (N, nv), zero in the first and last row.
    """

    def __init__(self, period: float, position: Array, velocity: Array) -> None:
        self.period = period
        self.position = np.ascontiguousarray(position)
        self.velocity = np.ascontiguousarray(velocity)
        self._point = np.zeros((3, position.shape[1]))

    @property
    def duration(self) -> float:
        """Time at which it comes to rest [s]."""
        return self.period * (len(self.position) - 1)

    def sample(self, t: float) -> ReferencePoint:
        """Return position, velocity and acceleration at time t [s]."""
        return ReferencePoint(*self.update(t).copy())

    def update(self, t: float, lead: float = 0.0) -> Array:
        """Return position, velocity and acceleration, in an array that the next call reuses.

        Args:
            t: time of position and velocity [s].
            lead: how much later the acceleration is taken [s]; half of the time that a torque is
                held makes it the mean over that time.

        Returns:
            Rows position, velocity, acceleration (3, nv), as in `ReferencePoint`.
        """
        u = t / self.period
        _hermite(u, u + lead / self.period, self.period, self.position, self.velocity, self._point)
        return self._point


@compiled
def _hermite(
    u: float, u_acceleration: float, period: float, position: Array, velocity: Array, out: Array
) -> None:
    last = position.shape[0] - 1
    for j in range(position.shape[1]):
        out[0, j] = position[0, j] if u < 0.0 else position[last, j]
        out[1, j] = 0.0
        out[2, j] = 0.0
        if 0.0 <= u < last:
            x = u - int(u)
            a, va, c2, c3 = _cubic(int(u), j, period, position, velocity)
            out[0, j] = a + x * (va + x * (c2 + x * c3))
            out[1, j] = (va + x * (2.0 * c2 + 3.0 * x * c3)) / period
        if 0.0 <= u_acceleration < last:
            x = u_acceleration - int(u_acceleration)
            _, _, c2, c3 = _cubic(int(u_acceleration), j, period, position, velocity)
            out[2, j] = (2.0 * c2 + 6.0 * x * c3) / (period * period)


@compiled
def _cubic(
    k: int, j: int, period: float, position: Array, velocity: Array
) -> tuple[float, float, float, float]:
    """Return the coefficients of joint j's polynomial between samples k and k + 1."""
    a, b = position[k, j], position[k + 1, j]
    va, vb = velocity[k, j] * period, velocity[k + 1, j] * period
    return a, va, 3.0 * (b - a) - 2.0 * va - vb, 2.0 * (a - b) + va + vb
