"""DensityField: the planning system as a velocity field, q̇ = k(q)."""

import numpy as np

from densarm.arrays import Array
from densarm.density.distance_bounds import DistanceBounds
from densarm.fields.guided_density import GuidedDensity
from densarm.fields.speed_law import SpeedLaw

_NEAR = 1e-3  # [rad], below which a sub-goal's pull fades


class DensityField:
    r"""The gradient of the guided density, no faster than the speed law allows.

    .. math::

        k(q) = \min\{1, s / \|p\|\} \, p, \qquad
        p = \lambda \frac{\ell}{\|q \ominus q_{sub}\|} \, G^{-1} \nabla\rho(q)

    The sub-goal q_sub pulls as from the end of the way ℓ that is left to the goal: else the speed
    would jump whenever the next sub-goal comes in sight. Towards the goal itself the factor is one.

    Args:
        guided: the density and its sub-goals; evaluating the field moves along them.
        speed_law: s.
        rate: λ [1/s], velocity per gradient.

    Source: [ZNV] eq. 11, the speed law in place of the saturation of eq. 14.
    """

    def __init__(self, guided: GuidedDensity, speed_law: SpeedLaw, rate: float) -> None:
        self.guided = guided
        self.speed_law = speed_law
        self._rate = rate
        self._gradient = np.zeros(guided.arm.nv)

    @property
    def distances(self) -> DistanceBounds:
        """As `VelocityField.distances`."""
        return self.guided.distances

    def restart(self) -> None:
        """Act as `GuidedDensity.restart`."""
        self.guided.restart()

    def update(self, q: Array, metric: Array | None = None) -> Array:
        """Return k(q) and move on along the sub-goals.

        Args:
            q: configuration (nq,).
            metric: G (nv, nv), positive definite; None for the identity.

        Returns:
            k (nv,) [rad/s or m/s]; zero at a critical point.
        """
        guided = self.guided
        guided.update(q)
        if guided.is_critical():
            return np.zeros_like(self._gradient)
        guided.write_gradient(q, self._gradient)
        to_sub_goal, beyond = guided.way_left(q)
        pull = 1.0 + beyond / max(to_sub_goal, _NEAR)
        velocity = self._rate * pull * self._gradient
        if metric is not None:
            velocity = np.asarray(np.linalg.solve(metric, velocity), dtype=np.float64)
        return self.speed_law.limit(q, velocity, self.distances, to_sub_goal + beyond)
