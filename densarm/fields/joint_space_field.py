"""JointSpaceField: the planning system of an arm in joint positions, for many starts at once."""

import numpy as np

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.clearance import Clearance
from densarm.density.gauge import Gauge
from densarm.density.goal_distance import GoalDistance
from densarm.density.navigation_density import NavigationDensity


class JointSpaceField:
    r"""The direction of ∇ρ over joint positions θ, a `NavigationField`.

    .. math:: k(\theta) = \nabla \ln \rho(q(\theta))

    Joint positions of continuous joints count turns: k is periodic in them, the goal is one of
    its images.

    Args:
        arm: the arm.
        density: ρ.
        clearance: signed distances of the pairs, at least one, that tell a collision.
        margin: distance below which they do [m].
    """

    def __init__(
        self,
        arm: Arm,
        density: NavigationDensity[GoalDistance],
        clearance: Clearance,
        margin: float = 0.0,
    ) -> None:
        self._arm = arm
        self.density = density
        self.obstacles = (SmallestClearance(clearance, margin),)

    @property
    def goal(self) -> Array:
        """Joint positions of the goal (nv,) [rad or m]."""
        return self._arm.angles(self.density.goal_distance.goal)

    def direction(self, x: Array) -> Array:
        """Act as `NavigationField.direction`; entries of at most 1e150."""
        gradient = np.zeros_like(x)
        for q, out in zip(self._configurations(x), gradient.reshape(-1, x.shape[-1]), strict=True):
            self.density.update(q)
            self.density.write_gradient(Gauge.LOG, out)
        return gradient

    def height(self, x: Array) -> Array:
        """Act as `NavigationField.height`: ln ρ, as `DensitySample.log_value` has it."""
        values = [self.density.evaluate(q).log_value for q in self._configurations(x)]
        return np.reshape(values, x.shape[:-1])

    def _configurations(self, x: Array) -> Array:
        return self._arm.configurations(x.reshape(-1, x.shape[-1]))


class SmallestClearance:
    r"""The clearance of the closest pair, an `ImplicitFunction` of joint positions θ [m].

    .. math:: h(\theta) = \min_k d_k(q(\theta)) - m

    Args:
        clearance: signed distances d_k of the pairs, at least one.
        margin: m [m].
    """

    def __init__(self, clearance: Clearance, margin: float = 0.0) -> None:
        self._clearance = clearance
        self._margin = margin

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        configurations = self._clearance.arm.configurations(x.reshape(-1, x.shape[-1]))
        smallest = [self._clearance.distances(q).min() for q in configurations]
        return np.reshape(smallest, x.shape[:-1]) - self._margin

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`; of either pair where two are as close."""
        gradient = np.zeros_like(x)
        configurations = self._clearance.arm.configurations(x.reshape(-1, x.shape[-1]))
        for q, out in zip(configurations, gradient.reshape(-1, x.shape[-1]), strict=True):
            self._clearance.update(q)
            out[:] = self._clearance.gradient[self._clearance.distance.argmin()]
        return gradient
