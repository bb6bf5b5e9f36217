"""DensityGuide: sub-goals along integral curves of the density, by way of via points."""

from dataclasses import replace

import numpy as np

from densarm.density.goal_distance import GoalDistance
from densarm.density.navigation_density import DensityParameters
from densarm.density.sub_goals import GuidedDensity, GuidePath, SubGoals
from densarm.density.unsafe_sets import SensingParameters
from densarm.planning.guide import FreeSpace, NoPath, PlanningParameters
from densarm.planning.integral_curve import IntegralCurve, PlanningSystem
from densarm.planning.sampling import Bounds, SamplingBounds
from densarm.planning.shortening import shortened
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck

ALONE, BY_VIA_POINT = "the density alone", "the density by way of a via point"
"""What `GuidePath.found_by` says of the two ways that `DensityGuide` finds."""

_DRAWN = 100  # configurations at most until one is clear


class Legs:
    """Integral curves of the density between configurations that nobody joined before.

    Args:
        check: the world and the safety margin.
        goal_distance: V.
        density: θ, α and gauge.
        sensing: sensing distances.
    """

    def __init__(
        self,
        check: SweptCheck,
        goal_distance: GoalDistance,
        density: DensityParameters,
        sensing: SensingParameters,
    ) -> None:
        self.check = check
        self._goal_distance = goal_distance
        self._density = density
        self._sensing = sensing
        self._system: PlanningSystem | None = None

    def curve(self, path: GuidePath) -> IntegralCurve:
        """Return the curve from the first waypoint of a path towards the others in turn."""
        sub_goals = SubGoals(self.check, path, self._sensing)
        system = self._system
        if system is None:
            guided = GuidedDensity(self.check, sub_goals, self._goal_distance, self._density)
            system = self._system = PlanningSystem(guided, self.check.margin)
        system.guided.lead_along(sub_goals)
        return system.curve(path.waypoints[0])

    def curve_from_either_end(self, path: GuidePath) -> IntegralCurve:
        """As `curve`, or where that gets stuck the one from the last waypoint, gone backwards.

        A goal lies in narrow space more often than a start, and leaving is easier than entering.
        """
        curve = self.curve(path)
        if not curve.reached:
            returned = self.curve(replace(path, waypoints=path.waypoints[::-1]))
            if returned.reached:
                return replace(returned, q=returned.q[::-1])
        return curve

    def why_stuck(self, curve: IntegralCurve) -> str:
        """Return, as a phrase, where a curve got stuck and what blocks it; empty if it reached."""
        return "" if self._system is None else self._system.describe_stall(curve)


class DensityGuide:
    """Lead by the density alone, and where that is stuck by way of a via point.

    Via points are drawn near both ends and from everywhere in turn. From both ends the density
    leads to one: leaving narrow space is easier than entering it. The two curves joined, and
    shortened, are the way.

    Args:
        legs: the density that leads.
        freedom: proves what shortens a way.
        parameters: see `PlanningParameters`.
    """

    def __init__(self, legs: Legs, freedom: FreeSpace, parameters: PlanningParameters) -> None:
        self._legs = legs
        self._freedom = freedom
        self._parameters = parameters

    def plan(self, start: Array, goal: Array, seed: int) -> GuidePath | NoPath:
        """Act as `Guide.plan`: return a chain of clear segments, or why there is none."""
        rng, parameters = np.random.default_rng(seed), self._parameters
        arm = self._legs.check.arm
        # From the narrow end first, from which it fails more often.
        first, last = sorted((start, goal), key=self._room)
        curve, found_by, stuck = self._legs.curve_from_either_end(_pair(first, last)), ALONE, ""
        way, legs = curve.q, [curve]
        if not curve.reached:
            stuck, found_by = self._legs.why_stuck(curve), BY_VIA_POINT
            bounds = SamplingBounds(arm, parameters, start, goal)
            found = self._by_via_point(first, last, bounds, rng)
            if found is None:
                tried = f"; from none of {parameters.vias} via points it leads to both ends"
                return NoPath(stuck + (tried if parameters.vias else ""), curve.remark)
            legs += found
            way = np.vstack([found[0].q, found[1].q[-2::-1]])
        path = shortened(arm, self._freedom, way, parameters.shortcuts, rng)
        path = path if first is start else path[::-1]
        remark = "; ".join(filter(None, dict.fromkeys(leg.remark for leg in legs)))
        return GuidePath(path, is_clear=True, found_by=found_by, stuck=stuck, remark=remark)

    def _room(self, q: Array) -> float:
        return self._legs.check.least_distance_margin(q[np.newaxis])

    def _by_via_point(
        self, first: Array, last: Array, bounds: SamplingBounds, rng: np.random.Generator
    ) -> tuple[IntegralCurve, IntegralCurve] | None:
        """Return curves from both ends to a via point."""
        for index in range(self._parameters.vias):
            via = self._via(bounds.everywhere if index % 2 else bounds.near, rng)
            leg = self._legs.curve(_pair(first, via))
            if leg.reached:
                other = self._legs.curve(_pair(last, via))
                if other.reached:
                    return leg, other
        return None

    def _via(self, bounds: Bounds, rng: np.random.Generator) -> Array:
        check = self._legs.check
        for _ in range(_DRAWN):
            via = check.arm.configurations(bounds.draw(rng))
            if check.configuration_is_clear(via):
                break
        return via


def _pair(start: Array, goal: Array) -> GuidePath:
    return GuidePath(np.stack([start, goal]), is_clear=False)
