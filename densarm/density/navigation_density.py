"""Navigation density: one scalar field that vanishes on unsafe sets and peaks at the goal."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from densarm.arrays import Array
from densarm.density.gauge import Gauge
from densarm.density.gauge_gradient import gauge_exponents, write_gauge_gradient
from densarm.density.goal_distance import GoalDistance
from densarm.density.smooth_step import smooth_step
from densarm.density.unsafe_set import UnsafeSet
from densarm.validation import non_negative, one_of, positive

V = TypeVar("V", bound=GoalDistance)

LOG_MAX = math.log(sys.float_info.max)
"""Logarithm of the largest double."""


@dataclass(frozen=True)
class DensityParameters:
    """Parameters of a navigation density.

    Raises:
        InvalidValueError: a parameter out of its range.
    """

    alpha: float = 1.0
    """Exponent α > 0 of the goal distance, dimensionless."""

    theta: float = 0.0
    """Shift θ ≥ 0 of the inverse bumps, dimensionless; above 0 obstacles can be entered."""

    gauge: Gauge = Gauge.RECIPROCAL
    """The gauge of `DensitySample.blended_gradient`, or its name."""

    blend_radius: float = 0.0
    """δ ≥ 0 of [ZNV] Remark 2, rad or m in the norm of the goal error; 0 blends nothing."""

    def __post_init__(self) -> None:
        positive("alpha", self.alpha)
        non_negative("theta", self.theta)
        non_negative("blend_radius", self.blend_radius)
        object.__setattr__(self, "gauge", Gauge(one_of("gauge", self.gauge, list(Gauge))))


@dataclass(frozen=True)
class DensitySample:
    """A navigation density and its parts at one configuration."""

    log_psi: float
    """ln Ψ = Σ ln Ψ_k; −inf in contact for θ = 0."""

    log_psi_gradient: Array
    """∇ ln Ψ [1/rad or 1/m], shape (nv,)."""

    goal_distance: float
    """V."""

    goal_distance_gradient: Array
    """∇V [1/rad or 1/m], shape (nv,)."""

    goal_error: Array
    """e = q ⊖ q_goal [rad or m], shape (nv,)."""

    parameters: DensityParameters
    """Parameters of the density."""

    @property
    def log_value(self) -> float:
        """L = ln Ψ − α ln V: −inf in contact for θ = 0, else +inf at the goal."""
        if self.goal_distance == 0.0:
            return -math.inf if self.log_psi == -math.inf else math.inf
        return self.log_psi - self.parameters.alpha * math.log(self.goal_distance)

    @property
    def value(self) -> float:
        """ρ = Ψ/V^α, infinite where it exceeds the doubles. Source: [ZNV] eq. 4."""
        return math.exp(self.log_value) if self.log_value <= LOG_MAX else math.inf

    @property
    def log_gradient(self) -> Array:
        """∇L, shape (nv,), as `gradient` has it."""
        return self.gradient(Gauge.LOG)

    def gradient(self, gauge: Gauge) -> Array:
        r"""Return the gradient of the density in a gauge.

        .. math::

            w = V \nabla\ln\Psi - \alpha \nabla V, \qquad
            \nabla\rho = \frac{\Psi}{V^{\alpha+1}} w, \quad
            \nabla\ln\rho = \frac{1}{V} w, \quad
            \nabla(-1/\rho) = \frac{V^{\alpha-1}}{\Psi} w

        All three are positive multiples of w: zero where w is, the goal included, and scaled
        down to entries of at most 1e150 where they are longer.

        Args:
            gauge: which of the three.

        Returns:
            Tangent-space gradient [1/rad or 1/m, in the unit of the gauge's function], (nv,).

        Source: [ZNV] eq. 11.
        """
        out = np.empty_like(self.goal_distance_gradient)
        write_gauge_gradient(
            self.log_psi_gradient,
            self.goal_distance,
            self.goal_distance_gradient,
            self.parameters.alpha,
            self.log_psi,
            *gauge_exponents(gauge, self.parameters.alpha),
            out,
        )
        return out

    def blended_gradient(self) -> Array:
        r"""Return the gradient in the density's own gauge, made linear near the goal.

        .. math:: (1 - \bar f(\tau)) \nabla\rho - \bar f(\tau) e, \qquad \tau = 2 - \|e\|/\delta

        [ZNV] leaves τ open; this one is the linear feedback −e inside the ball of radius δ and
        the gradient alone outside that of radius 2δ. With δ = 0 it is the gradient everywhere.

        Returns:
            Tangent-space direction, shape (nv,).

        Source: [ZNV] Remark 2.
        """
        gradient = self.gradient(self.parameters.gauge)
        if self.parameters.blend_radius == 0.0:
            return gradient
        distance = np.linalg.norm(self.goal_error)
        share = smooth_step(2.0 - distance / self.parameters.blend_radius)
        return (1.0 - share) * gradient - share * self.goal_error


class NavigationDensity(Generic[V]):
    r"""The density of where an arm may spend its time.

    .. math:: \rho(q) = \frac{\prod_k \Psi_k(q)}{V(q)^\alpha}

    Args:
        unsafe_sets: families of unsafe sets, whose inverse bumps are multiplied.
        goal_distance: V, whose goal may be moved at any time.
        parameters: α, θ, gauge and blend.

    Attributes:
        log_psi: ln Ψ after `update`.
        log_psi_gradient: ∇ ln Ψ [1/rad or 1/m], shape (nv,), overwritten by `update`.
        goal_distance_value: V after `update`.
        goal_distance_gradient: ∇V [1/rad or 1/m], shape (nv,), overwritten by `update`.

    Source: [ZNV] eq. 4.
    """

    def __init__(
        self,
        unsafe_sets: Sequence[UnsafeSet],
        goal_distance: V,
        parameters: DensityParameters = DensityParameters(),
    ) -> None:
        self.unsafe_sets = tuple(unsafe_sets)
        self.goal_distance = goal_distance
        self.parameters = parameters
        self._exponents = {gauge: gauge_exponents(gauge, parameters.alpha) for gauge in Gauge}
        self.log_psi = 0.0
        self.log_psi_gradient: Array = np.zeros_like(goal_distance.error(goal_distance.goal))
        self.goal_distance_value = 0.0
        self.goal_distance_gradient: Array = np.zeros_like(self.log_psi_gradient)

    def update(self, q: Array) -> None:
        """Evaluate the parts of ρ at `q`, shape (nq,), into the attributes, in place."""
        self.update_psi(q)
        self.goal_distance_value = self.goal_distance.evaluate(q, self.goal_distance_gradient)

    def update_psi(self, q: Array) -> None:
        """As `update`, but leave V and its gradient as they are."""
        gradient, theta, log_psi = self.log_psi_gradient, self.parameters.theta, 0.0
        gradient.fill(0.0)
        for unsafe_set in self.unsafe_sets:
            log_psi += unsafe_set.add_log_bump(q, theta, gradient)
        self.log_psi = log_psi

    def write_gradient(self, gauge: Gauge, out: Array) -> None:
        """Write `DensitySample.gradient` at the last `update` into `out`, shape (nv,)."""
        write_gauge_gradient(
            self.log_psi_gradient,
            self.goal_distance_value,
            self.goal_distance_gradient,
            self.parameters.alpha,
            self.log_psi,
            *self._exponents[gauge],
            out,
        )

    def evaluate(self, q: Array) -> DensitySample:
        """Return the density and its parts at `q`, shape (nq,)."""
        self.update(q)
        return DensitySample(
            self.log_psi,
            self.log_psi_gradient.copy(),
            self.goal_distance_value,
            self.goal_distance_gradient.copy(),
            self.goal_distance.error(q),
            self.parameters,
        )
