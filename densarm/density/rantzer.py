"""Rantzer's condition: the divergence of the flow that the density drives."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from densarm.density.critical_points import log_hessian
from densarm.density.navigation_density import Gauge, NavigationDensity
from densarm.values.arrays import Array


@dataclass(frozen=True)
class RantzerCondition:
    r"""The sign of ∇·(ρk) at configurations, for k the gradient in each gauge.

    With L = ln ρ it is the sign of

    .. math::

        \Delta L + 2\|\nabla L\|^2 \ \text{(density)}, \qquad
        \Delta L + \|\nabla L\|^2 \ \text{(log)}, \qquad
        \Delta L \ \text{(reciprocal)}.

    Source: A. Rantzer, Systems & Control Letters 42(3), 2001; [ZNV] appendix.
    """

    laplacian: Array
    """ΔL [1/rad² or 1/m²], shape (...); () of one configuration."""

    squared_gradient: Array
    """‖∇L‖² [1/rad² or 1/m²], of the same shape."""

    def margin(self, gauge: Gauge) -> Array:
        """Return ∇·(ρk) over its positive factor; not negative where the condition holds."""
        weight = {Gauge.DENSITY: 2.0, Gauge.LOG: 1.0, Gauge.RECIPROCAL: 0.0}[gauge]
        return self.laplacian + weight * self.squared_gradient

    def sign(self, gauge: Gauge) -> NDArray[np.intp]:
        """Return the sign of ∇·(ρk): −1, 0 or 1, of the shape of `laplacian`."""
        return np.sign(self.margin(gauge)).astype(np.intp)


def rantzer_condition(density: NavigationDensity, q: Array, step: float = 1e-5) -> RantzerCondition:
    r"""Record Rantzer's condition, the Laplacian by central differences of the gradient.

    .. math:: \Delta L \approx \sum_i \frac{\partial_i L(q \oplus \epsilon \mathbf{e}_i)
        - \partial_i L(q \ominus \epsilon \mathbf{e}_i)}{2\epsilon}

    Args:
        density: the density.
        q: configuration, shape (nq,), away from the goal and from contact.
        step: ε [rad or m].

    Returns:
        ΔL and ‖∇L‖², from which each gauge's sign follows.
    """
    gradient = density.evaluate(q).log_gradient
    hessian = log_hessian(partial(density.log_gradients, q), np.zeros_like(gradient), step)
    return RantzerCondition(np.asarray(np.trace(hessian)), np.asarray(gradient @ gradient))
