"""MovingDensity: the density among moving obstacles, with a moving target, on Rⁿ."""

from collections.abc import Sequence
from dataclasses import dataclass

from densarm.arrays import Array
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.gauge import Gauge
from densarm.density.implicit_function import ImplicitFunction, Placed, UnsafeRegion
from densarm.density.navigation_density import DensityParameters
from densarm.fields.motion import Motion
from densarm.validation import one_of, positive


@dataclass(frozen=True)
class MovingRegion:
    """An unsafe set with its sensing region that moves without turning."""

    region: UnsafeRegion
    """Both sets, about the origin."""
    motion: Motion
    """Where the origin of the region is."""


@dataclass(frozen=True)
class DensitySnapshot:
    """A `NavigationField`: the control of a `MovingDensity` at one time."""

    density: EuclideanDensity
    """The density of the obstacles and the target where they are."""
    gain: float
    """λ."""
    target_velocity: Array
    """ẋ* (n,) [m/s]."""

    @property
    def goal(self) -> Array:
        """x* (n,) [m]."""
        return self.density.goal

    @property
    def obstacles(self) -> tuple[ImplicitFunction, ...]:
        """Functions h_k of the unsafe sets where they are."""
        return self.density.obstacles

    def direction(self, x: Array) -> Array:
        """Return u of `MovingDensity` at points `x` (..., n) [m], of shape (..., n) [m/s]."""
        return self.gain * self.density.direction(x) + self.target_velocity

    def height(self, x: Array) -> Array:
        """Return ln ρ at points `x` (..., n), of shape (...)."""
        return self.density.height(x)


_DEFAULTS = DensityParameters()


class MovingDensity:
    r"""The density of obstacles and a target that move.

    .. math:: u(x, t) = \lambda k(x, t) + \dot x^*(t)

    k is the gradient of the density as the scene stands at t. Where nothing is sensed, the error
    e = x − x* obeys ė = λk(e), as if all stood still: it vanishes. With θ = 0, where k is
    unbounded in contact,

    .. math:: \dot h_k = \nabla h_k \cdot (u - \dot c_k) \to \infty \quad (h_k \to 0),

    so that an unsafe set at any bounded speed is not entered, in continuous time, as long as the
    others and the target keep away from it. A bound u_max on u keeps that for speeds below u_max.

    Args:
        unsafe: the unsafe sets, each with its sensing region and its motion.
        target: motion of x*, farther than two blend radii from every unsafe set.
        parameters: α, θ and blend; the gauge `LOG` or `RECIPROCAL`, as ∇ρ is flat in contact.
        gain: λ > 0, [m/s] per unit of k.

    Raises:
        InvalidValueError: a gain that is not positive, or the gauge `DENSITY`.
    """

    def __init__(
        self,
        unsafe: Sequence[MovingRegion],
        target: Motion,
        parameters: DensityParameters = _DEFAULTS,
        gain: float = 1.0,
    ) -> None:
        one_of("gauge of a moving density", parameters.gauge, [Gauge.LOG, Gauge.RECIPROCAL])
        self.unsafe = tuple(unsafe)
        self.target = target
        self.parameters = parameters
        self.gain = positive("gain", gain)

    def at(self, time: float) -> DensitySnapshot:
        """Return the control as it is at a time [s]."""
        regions = []
        for moving in self.unsafe:
            centre = moving.motion.position(time)
            h, s = Placed(moving.region.h, centre), Placed(moving.region.s, centre)
            regions.append(UnsafeRegion(h, s))
        return DensitySnapshot(
            EuclideanDensity(regions, self.target.position(time), self.parameters),
            self.gain,
            self.target.velocity(time),
        )
