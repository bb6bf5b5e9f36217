"""SweptBound: proof that a straight joint-space segment touches nothing."""

from copy import copy

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.clearance import DISTANCE_TOLERANCE, Clearance, joint_support
from densarm.proof.bisection import Pairs, bisect
from densarm.proof.link_placements import AXIS, SLIDES, joint_table
from densarm.shapes import extreme_points
from densarm.validation import non_negative


class SweptBound:
    """Bounds how far the bodies of each pair move, so that distances at ends prove what is between.

    While the joints move by |Δq_j|, within their limits, a point of one body of pair k moves
    against the other by at most

        μ_k = Σ_j r_kj |Δq_j|,

    r_kj bounding, over all configurations, the distance from the axis of joint j to any point of
    the body that it moves (1 for prismatic joints), over the joints that the two bodies do not
    share. If d_k(q_a) + d_k(q_b) > μ_k the pair is apart on the whole segment.

    Args:
        clearance: the pairs.
        margin: distance that must be exceeded for a pair to count as apart [m].

    Raises:
        InvalidValueError: a negative margin.
    """

    DEPTH_FLOOR = 1e-5
    """Length of a segment [rad or m] at which one still not proved clear counts as not clear."""

    def __init__(self, clearance: Clearance, margin: float = 0.0) -> None:
        self.clearance = clearance
        self.arm = clearance.arm
        self.margin = non_negative("margin", margin)
        _, joints = joint_table(self.arm.model)
        self.shape_lever = self._shape_levers(joints)
        """For each shape the bounds r_j of the joints that move it (S, nv), else 0 [m/rad or 1]."""
        self.lever = self._pair_levers()
        """The bounds r_kj (K, nv) [m/rad, 1 for prismatic joints]."""
        self.slides: NDArray[np.bool_] = joints[1:, SLIDES] > 0.0
        """Which joints are prismatic (nv,); beyond their limits the bounds do not hold."""

    def with_margin(self, margin: float) -> "SweptBound":
        """Return the same bound under another margin [m]."""
        other = copy(self)
        other.margin = non_negative("margin", margin)
        return other

    def motion(self, step: Array, pairs: Pairs | None = None) -> Array:
        """Return the bounds μ_k [m] on how far bodies move.

        Args:
            step: joint motions (..., nv) [rad or m].
            pairs: indices of the pairs to look at; None for all, (..., K).
        """
        lever = self.lever if pairs is None else self.lever[pairs]
        return np.asarray(np.abs(step) @ lever.T)

    def slack(self, q: Array, pairs: Pairs | None = None) -> Array:
        """Return by how much distances surely exceed the margin [m].

        Args:
            q: configuration (nq,).
            pairs: indices of the pairs to look at; None for all, (K,).
        """
        return self.clearance.distances(q, pairs) - (self.margin + DISTANCE_TOLERANCE)

    def configuration_is_clear(self, q: Array) -> bool:
        """Return whether every distance at q (nq,) exceeds the margin."""
        return bool((self.slack(q) > 0.0).all())

    def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
        """Return whether every distance is proved above the margin on the whole segment.

        Args:
            q_a: one end (nq,).
            q_b: the other end (nq,), reached the short way round on continuous joints.
        """
        return self.clear_subdivision(q_a, q_b) is not None

    def clear_subdivision(self, q_a: Array, q_b: Array, surplus: float = 1.0) -> Array | None:
        """Return where the proof split the segment, or None if it is not proved clear.

        Args:
            q_a: one end (nq,).
            q_b: the other end (nq,).
            surplus: factor >= 1 by which d(q_a) + d(q_b) must exceed μ; above 1 it splits more.

        Returns:
            Increasing fractions from 0 to 1; between neighbours one bound proves every pair.
        """
        step = self.arm.difference(q_a, q_b)
        length = float(np.abs(step).max())
        motion = surplus * self.motion(step)
        result = bisect(
            slack=lambda t, pairs: self.slack(self.arm.integrate(q_a, t * step), pairs),
            motion=lambda a, b, pairs: (b - a) * motion[pairs],
            split=lambda a, b: 0.5 * (a + b) if (b - a) * length > self.DEPTH_FLOOR else None,
            ends=(0.0, 1.0),
            n_pairs=self.clearance.n_pairs,
        )
        return None if len(result.failing) else result.evaluated

    def _shape_levers(self, joints: Array) -> Array:
        model, shapes = self.arm.model, self.clearance.geometry_model.geometryObjects
        return np.array([_levers(model, joints, item) for item in shapes]).reshape(-1, model.nv)

    def _pair_levers(self) -> Array:
        model, shapes = self.arm.model, self.clearance.geometry_model.geometryObjects
        support, lever = joint_support(model), self.shape_lever
        moves = np.array([support[item.parentJoint] for item in shapes]).reshape(-1, model.nv)
        first, second = self.clearance.pair_shapes.T
        shared = moves[first] * moves[second]
        return np.asarray((lever[first] + lever[second]) * (1.0 - shared))


def _levers(model: pin.Model, joints: Array, shape: pin.GeometryObject) -> Array:
    """Return, for one shape, the bound r_j (nv,) of every joint that moves it, else 0."""
    levers = np.zeros(model.nv)
    if shape.parentJoint == 0:  # fixed, and perhaps without end
        return levers
    points, reach = extreme_points(shape.geometry)
    points = points @ shape.placement.rotation.T + shape.placement.translation
    joint = shape.parentJoint
    while joint > 0:
        # In all configurations the shape is within `reach` of the hull of `points`, which are
        # fixed in the frame of `joint`.
        axis, slide = joints[joint, AXIS], joints[joint, SLIDES] > 0.0
        across = points - np.outer(points @ axis, axis)
        farthest = reach + float(np.linalg.norm(across, axis=1).max())
        levers[model.joints[joint].idx_v] = 1.0 if slide else farthest
        reach += float(np.linalg.norm(points, axis=1).max())
        reach += _extension(model, joint) if slide else 0.0
        points = model.jointPlacements[joint].translation[np.newaxis]
        joint = model.parents[joint]
    return levers


def _extension(model: pin.Model, joint: int) -> float:
    index = model.joints[joint].idx_q
    return float(max(abs(model.lowerPositionLimit[index]), abs(model.upperPositionLimit[index])))
