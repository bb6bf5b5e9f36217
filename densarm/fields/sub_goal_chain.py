"""SubGoalChain: the sub-goals of a guide, close enough to follow, and their sensing distances."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.density.distance_bounds import DistanceBounds, all_exceed
from densarm.errors import InvalidValueError
from densarm.guides.guide import GuidePath
from densarm.proof.swept_bound import SweptBound
from densarm.validation import positive

_SURPLUS = 3.0
"""Factor by which neighbours are closer than a proof needs: an arm near one sees the next."""

_LARGEST_SHARE = 0.5
"""Below 1 - 1/_SURPLUS, or neighbours would be out of sight of each other."""


@dataclass(frozen=True)
class SensingParameters:
    """How far from unsafe sets the density changes.

    Raises:
        InvalidValueError: a value out of its range.
    """

    distance: float = 0.05
    """Largest sensing distance σ of a geometry pair [m]."""

    path_share: float = 0.3
    """σ is at most this share of the path's own clearance, so that Ψ = 1 on the path."""

    joint: float = 0.1
    """Largest sensing distance of a joint limit [rad or m]."""

    def __post_init__(self) -> None:
        positive("distance", self.distance)
        positive("joint", self.joint)
        if not 0.0 < self.path_share <= _LARGEST_SHARE:
            allowed = f"above 0 and at most {_LARGEST_SHARE}"
            raise InvalidValueError("path_share", self.path_share, allowed)


class SubGoalChain:
    """Sub-goals from start to goal and the one that is current.

    A sub-goal is in sight if the bound proves that the segment to it stays outside its sensing
    regions, and if no joint is more than a quarter turn away:

        d_k(q) - m + h_k > 2 σ_k + μ_k,

    h_k and σ_k the sub-goal's own, μ_k the bound on the motion to it. A path is cut so finely that
    from each sub-goal the next is in sight, so that Ψ = 1 on all that is followed and the density
    leads straight along the path until something pushes the arm off it. A way that no guide
    proved keeps its goal as the only sub-goal, with the full sensing distance: the plain density.

    Args:
        bound: proves what is in sight.
        path: the guide's answer.
        sensing: sensing distances.
    """

    SPACING = 0.05
    """Largest distance of neighbouring sub-goals in any joint [rad or m]."""
    SIGHT = np.pi / 2
    """Largest distance of a sub-goal in sight in any joint [rad or m]; the pull of a goal on a
    circle grows up to there."""

    def __init__(self, bound: SweptBound, path: GuidePath, sensing: SensingParameters) -> None:
        arm = bound.arm
        self._bound = bound
        self.q = _refine(bound, path) if path.is_clear else path.waypoints
        self.slack = np.array([bound.slack(q) for q in self.q])
        """By how much each pair exceeds the margin at each sub-goal (W, K) [m]."""
        steps = np.linalg.norm(arm.difference(self.q[:-1], self.q[1:]), axis=1)
        self.remaining: Array = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        """Length of the way from each sub-goal to the goal (W,) [rad]."""
        self.sensing_distance = np.full_like(self.slack, sensing.distance)
        """Sensing distance of each pair on the way to each sub-goal (W, K) [m]."""
        self.joint_sensing_distance = np.full(arm.nv, sensing.joint)
        """Sensing distance of each joint's limits (nv,) [rad or m]."""
        if path.is_clear:
            before, after = _shifted(self.slack, 1), _shifted(self.slack, -1)
            near = np.minimum(self.slack, np.minimum(before, after))
            np.minimum(sensing.path_share * near, sensing.distance, out=self.sensing_distance)
            angles = arm.angles(self.q)
            room = np.minimum(angles - arm.limits.lower, arm.limits.upper - angles).min(axis=0)
            room = np.maximum(sensing.path_share * room, 1e-6)
            np.minimum(room, sensing.joint, out=self.joint_sensing_distance)
        self.current = 1
        """Index of the current sub-goal."""

    @property
    def is_last(self) -> bool:
        """Whether the current sub-goal is the goal."""
        return self.current == len(self.q) - 1

    def advance(self, q: Array, distances: DistanceBounds) -> bool:
        """Move on to the farthest consecutive sub-goal that is in sight.

        Args:
            q: configuration of the arm (nq,).
            distances: of all pairs there.

        Returns:
            Whether the current sub-goal changed.
        """
        before = self.current
        while not self.is_last and self.is_in_sight(self.current + 1, q, distances):
            self.current += 1
        return self.current != before

    def is_in_sight(self, index: int, q: Array, distances: DistanceBounds) -> bool:
        """Return whether a sub-goal is in sight, as the class says.

        Args:
            index: of the sub-goal.
            q: configuration of the arm (nq,).
            distances: of all pairs there.
        """
        bound = self._bound
        step = bound.arm.difference(q, self.q[index])
        if np.abs(step).max() > self.SIGHT:
            return False
        need = bound.margin - self.slack[index] + 2.0 * self.sensing_distance[index]
        return all_exceed(distances, need + bound.motion(step))


def _refine(bound: SweptBound, path: GuidePath) -> Array:
    arm, pieces = bound.arm, [path.waypoints[:1]]
    for q_a, q_b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
        step = arm.difference(q_a, q_b)
        cuts = bound.clear_subdivision(q_a, q_b, _SURPLUS)
        if cuts is None:
            raise InvalidValueError("path", [q_a.tolist(), q_b.tolist()], "proved clear")
        even = np.linspace(0.0, 1.0, 1 + int(np.ceil(np.abs(step).max() / SubGoalChain.SPACING)))
        fractions = np.union1d(cuts, even)[1:]
        pieces.append(arm.integrate(q_a, fractions[:, np.newaxis] * step))
    return np.vstack(pieces)


def _shifted(rows: Array, by: int) -> Array:
    """Return rows moved down by one, or up by -1, the end row standing twice."""
    index = np.clip(np.arange(len(rows)) - by, 0, len(rows) - 1)
    return rows[index]
