"""JointPotentialField: Khatib's artificial potential on the joint space of an arm."""

import numpy as np

from densarm.arrays import Array
from densarm.density.goal_distance import GoalDistance
from densarm.fields.barriers import Barriers
from densarm.validation import positive

_CONTACT = 1e-6  # [m or rad], h in contact


class JointPotentialField:
    r"""An attractive and repulsive potential.

    .. math::

        \phi(q) = -V(q) - \frac{\eta}{2} \sum_{h_k < h_0} \left(\frac{h_0}{h_k} - 1\right)^2

    Args:
        barriers: h_k.
        goal_distance: V, the attraction.
        pair_influence: h_0 > 0 of the pairs, below which they repel [m].
        limit_influence: h_0 > 0 of the joint limits [rad or m].
        repulsion: η > 0, dimensionless.

    Raises:
        InvalidValueError: a parameter ≤ 0.

    Source: O. Khatib, IJRR 5(1), 1986, with η h_0² in place of his η, which has a unit.
    """

    def __init__(
        self,
        barriers: Barriers,
        goal_distance: GoalDistance,
        pair_influence: float,
        limit_influence: float,
        repulsion: float = 0.01,
    ) -> None:
        self.barriers = barriers
        self.goal_distance = goal_distance
        self._influence = barriers.spread(
            positive("pair_influence", pair_influence), positive("limit_influence", limit_influence)
        )
        self._repulsion = positive("repulsion", repulsion)
        self._slope = np.zeros(barriers.clearance.arm.nv)

    def height(self, q: Array) -> float:
        """Return φ at q (nq,); hugely negative in contact."""
        excess = self._excess(q)[0]
        distance = self.goal_distance.evaluate(q, self._slope)
        return float(-distance - 0.5 * self._repulsion * (excess @ excess))

    def direction(self, q: Array) -> Array:
        """Return ∇φ at q (nq,), shape (nv,) [1/rad or 1/m]."""
        excess, h = self._excess(q)
        self.goal_distance.evaluate(q, self._slope)
        push = self._repulsion * excess * self._influence / h**2
        return np.asarray(push @ self.barriers.gradient - self._slope)

    def _excess(self, q: Array) -> tuple[Array, Array]:
        self.barriers.update(q)
        h = np.maximum(self.barriers.value, _CONTACT)
        return np.maximum(self._influence / h - 1.0, 0.0), h
