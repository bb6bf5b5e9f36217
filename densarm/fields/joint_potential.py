"""JointPotential, and the planning system that climbs one."""

from typing import Protocol

import numpy as np

from densarm.arrays import Array
from densarm.density.distance_bounds import DistanceBounds, ExactDistances
from densarm.density.goal_distance import GoalDistance
from densarm.fields.barriers import Barriers
from densarm.fields.speed_law import SpeedLaw


class JointPotential(Protocol):
    """A function on the joint space of an arm whose ascent should lead to the goal."""

    @property
    def barriers(self) -> Barriers:
        """The functions h_k, at the configuration that was evaluated last."""
        ...

    @property
    def goal_distance(self) -> GoalDistance:
        """V."""
        ...

    def height(self, q: Array) -> float:
        """Return the function at q (nq,)."""
        ...

    def direction(self, q: Array) -> Array:
        """Return a positive multiple of the gradient at q (nq,), shape (nv,), −∇V in the open."""
        ...


class PotentialAscent:
    r"""The planning system that climbs a potential, no faster than the speed law allows.

    .. math:: k(q) = \lambda u \min\{1, s / \|\lambda u\|\}, \qquad u \parallel \nabla \phi(q)

    Args:
        potential: φ.
        speed_law: s.
        rate: λ [1/s], velocity per direction.
    """

    def __init__(self, potential: JointPotential, speed_law: SpeedLaw, rate: float) -> None:
        self.potential = potential
        self.speed_law = speed_law
        self._rate = rate

    @property
    def distances(self) -> DistanceBounds:
        """As `VelocityField.distances`."""
        return ExactDistances(self.potential.barriers.clearance.distance)

    def restart(self) -> None:
        """Act as `VelocityField.restart`, with nothing to forget."""

    def update(self, q: Array) -> Array:
        """Act as `VelocityField.update`."""
        velocity = self._rate * self.potential.direction(q)
        way_left = float(np.linalg.norm(self.potential.goal_distance.error(q)))
        return self.speed_law.limit(q, velocity, self.distances, way_left)
