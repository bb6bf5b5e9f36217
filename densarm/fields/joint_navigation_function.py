"""JointNavigationFunction: Rimon and Koditschek's function on the joint space of an arm."""

import math

import numpy as np

from densarm.arrays import Array
from densarm.density.gauge_gradient import V_MIN
from densarm.density.goal_distance import GoalDistance
from densarm.fields.barriers import Barriers
from densarm.validation import positive

_CONTACT = 1e-12  # [m or rad], h in contact


class JointNavigationFunction:
    r"""A navigation function of the clearances of an arm, by logarithms.

    .. math::

        \psi = \frac{V}{(V^\kappa + \beta)^{1/\kappa}}, \quad \beta = \prod_k h_k, \qquad
        \phi = \frac{1}{\kappa} \ln\beta - \ln V

    ψ falls where φ grows, and φ neither over- nor underflows. It is a navigation function, with
    no maximum but the goal, on sphere worlds for κ large enough; the free joint space of an arm
    is none.

    Args:
        barriers: h_k, joint limits included, all of them in the product wherever the arm is.
        goal_distance: V.
        kappa: κ > 0, dimensionless.

    Raises:
        InvalidValueError: κ ≤ 0.

    Source: E. Rimon, D. E. Koditschek, IEEE T-RA 8(5), 1992.
    """

    def __init__(
        self, barriers: Barriers, goal_distance: GoalDistance, kappa: float = 100.0
    ) -> None:
        self.barriers = barriers
        self.goal_distance = goal_distance
        self.kappa = positive("kappa", kappa)
        self._slope = np.zeros(barriers.clearance.arm.nv)

    def height(self, q: Array) -> float:
        """Return φ at q (nq,); −∞ in contact."""
        self.barriers.update(q)
        h = self.barriers.value
        if h.min(initial=np.inf) <= 0.0:
            return -math.inf
        distance = self.goal_distance.evaluate(q, self._slope)
        return float(np.log(h).sum() / self.kappa - math.log(max(distance, V_MIN)))

    def direction(self, q: Array) -> Array:
        """Return V ∇φ at q (nq,), shape (nv,) [1/rad or 1/m]; zero at the goal."""
        self.barriers.update(q)
        distance = self.goal_distance.evaluate(q, self._slope)
        push = distance / self.kappa / np.maximum(self.barriers.value, _CONTACT)
        return np.asarray(push @ self.barriers.gradient - self._slope)
