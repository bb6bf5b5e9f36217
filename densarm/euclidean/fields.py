"""Fields on Rⁿ: the density's baselines, their bound, and the density over joint positions."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.arm import Arm
from densarm.density.navigation_density import V_MIN, Gauge, NavigationDensity
from densarm.errors import InvalidValueError
from densarm.euclidean.implicit import ImplicitFunction
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive
from densarm.world.world import World


class NavigationField(Protocol):
    """A planning system ẋ = k(x) on Rⁿ, evaluated at many points at once."""

    @property
    def goal(self) -> Array:
        """The point that k should lead to, shape (n,) [m]."""
        ...

    @property
    def obstacles(self) -> Sequence[ImplicitFunction]:
        """Functions h_k; {h_k ≤ 0} must not be entered."""
        ...

    def direction(self, x: Array) -> Array:
        """Return k at points `x` (..., n) [m], of shape (..., n); zero at critical points."""
        ...

    def height(self, x: Array) -> Array:
        """Return a function that k climbs at points `x` (..., n), of shape (...)."""
        ...


def saturate(u: ArrayLike, u_max: float) -> Array:
    r"""Bound controls in the maximum norm, and keep their directions.

    .. math:: \bar u = u \min\left(1, \frac{u_{max}}{\|u\|_\infty}\right)

    Args:
        u: controls (..., n), in any unit.
        u_max: bound > 0 in that unit; infinity for none.

    Returns:
        ū (..., n).

    Raises:
        InvalidValueError: a bound that is not positive.

    Source: [ZNV] eq. 13-14.
    """
    if not u_max > 0.0:
        raise InvalidValueError("u_max", u_max, "a number > 0, or infinity")
    u = np.asarray(u, np.float64)
    largest = np.abs(u).max(axis=-1, keepdims=True)
    return u * (u_max / np.maximum(largest, u_max)) if np.isfinite(u_max) else u


class NavigationFunction:
    r"""Descent of a navigation function in a bounded world, by Rimon and Koditschek: a baseline.

    .. math::

        \psi(x) = \frac{\gamma}{\gamma + \beta^{1/\kappa}}, \qquad
        \gamma = \|x - x_{goal}\|^2, \quad \beta = \prod_k h_k(x)

    −∇ψ runs along the gradient of ln(β)/κ − ln γ, which neither over- nor underflows.

    Args:
        obstacles: functions h_k, the bound of the world among them: ``Complement(Ball(radius))``.
        goal: shape (n,) [m].
        kappa: κ > 0, dimensionless.

    Source: [ZNV] section IV-C; E. Rimon, D. E. Koditschek, IEEE T-RA 8(5), 1992, whose
    γ/(γ^κ + β)^{1/κ} is the same function of β/γ^κ up to a monotone map, hence the same curves.
    """

    def __init__(
        self, obstacles: Sequence[ImplicitFunction], goal: ArrayLike, kappa: float
    ) -> None:
        self.obstacles = tuple(obstacles)
        self.goal = finite_vector("goal", goal, np.size(goal))
        self.kappa = positive("kappa", kappa)

    def height(self, x: Array) -> Array:
        """Return ln(β)/κ − ln γ at points `x` (..., n), of shape (...); −inf in contact."""
        gamma = np.sum((x - self.goal) ** 2, axis=-1)
        total = -np.log(np.maximum(gamma, V_MIN))
        for obstacle in self.obstacles:
            h = obstacle(x)
            log_h = np.log(np.where(h > 0.0, h, 1.0))
            total += np.where(h > 0.0, log_h / self.kappa, -np.inf)
        return total  # type: ignore[no-any-return]

    def direction(self, x: Array) -> Array:
        """Return −∇ψ/(ψ(1 − ψ)) · γ at points `x` (..., n), zero at the goal; out of contact."""
        error = x - self.goal
        gamma = np.sum(error**2, axis=-1, keepdims=True)
        log_beta_gradient = np.zeros_like(error)
        for h in self.obstacles:
            # A small positive floor in place of h ≤ 0 points out of contact.
            value = np.maximum(h(x), _SMALLEST_FACTOR)[..., np.newaxis]
            log_beta_gradient += h.gradient(x) / value
        return gamma / self.kappa * log_beta_gradient - 2.0 * error  # type: ignore[no-any-return]


class PotentialField:
    r"""Descent of Khatib's attractive and repulsive potential: a baseline.

    .. math::

        U(x) = \frac{1}{2} \|x - x_{goal}\|^2 + \frac{1}{2} \sum_{h_k < h_0}
        \left(\frac{1}{h_k(x)} - \frac{1}{h_0}\right)^2

    Args:
        obstacles: functions h_k, all in one unit.
        goal: shape (n,) [m].
        influence: h_0 > 0, value of h below which an obstacle repels, in its unit.

    Source: O. Khatib, IJRR 5(1), 1986, with implicit functions as there in place of distances.
    """

    def __init__(
        self, obstacles: Sequence[ImplicitFunction], goal: ArrayLike, influence: float
    ) -> None:
        self.obstacles = tuple(obstacles)
        self.goal = finite_vector("goal", goal, np.size(goal))
        self.influence = positive("influence", influence)

    def height(self, x: Array) -> Array:
        """Return −U at points `x` (..., n), of shape (...); hugely negative in contact."""
        total = -0.5 * np.sum((x - self.goal) ** 2, axis=-1)
        for h in self.obstacles:
            total -= 0.5 * self._excess(h(x)) ** 2
        return total  # type: ignore[no-any-return]

    def direction(self, x: Array) -> Array:
        """Return −∇U at points `x` (..., n)."""
        out = self.goal - x
        for h in self.obstacles:
            value = np.maximum(h(x), _SMALLEST_GAP)
            slope = self._excess(value) / value**2
            out += slope[..., np.newaxis] * h.gradient(x)
        return out

    def _excess(self, h: Array) -> Array:
        return np.maximum(1.0 / np.maximum(h, _SMALLEST_GAP) - 1.0 / self.influence, 0.0)


class JointSpaceField:
    """∇ ln ρ(q(θ)) over joint positions θ, a `NavigationField`.

    Joint positions of continuous joints count turns: k is periodic in them, the goal is one of
    its images.

    Args:
        world: the arm, and the signed distances of at least one pair that tell a collision.
        density: ρ.
    """

    def __init__(self, world: World, density: NavigationDensity) -> None:
        self._arm = world.arm
        self.density = density
        self.obstacles = (SmallestClearance(world),)

    @property
    def goal(self) -> Array:
        """Joint positions of the goal (nv,) [rad or m]."""
        return self._arm.angles(self.density.goal)

    def direction(self, x: Array) -> Array:
        """Act as `NavigationField.direction`; entries of at most 1e150."""
        gradient = np.zeros_like(x)
        rows = gradient.reshape(-1, x.shape[-1])
        for q, out in zip(_configurations(self._arm, x), rows, strict=True):
            self.density.update(q)
            self.density.write_gradient(Gauge.LOG, out)
        return gradient

    def height(self, x: Array) -> Array:
        """Act as `NavigationField.height`: ln ρ, as `NavigationDensity.log_value` has it."""
        values = []
        for q in _configurations(self._arm, x):
            self.density.update(q)
            values.append(self.density.log_value())
        return np.reshape(values, x.shape[:-1])


class SmallestClearance:
    """h(θ) = min d_k(q(θ)) [m] over pairs, an `ImplicitFunction` of joint positions θ."""

    def __init__(self, world: World) -> None:
        self._world = world

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        smallest = [self._world.distances(q).min() for q in _configurations(self._world.arm, x)]
        return np.reshape(smallest, x.shape[:-1])

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`; of either pair where two are as close."""
        samples = [self._world.clearance(q) for q in _configurations(self._world.arm, x)]
        gradients = [sample.gradient[sample.distance.argmin()] for sample in samples]
        return np.reshape(gradients, x.shape)


def _configurations(arm: Arm, x: Array) -> Array:
    return arm.configurations(x).reshape(-1, arm.nq)


_SMALLEST_FACTOR, _SMALLEST_GAP = 1e-12, 1e-9
