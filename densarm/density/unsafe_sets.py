"""Unsafe sets: where the density vanishes, and how far away it is sensed."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.density.inverse_bump import bump_curvature, log_inverse_bump
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive, positive_array
from densarm.values.documented import documented
from densarm.values.kernels import any_vector, compiled, entry_point
from densarm.world.active_pairs import ActivePairs
from densarm.world.distance_view import add_pair_gradient
from densarm.world.world import World

_Function = Callable[[Array], tuple[float, Array]]

_LARGEST_SHARE = 0.5  # with more, neighbouring sub-goals would be out of sight of each other


@documented
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


class UnsafeSet(Protocol):
    """A family of unsafe sets {h_k ≤ 0}, each with its sensing region {s_k ≤ 0}."""

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        r"""Sum ln Ψ over the members and add the gradient of the sum in place.

        .. math:: \sum_k \ln\Psi_k(q), \qquad \nabla \sum_k \ln\Psi_k(q)

        Args:
            q: configuration, shape (nq,).
            theta: shift θ ≥ 0 of the inverse bumps, dimensionless.
            out_gradient: tangent-space gradient, shape (nv,), added to.

        Returns:
            Σ ln Ψ_k; −inf in contact for θ = 0.

        Source: [ZNV] eq. 7-8.
        """
        ...


@runtime_checkable
class Curved(Protocol):
    """An unsafe set that tells how ln Ψ bends too, for long steps of an integral curve."""

    def add_curvature(self, q: Array, theta: float, out: Array) -> None:
        r"""Add the part of the Hessian of -Σ ln Ψ that keeps away from the set, in place.

        .. math:: \sum_k \max\Bigl(0,
            -\frac{\partial^2 \ln\Psi_k}{\partial h_k^2}\Bigr) \nabla h_k \nabla h_k^T

        Args:
            q: configuration of the last `UnsafeSet.add_log_bump`, shape (nq,).
            theta: as there.
            out: positive semidefinite (nv, nv), added to.
        """
        ...


class ClearanceSet:
    r"""Configurations at which a pair of bodies is closer than a margin.

    .. math:: h_k(q) = d_k(q) - m, \qquad s_k(q) = h_k(q) - \sigma_k

    Beyond its sensing region a pair adds the constant ln(1 + θ), so that one known to be that far
    needs no query: the cost grows with the pairs near their sensing regions.

    Args:
        world: the pairs.
        margin: m ≥ 0 [m].
        sensing_distance: σ > 0 [m], one for all pairs or shape (K,).
        pairs: which of them are near, for this set alone; None for active pairs of its own.
        moving: σ [m] of pairs whose obstacle has a motion, or has been moved since this set was
            made; None for those of all pairs.

    Attributes:
        pairs: the active pairs, updated to the last configuration.

    Raises:
        InvalidValueError: a negative margin, or a sensing distance that is not positive.
    """

    def __init__(
        self,
        world: World,
        margin: float,
        sensing_distance: ArrayLike,
        pairs: ActivePairs | None = None,
        moving: float | None = None,
    ) -> None:
        self.world = world
        self._moving, self._version = moving, world.version
        self._n_moving, self._way_before = -1, world.obstacle_way.copy()
        self.pairs = pairs or ActivePairs(world)
        self.margin = non_negative("margin", margin)
        self.sensing_distance = positive_array("sensing_distance", sensing_distance, world.n_pairs)
        """σ_k (K,) [m], to be changed by `set_sensing_distance`."""
        self._standing = self.sensing_distance.copy()
        pairs = self.pairs
        jacobian, sign = pairs.kinematics.jacobian, world.sign
        self._arrays = pairs.listed, pairs.rows, jacobian, sign, self.margin, self.sensing_distance
        self._add_log_bumps = entry_point(_add_active_log_bumps, 0, *self._arrays, 0.0, any_vector)
        self.set_sensing_distance(self.sensing_distance)

    def set_sensing_distance(self, sensing_distance: Array) -> None:
        """Sense the pairs at other distances from now on, σ > 0 (K,) [m]; -inf: not at all."""
        self.sensing_distance[:] = self._standing[:] = sensing_distance
        if self._moving is not None:
            is_moving = self._is_moving()
            self._n_moving = int(np.count_nonzero(is_moving))
            self.sensing_distance[is_moving] = self._moving
        self.pairs.set_reach(self.margin + self.sensing_distance)

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Act as `UnsafeSet.add_log_bump`."""
        pairs = self.pairs
        if self._version != self.world.version and self._moving is not None:
            self._version = self.world.version
            world = self.world
            now = _count_moving(world.obstacle_way, self._way_before, world.has_motion)
            if now != self._n_moving:
                self.set_sensing_distance(self._standing)
        pairs.update(q)
        value: float = self._add_log_bumps(pairs.n_awake, *self._arrays, theta, out_gradient)
        return value

    def _is_moving(self) -> NDArray[np.bool_]:
        world = self.world
        return np.asarray((world.obstacle_way != self._way_before) | world.has_motion)

    def add_curvature(self, q: Array, theta: float, out: Array) -> None:  # noqa: ARG002
        """Act as `Curved.add_curvature`."""
        pairs = self.pairs
        jacobian, sign = pairs.kinematics.jacobian, self.world.sign
        _add_active_curvature(
            pairs.state, pairs.rows, jacobian, sign, self.margin, self.sensing_distance, theta, out
        )


