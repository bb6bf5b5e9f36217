"""DensityField: the planning system as a velocity field, q̇ = k(q)."""

import numpy as np

from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.fields.guided_density import GuidedDensity
from densarm.fields.speed_law import SpeedLaw


class DensityField:
    r"""The gradient of the guided density, no faster than the speed law allows.

    .. math::

        k(q) = \lambda \min\{1, s / \|\lambda G^{-1} \nabla\rho\|\} \, G^{-1} \nabla\rho(q)

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
        self._gradient = np.zeros(guided.clearance.arm.nv)

    @property
    def clearance(self) -> Clearance:
        """As `VelocityField.clearance`."""
        return self.guided.clearance

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
        velocity = self._rate * self._gradient
        if metric is not None:
            velocity = np.asarray(np.linalg.solve(metric, velocity), dtype=np.float64)
        return self.speed_law.limit(q, velocity, self.clearance.distance, guided.way_left(q))
