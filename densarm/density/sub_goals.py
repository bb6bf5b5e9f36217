"""Sub-goals: a chain of goals, close enough to follow, and the density towards the current one."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from densarm.density.critical_points import find_stall, unstable_direction
from densarm.density.goal_distance import GoalDistance
from densarm.density.navigation_density import DensityParameters, Gauge, NavigationDensity
from densarm.density.unsafe_sets import ClearanceSet, JointLimitSet, SensingParameters, UnsafeSet
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.documented import documented
from densarm.world.active_pairs import ActivePairs, DistanceBounds, all_exceed
from densarm.world.swept_check import SweptCheck

SPACING = 0.05
"""Largest distance of neighbouring sub-goals in any joint [rad or m]."""

SIGHT = np.pi / 2
"""Largest distance of a sub-goal in sight in any joint [rad or m]; the pull of a goal on a
continuous joint grows up to there."""

CRITICAL_SLOPE = 1e-9
"""‖∇ ln ρ‖ [1/rad] at and below which a point counts as critical."""

_ARRIVED = 1e-3  # [rad or m] from a sub-goal in any joint, at which the next one takes its place
_SURPLUS = 3.0  # factor by which neighbours are closer than a proof needs, to be seen from nearby


@documented
@dataclass(frozen=True)
class GuidePath:
    """A chain of sub-goals, each joined to the next by a straight segment of joint space.

    On continuous joints a segment goes the short way round.
    """

    waypoints: Array
    """(W, nq) configurations, W >= 2; the first is the start, the last the goal."""
    is_clear: bool
    """Whether every segment is proved free of contact."""
    found_by: str = ""
    """What found it, as a phrase; empty for a guide of one's own."""
    stuck: str = ""
    """Where the density alone gets stuck, and what blocks it; empty where it was not so tried."""
    remark: str = ""
    """Which critical points of ρ the curves that were tried left, and how; empty for none."""


class SubGoals:
    """Sub-goals from start to goal and the one that is current.

    A sub-goal is in sight if the Lipschitz constants prove that the segment to it stays outside
    its sensing regions, and if no joint is more than a quarter turn away:

        d_k(q) - m + h_k > 2 σ_k + μ_k,

    h_k and σ_k the sub-goal's own, μ_k the bound on the motion to it. A path is cut so finely that
    from each sub-goal the next is in sight, so that Ψ = 1 on all that is followed and the density
    leads straight along the path until something pushes the arm off it. A way that no guide
    proved keeps its sub-goals as they are, with the full sensing distance: each is led to by the
    plain density, the goal alone if there is no other.

    Args:
        check: proves what is in sight.
        path: the guide's answer.
        sensing: sensing distances.

    Attributes:
        q: the sub-goals (W, nq).
        current: index of the current one.

    Raises:
        InvalidValueError: a segment that is said to be clear is not.
    """

    def __init__(self, check: SweptCheck, path: GuidePath, sensing: SensingParameters) -> None:
        arm = check.arm
        self._check = check
        self.sensing = sensing
        """As given."""
        self.q: Array = _refined(check, path) if path.is_clear else path.waypoints
        self.distance_margin: Array = np.array([check.distance_margin(q) for q in self.q])
        """Distance of each pair beyond the margin at each sub-goal (W, K) [m]."""
        steps = np.linalg.norm(arm.difference(self.q[:-1], self.q[1:]), axis=1)
        self.remaining: Array = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        """Length of the way from each sub-goal to the goal (W,) [rad]."""
        self.sensing_distance = np.full_like(self.distance_margin, sensing.distance)
        """Sensing distance of each pair on the way to each sub-goal (W, K) [m]."""
        self.joint_sensing_distance = np.full(arm.nv, sensing.joint)
        """Sensing distance of each joint's limits (nv,) [rad or m]."""
        if path.is_clear:
            ends_twice = np.pad(self.distance_margin, ((1, 1), (0, 0)), mode="edge")
            near = np.minimum(self.distance_margin, np.minimum(ends_twice[:-2], ends_twice[2:]))
            np.minimum(sensing.path_share * near, sensing.distance, out=self.sensing_distance)
            angles = arm.angles(self.q)
            inside = np.minimum(angles - arm.limits.lower, arm.limits.upper - angles).min(axis=0)
            inside = np.maximum(sensing.path_share * inside, 1e-6)
            np.minimum(inside, sensing.joint, out=self.joint_sensing_distance)
        self.current = 1

    @property
    def is_last(self) -> bool:
        """Whether the current sub-goal is the goal."""
        return self.current == len(self.q) - 1

    def advance(self, q: Array, distances: DistanceBounds) -> bool:
        """Move on to the farthest consecutive sub-goal that is in sight, or from one reached.

        Args:
            q: configuration of the arm (nq,).
            distances: of all pairs there.

        Returns:
            Whether the current sub-goal changed.
        """
        before = self.current
        while not self.is_last and self.is_in_sight(self.current + 1, q, distances):
            self.current += 1
        here = self.q[self.current]
        if not self.is_last and np.abs(self._check.arm.difference(q, here)).max() <= _ARRIVED:
            self.current += 1
        return self.current != before

    def is_in_sight(self, index: int, q: Array, distances: DistanceBounds) -> bool:
        """Return whether a sub-goal is in sight of q (nq,), given the distances of all pairs."""
        check = self._check
        step = check.arm.difference(q, self.q[index])
        if np.abs(step).max() > SIGHT:
            return False
        need = check.margin - self.distance_margin[index] + 2.0 * self.sensing_distance[index]
        return all_exceed(distances, need + check.world.motion_bound(step))


