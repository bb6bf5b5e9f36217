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
        self.samples: Array = np.array([position, velocity], dtype=np.float64)
        """Joint positions and velocities (2, N, nv), as given."""
        self.position, self.velocity = self.samples
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
        hermite(u, u + lead / self.period, self.period, self.samples, self._point)
        return self._point


@compiled
def hermite(u: float, u_acceleration: float, period: float, samples: Array, out: Array) -> None:
    """Interpolate a sampled trajectory.

    Args:
        u: time of position and velocity, in periods.
        u_acceleration: time of the acceleration, in periods.
        period: time between samples [s].
        samples: joint positions [rad or m] and velocities [rad/s or m/s] (2, N, nv).
        out: rows position, velocity, acceleration (3, nv), overwritten.
    """
    position, velocity = samples[0], samples[1]
    last = position.shape[0] - 1
    u = min(max(u, 0.0), float(last))
    k = min(int(u), last - 1)
    x = u - k
    step, bump = x * x * (3.0 - 2.0 * x), x * (1.0 - x)
    step_slope = 6.0 * bump / period
    moves = 0.0 <= u_acceleration < last
    m = int(u_acceleration) if moves else 0
    y = u_acceleration - m
    for j in range(position.shape[1]):
        a, b = position[k, j], position[k + 1, j]
        va, vb = velocity[k, j], velocity[k + 1, j]
        out[0, j] = a + step * (b - a) + period * bump * ((1.0 - x) * va - x * vb)
        out[1, j] = step_slope * (b - a) + (1.0 - x) * (1.0 - 3.0 * x) * va
        out[1, j] += x * (3.0 * x - 2.0) * vb
        out[2, j] = 0.0
        if moves:
            rise = (position[m + 1, j] - position[m, j]) / period
            slopes = (6.0 * y - 4.0) * velocity[m, j] + (6.0 * y - 2.0) * velocity[m + 1, j]
            out[2, j] = ((6.0 - 12.0 * y) * rise + slopes) / period
