"""Rantzer's condition: the divergence of the flow that the density drives."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from densarm.arrays import Array
from densarm.density.gauge import Gauge
from densarm.density.navigation_density import NavigationDensity


@dataclass(frozen=True)
class RantzerCondition:
    r"""The sign of ∇·(ρk) at one configuration, for k the gradient in each gauge.

    With L = ln ρ it is the sign of

    .. math::

        \Delta L + 2\|\nabla L\|^2 \ \text{(density)}, \qquad
        \Delta L + \|\nabla L\|^2 \ \text{(log)}, \qquad
        \Delta L \ \text{(reciprocal)}.

    Source: A. Rantzer, Systems & Control Letters 42(3), 2001; [ZNV] appendix.
    """

    laplacian: float
    """ΔL [1/rad² or 1/m²]."""

    squared_gradient: float
    """‖∇L‖² [1/rad² or 1/m²]."""

    def margin(self, gauge: Gauge) -> float:
        """Return ∇·(ρk) over its positive factor; not negative where the condition holds."""
        weight = {Gauge.DENSITY: 2.0, Gauge.LOG: 1.0, Gauge.RECIPROCAL: 0.0}[gauge]
        return self.laplacian + weight * self.squared_gradient

    def sign(self, gauge: Gauge) -> int:
        """Return the sign of ∇·(ρk): −1, 0 or 1."""
        return int(np.sign(self.margin(gauge)))


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
    laplacian = 0.0
    for i, axis in enumerate(step * np.eye(gradient.size)):
        ahead = density.evaluate(integrate(q, axis)).log_gradient[i]
        behind = density.evaluate(integrate(q, -axis)).log_gradient[i]
        laplacian += (ahead - behind) / (2.0 * step)
    return RantzerCondition(float(laplacian), float(gradient @ gradient))
