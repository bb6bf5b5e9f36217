"""Unsafe sets: where the density vanishes, and how far away it is sensed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.density.inverse_bump import accumulate_log_bumps, log_inverse_bump
from densarm.errors import InvalidValueError
from densarm.validation import non_negative, positive_array

if TYPE_CHECKING:
    from densarm.arm import Arm
    from densarm.clearance import Clearance


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


class ClearanceSet:
    r"""Configurations at which a geometry pair is closer than a margin.

    .. math:: h_k(q) = d_k(q) - m, \qquad s_k(q) = h_k(q) - \sigma_k

    Args:
        clearance: signed distances of K pairs and their gradients.
        margin: m ≥ 0 [m].
        sensing_distance: σ > 0 [m], one for all pairs or shape (K,).

    Attributes:
        clearance: as given; `add_log_bump` leaves it updated to its configuration.
        sensing_distance: σ_k [m], shape (K,), which may be changed in place.

    Raises:
        InvalidValueError: a negative margin, or a sensing distance that is not positive.
    """

    def __init__(self, clearance: Clearance, margin: float, sensing_distance: ArrayLike) -> None:
        self.clearance = clearance
        self.margin = non_negative("margin", margin)
        self.sensing_distance = positive_array(
            "sensing_distance", sensing_distance, clearance.distance.shape[0]
        )

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Update the clearance to `q`, then act as `UnsafeSet.add_log_bump`."""
        clearance = self.clearance
        clearance.update(q)
        return accumulate_log_bumps(
            clearance.distance,
            self.margin,
            clearance.gradient,
            self.sensing_distance,
            theta,
            out_gradient,
        )


class JointLimitSet:
    r"""Configurations at or beyond a position limit of a bounded joint.

    .. math:: h = q_i - q_i^{\min}, \quad h = q_i^{\max} - q_i, \quad s = h - \sigma_i

    Args:
        arm: its limits, `idx_q` and `is_circle` are read.
        sensing_distance: σ > 0 [rad or m], one for all joints or shape (nv,).

    Raises:
        InvalidValueError: a sensing distance that is not positive.
    """

    def __init__(self, arm: Arm, sensing_distance: ArrayLike) -> None:
        limits = arm.limits
        width = positive_array("sensing_distance", sensing_distance, len(arm.idx_q))
        bounds = np.concatenate([limits.lower, limits.upper])
        members = np.flatnonzero(np.isfinite(bounds) & ~np.tile(arm.is_circle, 2))
        joint = members % len(arm.idx_q)
        self._index = np.array([joint, arm.idx_q[joint]], dtype=np.int64)
        side = np.where(members < len(arm.idx_q), 1.0, -1.0)
        self._member = np.array([bounds[members], side, width[joint]])

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Act as `UnsafeSet.add_log_bump`."""
        return accumulate_limit_log_bumps(q, self._index, self._member, theta, out_gradient)


class ImplicitSet:
    r"""The set {h ≤ 0} in Rⁿ with the sensing region {s ≤ 0}, both given as functions.

    .. math:: \Phi = \bar f\!\left(\frac{h}{h - s}\right)

    Args:
        h: smooth function of q, shape (n,), returning its value and its gradient, shape (n,).
        s: likewise, in the unit of `h`; below `h` wherever h ≤ 0, so that the sensing region
            contains the unsafe set.

    Source: [ZNV] eq. 2, 3 and 7.
    """

    def __init__(
        self,
        h: Callable[[Array], tuple[float, Array]],
        s: Callable[[Array], tuple[float, Array]],
    ) -> None:
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
def accumulate_limit_log_bumps(
    q: Array, index: NDArray[np.int64], member: Array, theta: float, out_gradient: Array
) -> float:
    r"""Sum ln Ψ over position limits and add the gradient of the sum in place.

    .. math:: h_m = \mathrm{side}_m (q_m - \mathrm{bound}_m), \qquad s_m = h_m - \sigma_m

    Args:
        q: configuration, shape (nq,).
        index: where in the tangent space and in `q` each limited joint is, shape (2, M).
        member: limits [rad or m], sides (1 for a lower limit, −1 for an upper one) and sensing
            distances σ_m > 0 [rad or m], shape (3, M).
        theta: shift θ ≥ 0, dimensionless.
        out_gradient: shape (nv,), added to.

    Returns:
        Σ ln Ψ_m.

    Source: [ZNV] eq. 7-8.
    """
    total = 0.0
    for m in range(member.shape[1]):
        bound, side, width = member[0, m], member[1, m], member[2, m]
        value, slope = log_inverse_bump(side * (q[index[1, m]] - bound), width, theta)
        total += value
        out_gradient[index[0, m]] += slope * side
    return total
