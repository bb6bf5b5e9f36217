"""EuclideanDensity: the navigation density on Rⁿ, evaluated at many points at once."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.navigation_density import (
    V_MIN,
    DensityParameters,
    Gauge,
    blended,
    gauge_exponents,
    write_gauge_gradient,
)
from densarm.density.rantzer import RantzerCondition
from densarm.euclidean.implicit import ImplicitFunction, UnsafeRegion
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive_tuple
from densarm.values.kernels import compiled

_DEFAULTS = DensityParameters()


class EuclideanDensity:
    r"""The density of where a point of Rⁿ may spend its time.

    .. math:: \rho(x) = \frac{\prod_k \Psi_k(x)}{V(x)^\alpha}, \qquad
        V(x) = \sum_i w_i (x_i - x_{goal,i})^2

    At one point and with weights of one it agrees with `NavigationDensity` of `ImplicitSet`s and
    `EuclideanDistance`.

    Args:
        unsafe: unsafe sets, each with its sensing region.
        goal: shape (n,) [m].
        parameters: α, θ, gauge and blend.
        weights: w_i > 0, dimensionless, shape (n,); ones, the V of [ZNV], by default.

    Raises:
        InvalidValueError: a goal that is not finite, or weights that are not n positive numbers.

    Source: [ZNV] eq. 4, with V of section III, adapted as Remark 1 allows.
    """

    def __init__(
        self,
        unsafe: Sequence[UnsafeRegion],
        goal: ArrayLike,
        parameters: DensityParameters = _DEFAULTS,
        weights: ArrayLike | None = None,
    ) -> None:
        self.unsafe = tuple(unsafe)
        self.goal = finite_vector("goal", goal, np.size(goal))
        self.parameters = parameters
        n = self.goal.size
        self.weights = np.array(
            positive_tuple("weights", np.ones(n) if weights is None else weights, n)
        )

    @property
    def obstacles(self) -> tuple[ImplicitFunction, ...]:
        """Functions h_k of the unsafe sets."""
        return tuple(region.h for region in self.unsafe)

    def log_psi(self, x: Array) -> Array:
        """Return ln Ψ = Σ ln Ψ_k at points `x` (..., n): (...), −inf in contact for θ = 0."""
        return self._log_bumps(_rows(x))[0].reshape(x.shape[:-1])

    def log_psi_gradient(self, x: Array) -> Array:
        """Return ∇ ln Ψ [1/m] at points `x` (..., n): (..., n), zero out of sensing regions."""
        return self._log_bumps(_rows(x))[1].reshape(x.shape)

    def log_value(self, x: Array) -> Array:
        """Return ln ρ at points `x` (..., n): (...), −inf in contact for θ = 0."""
        distance = np.maximum((x - self.goal) ** 2 @ self.weights, V_MIN)
        return self.log_psi(x) - self.parameters.alpha * np.log(distance)  # type: ignore[no-any-return]

    height = log_value  # which `direction` climbs

    def gradient(self, x: Array, gauge: Gauge) -> Array:
        """Return the gradient in a gauge at points `x` (..., n), as `DensitySample.gradient`."""
        rows = _rows(x)
        log_psi, log_psi_gradient = self._log_bumps(rows)
        error = rows - self.goal
        alpha = self.parameters.alpha
        out = np.empty_like(rows)
        distance, exponents = error**2 @ self.weights, gauge_exponents(gauge, alpha)
        slope = 2.0 * error * self.weights
        _write_gradients(log_psi_gradient, distance, slope, alpha, log_psi, *exponents, out)
        return out.reshape(x.shape)

    def direction(self, x: Array) -> Array:
        """Return `DensitySample.blended_gradient` at points `x` (..., n): (..., n)."""
        gradient = self.gradient(x, self.parameters.gauge)
        return blended(gradient, x - self.goal, self.parameters.blend_radius)

    def _log_bumps(self, rows: Array) -> tuple[Array, Array]:
        """Return Σ ln Ψ_k (N,) and its gradient (N, n) at points (N, n)."""
        total, gradient = np.zeros(len(rows)), np.zeros_like(rows)
        for region in self.unsafe:
            h, s = region.h(rows), region.s(rows)
            sensed = np.flatnonzero((h <= 0.0) | (s < 0.0))
            near = rows[sensed]
            total += np.log1p(self.parameters.theta)
            _add_log_bumps(
                sensed,
                h[sensed],
                s[sensed],
                region.h.gradient(near),
                region.s.gradient(near),
                self.parameters.theta,
                total,
                gradient,
            )
        return total, gradient


def rantzer_map(density: EuclideanDensity, x: Array, step: float = 1e-5) -> RantzerCondition:
    """Return ΔL = Δ ln Ψ − α Δ ln V and ‖∇L‖² at points (..., n) [m].

    Δ ln V = 2 Σ w_i/V − 4 Σ (w_i e_i)²/V², which is 2(n − 2)/‖e‖² for weights of one. Δ ln Ψ is by
    central differences of a step [m], and exactly zero out of sensing regions.
    """
    weights, square = density.weights, (x - density.goal) ** 2
    distance = square @ weights
    log_distance = (2.0 * weights.sum() - 4.0 * (square @ weights**2) / distance) / distance
    laplacian = -density.parameters.alpha * log_distance
    for i, axis in enumerate(step * np.eye(x.shape[-1])):
        ahead, behind = (density.log_psi_gradient(x + sign * axis) for sign in (1.0, -1.0))
        laplacian = laplacian + (ahead - behind)[..., i] / (2.0 * step)
    return RantzerCondition(laplacian, np.sum(density.gradient(x, Gauge.LOG) ** 2, axis=-1))


def _rows(x: Array) -> Array:
    """Return points (..., n) as (N, n), each coordinate contiguous: what numpy is fast on."""
    return np.asfortranarray(x.reshape(-1, x.shape[-1]), np.float64)


@compiled
def _add_log_bumps(
    sensed: NDArray[np.intp],
    h: Array,
    s: Array,
    h_gradient: Array,
    s_gradient: Array,
    theta: float,
    total: Array,
    gradient: Array,
) -> None:
    for member in range(h.shape[0]):
        row = sensed[member]
        # Inside the unsafe set Ψ = θ even where the sensing region does not cover it.
        width = abs(h[member] - s[member]) if h[member] <= 0.0 else h[member] - s[member]
        value, slope = log_inverse_bump(h[member], width, theta)
        total[row] += value - math.log1p(theta)
        t = max(h[member] / width, 0.0)
        for i in range(gradient.shape[1]):
            change = h_gradient[member, i] - s_gradient[member, i]
            gradient[row, i] += slope * (h_gradient[member, i] - t * change)


@compiled
def _write_gradients(
    log_psi_gradient: Array,
    distance: Array,
    slope: Array,
    alpha: float,
    log_psi: Array,
    distance_exponent: float,
    psi_exponent: float,
    out: Array,
) -> None:
    for row in range(out.shape[0]):
        write_gauge_gradient(
            log_psi_gradient[row],
            distance[row],
            slope[row],
            alpha,
            log_psi[row],
            distance_exponent,
            psi_exponent,
            out[row],
        )
