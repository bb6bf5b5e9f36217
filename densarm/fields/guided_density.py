"""GuidedDensity: the navigation density towards the current sub-goal of a chain."""

import numpy as np

from densarm.arrays import Array
from densarm.density import (
    DensityParameters,
    Gauge,
    GoalDistance,
    JointLimitSet,
    NavigationDensity,
    NearClearanceSet,
    NearPairs,
)
from densarm.density.distance_bounds import DistanceBounds
from densarm.fields.stall import find_stall
from densarm.fields.sub_goal_chain import SubGoalChain
from densarm.proof.swept_bound import SweptBound

CRITICAL_SLOPE = 1e-9
"""‖∇ ln ρ‖ [1/rad] at and below which a point counts as critical."""


class GuidedDensity:
    """The density whose goal is the current sub-goal, and whose sensing regions fit the way to it.

    Args:
        bound: distances to the obstacles and of the arm to itself, and the safety margin.
        chain: the sub-goals.
        parameters: of the density.
        goal_distance: V, whose goal is moved along the sub-goals.

    Source: [ZNV] Remark 1, which lets the goal distance adapt to the space.
    """

    def __init__(
        self,
        bound: SweptBound,
        chain: SubGoalChain,
        parameters: DensityParameters,
        goal_distance: GoalDistance,
    ) -> None:
        self.arm = arm = bound.arm
        self.chain = chain
        self._clearance = bound.clearance
        self._version = bound.clearance.version
        self._log_gradient = np.zeros(arm.nv)
        pairs = NearPairs(bound)
        self.distances: DistanceBounds = pairs
        """Distances of all pairs at the last update."""
        self._clearance_set = NearClearanceSet(pairs, bound.margin, chain.sensing_distance[1])
        self.goal_distance = goal_distance
        self.density = NavigationDensity(
            [self._clearance_set, JointLimitSet(arm, chain.joint_sensing_distance)],
            self.goal_distance,
            parameters,
        )
        self._point_at_sub_goal()

    def restart(self) -> None:
        """Return to the first sub-goal."""
        self.chain.current = 1
        self._point_at_sub_goal()

    def update(self, q: Array) -> None:
        """Move on to the farthest sub-goal in sight of q (nq,) and evaluate its density there.

        Raises:
            SceneChangedError: obstacles have changed since the sub-goals were proved.
        """
        self._clearance.require_version(self._version)
        self.density.update(q)
        if self.chain.advance(q, self.distances):
            self._point_at_sub_goal()
            self.density.update(q)

    def sub_goal_in_sight(self, q: Array) -> Array | None:
        """Return the sub-goal (nq,) if Ψ = 1 on the segment to it from q (nq,), which was updated.

        There ρ depends on V alone, and grows along the segment.
        """
        chain = self.chain
        if self.density.log_psi < 0.0 or not chain.is_in_sight(chain.current, q, self.distances):
            return None
        return np.asarray(chain.q[chain.current])

    def write_gradient(self, q: Array, out: Array) -> None:
        """Write ∇ρ (nv,) in the density's own gauge and blend into `out`; q (nq,) was updated."""
        if self.density.parameters.blend_radius > 0.0:
            out[:] = self.density.evaluate(q).blended_gradient()
        else:
            self.density.write_gradient(self.density.parameters.gauge, out)

    def slope(self) -> float:
        """Return ‖∇ ln ρ‖ at the last update [1/rad]."""
        self.density.write_gradient(Gauge.LOG, self._log_gradient)
        return float(np.sqrt(self._log_gradient @ self._log_gradient))

    def is_critical(self) -> bool:
        """Return whether the last update was at a critical point of ρ, the sub-goal included."""
        return not self.slope() > CRITICAL_SLOPE

    def way_left(self, q: Array) -> tuple[float, float]:
        """Return the lengths from q (nq,) to the sub-goal, and from there to the goal [rad]."""
        to_sub_goal = float(np.linalg.norm(self.goal_distance.error(q)))
        return to_sub_goal, float(self.chain.remaining[self.chain.current])

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the density leads nowhere from q (nq,), and what blocks it."""
        limits = self.chain.joint_sensing_distance
        return find_stall(self.density, self._clearance_set, limits, q).description

    def _point_at_sub_goal(self) -> None:
        current = self.chain.current
        self.goal_distance.set_goal(self.chain.q[current])
        self._clearance_set.sensing_distance[:] = self.chain.sensing_distance[current]