class JointLimitSet:
    r"""Configurations at or beyond a position limit of a bounded joint.

    .. math:: h = q_i - q_i^{\min}, \quad h = q_i^{\max} - q_i, \quad s = h - \sigma_i

    Args:
        arm: its limits.
        sensing_distance: σ > 0 [rad or m], one for all joints or shape (nv,).

    Raises:
        InvalidValueError: a sensing distance that is not positive.
    """

    def __init__(self, arm: Arm, sensing_distance: ArrayLike) -> None:
        limits = arm.limits
        width = positive_array("sensing_distance", sensing_distance, arm.nv)
        bounds = np.concatenate([limits.lower, limits.upper])
        members = np.flatnonzero(np.isfinite(bounds) & ~np.tile(arm.continuous, 2))
        joint = members % arm.nv
        self.index = np.array([joint, arm.idx_q[joint]], dtype=np.int64)
        """Where in the tangent space and in q each limited joint is (2, M)."""
        side = np.where(members < arm.nv, 1.0, -1.0)
        self._bounds = bounds[members]
        self.member = np.array([self._bounds, side, width[joint]])
        """Limits [rad or m], 1 for a lower and -1 for an upper one, and σ [rad or m] (3, M)."""
        types = any_vector, self.index, self.member, 0.0, any_vector
        self._add_log_bumps = entry_point(_add_limit_log_bumps, *types)

    def set_sensing_distance(self, sensing_distance: Array) -> None:
        """Sense the limits at others from now on, σ > 0 (nv,) [rad or m]; -inf: not at all."""
        width, side = sensing_distance[self.index[0]], self.member[1]
        self.member[0] = np.where(width > 0.0, self._bounds, -side * np.inf)
        self.member[2] = np.where(width > 0.0, width, 1.0)

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Act as `UnsafeSet.add_log_bump`."""
        q = np.asarray(q, np.float64)
        value: float = self._add_log_bumps(q, self.index, self.member, theta, out_gradient)
        return value

    def add_curvature(self, q: Array, theta: float, out: Array) -> None:
        """Act as `Curved.add_curvature`."""
        bound, side, width = self.member
        h = side * (q[self.index[1]] - bound)
        for k in np.flatnonzero(h < width):
            joint = self.index[0, k]
            out[joint, joint] += bump_curvature(h[k], width[k], theta)


def sensed_sets(
    world: World, margin: float, sensing: SensingParameters
) -> tuple[ClearanceSet, JointLimitSet]:
    """Return the pairs of a world and the limits of its joints, sensed as far as they may be.

    Args:
        world: the pairs, and the arm.
        margin: safety margin m of the pairs [m].
        sensing: sensing distances.

    Raises:
        InvalidValueError: a negative margin.
    """
    pairs = ClearanceSet(world, margin, sensing.distance)
    return pairs, JointLimitSet(world.arm, sensing.joint)


class ImplicitSet:
    r"""The set {h ≤ 0} in Rⁿ with the sensing region {s ≤ 0}, both given as functions.

    .. math:: \Phi = \bar f\!\left(\frac{h}{h - s}\right)

    Args:
        h: smooth function of q, shape (n,), returning its value and its gradient, shape (n,).
        s: likewise, in the unit of `h`; below `h` wherever h ≤ 0, so that the sensing region
            contains the unsafe set.

    Source: [ZNV] eq. 2, 3 and 7.
    """

    def __init__(self, h: _Function, s: _Function) -> None:
        self.h = h
        self.s = s

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Act as `UnsafeSet.add_log_bump`.

        Raises:
            InvalidValueError: s ≥ h at a configuration of the unsafe set.
        """
        h, h_gradient = self.h(q)
        s, s_gradient = self.s(q)
        if h <= 0.0 and s >= h:
            raise InvalidValueError("sensing function s", s, f"below h = {h} wherever h <= 0")
        value, slope = log_inverse_bump(h, h - s, theta)
        if slope != 0.0:
            t = max(h / (h - s), 0.0)
            out_gradient += slope * ((1.0 - t) * h_gradient + t * s_gradient)
        return value


