"""PotentialField: Khatib's artificial potential, a rival of the density."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.density.implicit_function import ImplicitFunction
from densarm.validation import finite_vector, positive


class PotentialField:
    r"""Descent of an attractive and repulsive potential.

    .. math::

        U(x) = \frac{\xi}{2} \|x - x_{goal}\|^2 + \frac{\eta}{2} \sum_{h_k < h_0}
        \left(\frac{1}{h_k(x)} - \frac{1}{h_0}\right)^2

    Args:
        obstacles: functions h_k, all in one unit.
        goal: shape (n,) [m].
        influence: h_0 > 0, value of h below which an obstacle repels, in its unit.
        attraction: ξ > 0 [1/s].
        repulsion: η > 0 [m²/s times the square of the unit of h].

    Raises:
        InvalidValueError: a goal that is not a vector of finite numbers, or a parameter ≤ 0.

    Source: O. Khatib, IJRR 5(1), 1986, with implicit functions as there in place of distances.
    """

    def __init__(
        self,
        obstacles: Sequence[ImplicitFunction],
        goal: ArrayLike,
        influence: float,
        attraction: float = 1.0,
        repulsion: float = 1.0,
    ) -> None:
        self.obstacles = tuple(obstacles)
        self.goal = finite_vector("goal", goal, np.size(goal))
        self.influence = positive("influence", influence)
        self.attraction = positive("attraction", attraction)
        self.repulsion = positive("repulsion", repulsion)

    def height(self, x: Array) -> Array:
        """Return −U at points `x` (..., n), of shape (...); hugely negative in contact."""
        total = -0.5 * self.attraction * np.sum((x - self.goal) ** 2, axis=-1)
        for h in self.obstacles:
            total -= 0.5 * self.repulsion * self._excess(h(x)) ** 2
        return total  # type: ignore[no-any-return]

    def direction(self, x: Array) -> Array:
        """Return −∇U at points `x` (..., n) [m/s]."""
        out = -self.attraction * (x - self.goal)
        for h in self.obstacles:
            value = np.maximum(h(x), _CONTACT)
            slope = self.repulsion * self._excess(value) / value**2
            out += slope[..., np.newaxis] * h.gradient(x)
        return out

    def _excess(self, h: Array) -> Array:
        return np.maximum(1.0 / np.maximum(h, _CONTACT) - 1.0 / self.influence, 0.0)


_CONTACT = 1e-9
