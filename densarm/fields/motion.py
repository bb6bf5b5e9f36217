"""Motions of obstacles and targets: positions and velocities over time."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from densarm.arrays import Array
from densarm.validation import finite_tuple, positive


class Motion(Protocol):
    """A point of Rⁿ that moves, its velocity the derivative of its position."""

    def position(self, time: float) -> Array:
        """Return c(t) at a time [s], shape (n,) [m]."""
        ...

    def velocity(self, time: float) -> Array:
        """Return ċ(t) at a time [s], shape (n,) [m/s]."""
        ...


@dataclass(frozen=True)
class UniformMotion:
    """c(t) = c₀ + t v.

    Raises:
        InvalidValueError: an entry that is not finite, or vectors of different lengths.
    """

    start: tuple[float, ...]
    """c₀, shape (n,) [m]."""
    constant_velocity: tuple[float, ...]
    """v, shape (n,) [m/s]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", finite_tuple("start", self.start, np.size(self.start)))
        velocity = finite_tuple("constant_velocity", self.constant_velocity, len(self.start))
        object.__setattr__(self, "constant_velocity", velocity)

    def position(self, time: float) -> Array:
        """Act as `Motion.position`."""
        return np.array(self.start) + time * np.array(self.constant_velocity)

    def velocity(self, time: float) -> Array:  # noqa: ARG002
        """Act as `Motion.velocity`."""
        return np.array(self.constant_velocity)


@dataclass(frozen=True)
class EllipticMotion:
    r"""Around an ellipse of the plane.

    .. math:: c(t) = p + (a \cos\phi, b \sin\phi), \qquad \phi = \omega t + \phi_0

    Raises:
        InvalidValueError: a semi-axis that is not positive, or a number that is not finite.
    """

    centre: tuple[float, ...]
    """p, shape (2,) [m]."""
    semi_axes: tuple[float, ...]
    """a, b > 0 [m]."""
    rate: float
    """ω [rad/s]; negative turns clockwise."""
    phase: float = 0.0
    """φ₀ [rad]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", finite_tuple("centre", self.centre, 2))
        object.__setattr__(self, "semi_axes", finite_tuple("semi_axes", self.semi_axes, 2))
        for semi_axis in self.semi_axes:
            positive("semi_axes", semi_axis)
        finite_tuple("rate and phase", (self.rate, self.phase), 2)

    def position(self, time: float) -> Array:
        """Act as `Motion.position`."""
        angle = self.rate * time + self.phase
        turned: Array = np.array([np.cos(angle), np.sin(angle)])
        return np.array(self.centre) + np.array(self.semi_axes) * turned

    def velocity(self, time: float) -> Array:
        """Act as `Motion.velocity`."""
        angle = self.rate * time + self.phase
        turned: Array = np.array([-np.sin(angle), np.cos(angle)])
        return self.rate * np.array(self.semi_axes) * turned