class GuidedDensity:
    """The density whose goal is the current sub-goal, and whose sensing regions fit the way to it.

    Args:
        check: the world and the safety margin.
        sub_goals: the sub-goals.
        goal_distance: V.
        parameters: of the density.
        unsafe_sets: others beside pairs of bodies and joint limits.

    Source: [ZNV] Remark 1, which lets the goal distance adapt to the space.
    """

    def __init__(
        self,
        check: SweptCheck,
        sub_goals: SubGoals,
        goal_distance: GoalDistance,
        parameters: DensityParameters = DensityParameters(),
        unsafe_sets: tuple[UnsafeSet, ...] = (),
    ) -> None:
        self.world = check.world
        self.sub_goals = sub_goals
        self._version = self.world.version
        self._clearance_set = ClearanceSet(
            self.world,
            check.margin,
            sub_goals.sensing_distance[sub_goals.current],
            moving=sub_goals.sensing.distance,
        )
        self._limits = JointLimitSet(check.arm, sub_goals.joint_sensing_distance)
        self.density = NavigationDensity(
            check.arm,
            sub_goals.q[sub_goals.current],
            [self._clearance_set, self._limits, *unsafe_sets],
            goal_distance,
            parameters,
        )
        self._log_gradient = np.zeros(check.arm.nv)
        self.density.update(sub_goals.q[0])  # kernels are loaded before a control loop
        self.is_critical()

    @property
    def pairs(self) -> ActivePairs:
        """Distances of all pairs at the last update, of those near with their gradients."""
        return self._clearance_set.pairs

    def restart(self) -> None:
        """Return to the first sub-goal."""
        self.sub_goals.current = 1
        self._point_at_sub_goal()

    def lead_along(self, sub_goals: SubGoals) -> None:
        """Lead along other sub-goals, in the world as it is now."""
        self.sub_goals, self._version = sub_goals, self.world.version
        self._limits.set_sensing_distance(sub_goals.joint_sensing_distance)
        self._point_at_sub_goal()

    def move_goal(self, q: Array) -> None:
        """Put the goal at q (nq,), where it alone leads, its sensing regions as they are."""
        self.sub_goals.q[:] = q
        self.density.set_goal(q)

    def update(self, q: Array) -> None:
        """Move on to the farthest sub-goal in sight of q (nq,) and evaluate its density there.

        Where obstacles have changed since the sub-goals were proved, these lead as before, and
        the density keeps off the obstacles as they are.
        """
        self.density.update(q)
        self.advance(q)

    def advance(self, q: Array) -> None:
        """Act as `update` where the density was evaluated last, at q (nq,)."""
        if self.sub_goals.advance(q, self.pairs):
            self._point_at_sub_goal()
            self.density.update(q)

    def sub_goal_in_sight(self, q: Array) -> Array | None:
        """Return the sub-goal (nq,) if Ψ = 1 on the segment to it from q (nq,), which was updated.

        There ρ depends on V alone, and grows along the segment.

        Raises:
            SceneChangedError: obstacles have changed since the sub-goals were proved.
        """
        self.world.require_version(self._version)
        goals = self.sub_goals
        if self.density.log_psi < 0.0 or not goals.is_in_sight(goals.current, q, self.pairs):
            return None
        return np.asarray(goals.q[goals.current])

    def write_gradient(self, q: Array, out: Array) -> None:
        """Write ∇ρ (nv,) in the density's own gauge and blend into `out`; q (nq,) was updated."""
        if self.density.parameters.blend_radius > 0.0:
            out[:] = self.density.evaluate(q).blended_gradient()
        else:
            self.density.write_gradient(self.density.parameters.gauge, out)

    def is_critical(self) -> bool:
        """Return whether the last update was at a critical point of ρ, the sub-goal included."""
        gradient = self._log_gradient
        self.density.write_gradient(Gauge.LOG, gradient)
        return not np.sqrt(gradient @ gradient) > CRITICAL_SLOPE

    def unstable_direction(self, q: Array) -> Array | None:
        """Return the direction (nv,) that leads away from a critical point q (nq,), or None.

        There is none at a maximum, the goal included; q was updated, and is afterwards.
        """
        direction = None
        if self.density.goal_distance_value > 0.0:
            gradients = partial(self.density.log_gradients, q)
            direction = unstable_direction(gradients, np.zeros(self._log_gradient.size))
            self.density.update(q)
        return direction

    def describe_departure(self, q: Array, direction: Array) -> str:
        """Return, as a phrase, that a critical point q (nq,) is left in a direction (nv,)."""
        where, way = (
            ", ".join(f"{entry + 0.0:.4g}" for entry in np.round(vector, 4))
            for vector in (self.world.arm.angles(q), direction)
        )
        return (
            f"left a critical point of the density at joint positions ({where}) along its "
            f"unstable direction ({way})"
        )

    def way_left(self, q: Array) -> tuple[float, float]:
        """Return the lengths from q (nq,) to the sub-goal, and from there to the goal [rad]."""
        to_sub_goal = float(np.linalg.norm(self.density.error(q)))
        return to_sub_goal, float(self.sub_goals.remaining[self.sub_goals.current])

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the density leads nowhere from q (nq,), and what blocks it."""
        return find_stall(self.density, self._clearance_set, self._limits, q).description

    def _point_at_sub_goal(self) -> None:
        current = self.sub_goals.current
        self.density.set_goal(self.sub_goals.q[current])
        self._clearance_set.set_sensing_distance(self.sub_goals.sensing_distance[current])


def _refined(check: SweptCheck, path: GuidePath) -> Array:
    arm, pieces = check.arm, [path.waypoints[:1]]
    for q_a, q_b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
        step = arm.difference(q_a, q_b)
        cuts = check.clear_subdivision(q_a, q_b, _SURPLUS)
        if cuts is None:
            raise InvalidValueError("path", [q_a.tolist(), q_b.tolist()], "proved clear")
        even = np.linspace(0.0, 1.0, 1 + int(np.ceil(np.abs(step).max() / SPACING)))
        fractions = np.union1d(cuts, even)[1:]
        pieces.append(arm.integrate(q_a, fractions[:, np.newaxis] * step))
    return np.vstack(pieces)
