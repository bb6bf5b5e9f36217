"""EuclideanDensity: the navigation density on Rⁿ, evaluated at many points at once."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.density.gauge import Gauge
from densarm.density.gauge_gradient import V_MIN, gauge_exponents, write_gauge_gradient
from densarm.density.implicit_function import ImplicitFunction, UnsafeRegion
from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.navigation_density import DensityParameters
from densarm.density.smooth_step import smooth_step
from densarm.validation import finite_vector

_DEFAULTS = DensityParameters()


class EuclideanDensity:
    r"""The density of where a point of Rⁿ may spend its time.

    .. math:: \rho(x) = \frac{\prod_k \Psi_k(x)}{\|x - x_{goal}\|^{2 \alpha}}

    At one point it agrees with `NavigationDensity` of `ImplicitSet`s and `EuclideanDistance`.

    Args:
        unsafe: unsafe sets, each with its sensing region.
        goal: shape (n,) [m].
        parameters: α, θ, gauge and blend.

    Raises:
        InvalidValueError: a goal that is not a vector of finite numbers.

    Source: [ZNV] eq. 4, with V of section III.
    """

    def __init__(
        self,
        unsafe: Sequence[UnsafeRegion],
        goal: ArrayLike,
        parameters: DensityParameters = _DEFAULTS,
    ) -> None:
        self.unsafe = tuple(unsafe)
        self.goal = finite_vector("goal", goal, np.size(goal))
        self.parameters = parameters

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
        distance = np.maximum(np.sum((x - self.goal) ** 2, axis=-1), V_MIN)
        return self.log_psi(x) - self.parameters.alpha * np.log(distance)  # type: ignore[no-any-return]

    def height(self, x: Array) -> Array:
        """Return ln ρ, which `direction` climbs, as `log_value` has it."""
        return self.log_value(x)

    def gradient(self, x: Array, gauge: Gauge) -> Array:
        """Return the gradient in a gauge at points `x` (..., n), as `DensitySample.gradient`."""
        rows = _rows(x)
        log_psi, log_psi_gradient = self._log_bumps(rows)
        error = rows - self.goal
        alpha = self.parameters.alpha
        out = np.empty_like(rows)
        exponents = gauge_exponents(gauge, alpha)
        _write_gradients(log_psi_gradient, error, alpha, log_psi, *exponents, out)
        return out.reshape(x.shape)

    def direction(self, x: Array) -> Array:
        """Return the gradient in the density's own gauge, blended by [ZNV] Remark 2.

        Args:
            x: points (..., n) [m].

        Returns:
            As `DensitySample.blended_gradient` has it, (..., n).
        """
        gradient = self.gradient(x, self.parameters.gauge)
        radius = self.parameters.blend_radius
        if radius == 0.0:
            return gradient
        error = x - self.goal
        share = smooth_step(2.0 - np.linalg.norm(error, axis=-1, keepdims=True) / radius)
        return (1.0 - share) * gradient - share * error

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
    error: Array,
    alpha: float,
    log_psi: Array,
    distance_exponent: float,
    psi_exponent: float,
    out: Array,
) -> None:
    for row in range(out.shape[0]):
        write_gauge_gradient(
            log_psi_gradient[row],
            float(np.sum(error[row] ** 2)),
            2.0 * error[row],
            alpha,
            log_psi[row],
            distance_exponent,
            psi_exponent,
            out[row],
        )
