"""MovingDensity: the density among moving obstacles, with a moving target, on Rⁿ."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from densarm.density.navigation_density import DensityParameters, Gauge
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import Placed, UnsafeRegion
from densarm.values.arrays import Array
from densarm.values.checks import finite_tuple, one_of, positive, positive_tuple


class PointMotion(Protocol):
    """A point of Rⁿ that moves, its velocity the derivative of its position."""

    def position(self, time: float) -> Array:
        """Return c(t) at a time [s], shape (n,) [m]."""
        ...

    def velocity(self, time: float) -> Array:
        """Return ċ(t) at a time [s], shape (n,) [m/s]."""
        ...


@dataclass(frozen=True)
class EllipticMotion:
    """Around an ellipse of the plane: c(t) = p + (a cos φ, b sin φ), φ = ωt + φ₀."""

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
        object.__setattr__(self, "semi_axes", positive_tuple("semi_axes", self.semi_axes, 2))
        finite_tuple("rate and phase", (self.rate, self.phase), 2)

    def position(self, time: float) -> Array:
        """Act as `PointMotion.position`."""
        angle = self.rate * time + self.phase
        turned: Array = np.array([np.cos(angle), np.sin(angle)])
        return np.array(self.centre) + np.array(self.semi_axes) * turned

    def velocity(self, time: float) -> Array:
        """Act as `PointMotion.velocity`."""
        angle = self.rate * time + self.phase
        turned: Array = np.array([-np.sin(angle), np.cos(angle)])
        return self.rate * np.array(self.semi_axes) * turned


@dataclass(frozen=True)
class MovingRegion:
    """An unsafe set with its sensing region that moves without turning."""

    region: UnsafeRegion
    """Both sets, about the origin."""
    motion: PointMotion
    """Where the origin of the region is."""

    def at(self, time: float) -> UnsafeRegion:
        """Return both sets where they are at a time [s]."""
        centre = self.motion.position(time)
        return UnsafeRegion(Placed(self.region.h, centre), Placed(self.region.s, centre))


class MovingDensity:
    r"""The density of obstacles and a target that move.

    .. math:: u(x, t) = \lambda k(x, t) + \dot x^*(t)

    k is the gradient of the density as the scene stands at t. With θ = 0 it is unbounded in
    contact, so that no unsafe set is entered in continuous time as long as the others and the
    target keep away from it; under a bound u_max on u, none that is slower than u_max.

    Args:
        unsafe: the unsafe sets, each with its sensing region and its motion.
        target: motion of x*, farther than two blend radii from every unsafe set.
        parameters: α, θ and blend; the gauge `LOG` or `RECIPROCAL`, as ∇ρ is flat in contact.
        gain: λ > 0, [m/s] per unit of k.
    """

    def __init__(
        self,
        unsafe: Sequence[MovingRegion],
        target: PointMotion,
        parameters: DensityParameters,
        gain: float = 1.0,
    ) -> None:
        one_of("gauge of a moving density", parameters.gauge, [Gauge.LOG, Gauge.RECIPROCAL])
        self.unsafe = tuple(unsafe)
        self.target = target
        self.parameters = parameters
        self.gain = positive("gain", gain)

    def at(self, time: float) -> "DensitySnapshot":
        """Return the control as it is at a time [s]."""
        return DensitySnapshot(self, time)


class DensitySnapshot(EuclideanDensity):
    """A `MovingDensity` as it stands at a time [s], its direction the control u."""

    def __init__(self, moving: MovingDensity, time: float) -> None:
        unsafe = [region.at(time) for region in moving.unsafe]
        super().__init__(unsafe, moving.target.position(time), moving.parameters)
        self._gain = moving.gain
        self._target_velocity = moving.target.velocity(time)

    def direction(self, x: Array) -> Array:
        """Return u of `MovingDensity` at points `x` (..., n) [m], of shape (..., n) [m/s]."""
        return self._gain * super().direction(x) + self._target_velocity