@compiled
def _count_moving(way: Array, before: Array, has_motion: NDArray[np.bool_]) -> int:
    count = 0
    for k in range(way.shape[0]):
        count += has_motion[k] or way[k] != before[k]
    return count


@compiled
def _add_active_log_bumps(
    n_awake: int,
    listed: NDArray[np.int64],
    rows: Array,
    jacobian: Array,
    sign: Array,
    margin: float,
    width: Array,
    theta: float,
    out_gradient: Array,
) -> float:
    total, far, passed = 0.0, math.log1p(theta), 0
    for n in range(n_awake + 1):
        k = listed[n] if n < n_awake else listed.shape[0]
        if far > 0.0:  # one by one, as for pairs that are awake, to the last bit
            for _ in range(passed, k):
                total += far
        if n == n_awake:
            break
        passed = k + 1
        value, slope = log_inverse_bump(rows[k, 0] - margin, width[k], theta)
        total += value
        if slope != 0.0:
            add_pair_gradient(rows[k], jacobian, sign[k], slope, out_gradient)
    return total


@compiled
def _add_active_curvature(
    state: NDArray[np.int64],
    rows: Array,
    jacobian: Array,
    sign: Array,
    margin: float,
    width: Array,
    theta: float,
    out: Array,
) -> None:
    gradient = np.empty(out.shape[0])
    for k in range(state.shape[0]):
        if state[k] == 0:
            continue
        curvature = bump_curvature(rows[k, 0] - margin, width[k], theta)
        if curvature > 0.0:
            for i in range(out.shape[0]):
                gradient[i] = 0.0
            add_pair_gradient(rows[k], jacobian, sign[k], 1.0, gradient)
            for i in range(out.shape[0]):
                for j in range(out.shape[0]):
                    out[i, j] += curvature * gradient[i] * gradient[j]


@compiled
def _add_limit_log_bumps(
    q: Array, index: NDArray[np.int64], member: Array, theta: float, out_gradient: Array
) -> float:
    total = 0.0
    for m in range(member.shape[1]):
        bound, side, width = member[0, m], member[1, m], member[2, m]
        value, slope = log_inverse_bump(side * (q[index[1, m]] - bound), width, theta)
        total += value
        out_gradient[index[0, m]] += slope * side
    return total
