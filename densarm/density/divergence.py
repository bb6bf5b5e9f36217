"""Rantzer's condition: the divergence of the flow that the density drives."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.gauge import Gauge
from densarm.density.navigation_density import NavigationDensity


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


def rantzer_condition(
    density: NavigationDensity[Any],
    q: Array,
    integrate: Callable[[Array, Array], Array],
    step: float = 1e-5,
) -> RantzerCondition:
    r"""Record Rantzer's condition, the Laplacian by central differences of the gradient.

    .. math:: \Delta L \approx \sum_i \frac{\partial_i L(q \oplus \epsilon \mathbf{e}_i)
        - \partial_i L(q \ominus \epsilon \mathbf{e}_i)}{2\epsilon}

    Args:
        density: the density.
        q: configuration, shape (nq,), away from the goal and from contact.
        integrate: q, tangent vector of shape (nv,) ↦ q ⊕ v, as `Arm.integrate`.
        step: ε [rad or m].

    Returns:
        ΔL and ‖∇L‖², from which each gauge's sign follows.
    """
    gradient = density.evaluate(q).log_gradient
    laplacian = np.zeros(())
    for i, axis in enumerate(step * np.eye(gradient.size)):
        ahead = density.evaluate(integrate(q, axis)).log_gradient[i]
        behind = density.evaluate(integrate(q, -axis)).log_gradient[i]
        laplacian += (ahead - behind) / (2.0 * step)
    return RantzerCondition(laplacian, np.asarray(gradient @ gradient))


def rantzer_map(density: EuclideanDensity, x: Array, step: float = 1e-5) -> RantzerCondition:
    r"""Record Rantzer's condition at many points of Rⁿ, V in closed form.

    .. math:: \Delta L = \Delta \ln\Psi - \frac{2 \alpha (n - 2)}{\|x - x_{goal}\|^2}

    ΔlnΨ is by central differences of the gradient, and exactly zero out of sensing regions.

    Args:
        density: the density.
        x: points (..., n) [m], away from the goal and from contact.
        step: ε of the differences [m].

    Returns:
        ΔL and ‖∇L‖², each of shape (...).
    """
    n = x.shape[-1]
    laplacian = -2.0 * density.parameters.alpha * (n - 2) / np.sum((x - density.goal) ** 2, axis=-1)
    for i, axis in enumerate(step * np.eye(n)):
        ahead, behind = (density.log_psi_gradient(x + sign * axis) for sign in (1.0, -1.0))
        laplacian = laplacian + (ahead - behind)[..., i] / (2.0 * step)
    return RantzerCondition(laplacian, np.sum(density.gradient(x, Gauge.LOG) ** 2, axis=-1))
