"""NavigationFunction: the field of Rimon and Koditschek, a rival of the density."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.density.gauge_gradient import V_MIN
from densarm.density.implicit_function import ImplicitFunction
from densarm.validation import finite_vector, positive


class NavigationFunction:
    r"""Descent of a navigation function in a bounded world.

    .. math::

        \psi(x) = \frac{\gamma}{\gamma + \beta^{1/\kappa}}, \qquad
        \gamma = \|x - x_{goal}\|^2, \quad \beta = \prod_k h_k(x)

    Its gradient runs along that of ln(β)/κ − ln γ, which neither over- nor underflows:

    .. math:: -\nabla\psi = \psi (1 - \psi) \left(\frac{1}{\kappa} \nabla\ln\beta
        - \nabla\ln\gamma\right)

    Args:
        obstacles: functions h_k, the bound of the world among them: ``Complement(Ball(radius))``.
        goal: shape (n,) [m].
        kappa: κ > 0, dimensionless.

    Raises:
        InvalidValueError: a goal that is not a vector of finite numbers, or κ ≤ 0.

    Source: [ZNV] section IV-C; E. Rimon, D. E. Koditschek, IEEE T-RA 8(5), 1992, whose
    γ/(γ^κ + β)^{1/κ} is the same function of β/γ^κ up to a monotone map, hence the same curves.
    """

    def __init__(
        self, obstacles: Sequence[ImplicitFunction], goal: ArrayLike, kappa: float
    ) -> None:
        self.obstacles = tuple(obstacles)
        self.goal = finite_vector("goal", goal, np.size(goal))
        self.kappa = positive("kappa", kappa)

    def value(self, x: Array) -> Array:
        """Return ψ = 1/(1 + exp height) at points `x` (..., n), of shape (...); 1 in contact."""
        return np.exp(-np.logaddexp(0.0, self.height(x)))

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
            value = np.maximum(h(x), _CONTACT)[..., np.newaxis]
            log_beta_gradient += h.gradient(x) / value
        return gamma / self.kappa * log_beta_gradient - 2.0 * error  # type: ignore[no-any-return]


_CONTACT = 1e-12
