"""JointSpaceCover: the unsafe set of an arm, sensed in convex regions of its joint space."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.density.enclosing_ellipsoid import Ellipsoid, enclosing_ellipsoid
from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.joint_error import joint_error
from densarm.density.unsafe_cells import unsafe_components
from densarm.errors import InvalidValueError
from densarm.proof.swept_bound import SweptBound
from densarm.validation import positive, positive_integer


@dataclass(frozen=True)
class CoverParameters:
    """Parameters of `JointSpaceCover`.

    Raises:
        InvalidValueError: a value out of its range.
    """

    depth: int = 8
    """Halvings of the joint space, as `unsafe_components` has them."""
    inflation: float = 0.4
    """By how much the semi-axes of a sensing region exceed those of the ellipsoid around its part
    of the unsafe set [rad or m]: the more, the rounder."""
    sensing_distance: float = 0.2
    """σ [m]: the larger against the clearance on the rim, the later the bump falls off, and the
    more its level sets take the shape of the rim instead of the unsafe set's."""

    def __post_init__(self) -> None:
        positive_integer("depth", self.depth)
        positive("inflation", self.inflation)
        positive("sensing_distance", self.sensing_distance)


@dataclass(frozen=True)
class SensingRegion:
    """An ellipsoid of the joint space that contains a component of the unsafe set."""

    ellipsoid: Ellipsoid
    """The region, in joint positions; on continuous joints less than a turn wide."""
    pairs: NDArray[np.int64]
    """Indices of the geometry pairs that may touch in the component."""


class JointSpaceCover:
    r"""The unsafe set found by coal, each of its components sensed in an ellipsoid around it.

    .. math::

        h_k(q) = d_k(q) - m, \qquad s_c(q) = \sigma \left(e^\top S_c^{-1} e - 1\right), \quad
        e = q \ominus q_c

    with an inverse bump for every component c and pair k that may touch in it. h is the true
    clearance, so that the density vanishes in contact and nowhere else; s is free [ZNV eq. 3] and
    gives the rim, along which trajectories slide, a convex and curved shape. Whether it is curved
    enough depends on V too: on no rim may V be smallest, along the rim, where it presses inwards.
    With weights of V in proportion to the joints' inertia that holds for the swing-up of
    [ZNV] Fig. 8, with equal weights it does not.

    An `UnsafeSet` for arms with up to three joints. Components are found by `unsafe_components`;
    every unsafe configuration is proved to lie inside the sensing region of its component.

    Args:
        bound: the swept bound, with clearance and margin m.
        parameters: fineness, inflation and σ.

    Attributes:
        regions: the sensing regions.

    Raises:
        InvalidValueError: as `unsafe_components`, or a sensing region a turn wide or wider.
    """

    def __init__(self, bound: SweptBound, parameters: CoverParameters = CoverParameters()) -> None:
        arm = bound.arm
        self.clearance = bound.clearance
        self.margin = bound.margin
        self.parameters = parameters
        self.regions = tuple(
            SensingRegion(
                enclosing_ellipsoid(component.corners).inflated(parameters.inflation),
                component.pairs,
            )
            for component in unsafe_components(bound, parameters.depth)
        )
        for region in self.regions:
            width = 2.0 * region.ellipsoid.extent[arm.is_circle].max(initial=0.0)
            if width >= 2.0 * np.pi:
                raise InvalidValueError("width of a sensing region", width, "below 2π rad")
        ellipsoids = [region.ellipsoid for region in self.regions]
        shape = (len(ellipsoids), arm.nv)
        self._centre = arm.configurations(np.reshape([e.centre for e in ellipsoids], shape))
        inverses = [np.linalg.inv(e.shape) for e in ellipsoids]
        self._inverse = np.reshape(inverses, (*shape, arm.nv))
        members = [(c, k) for c, region in enumerate(self.regions) for k in region.pairs]
        self._member_region, self._member_pair = np.array(members, np.int64).reshape(-1, 2).T
        self._idx_q, self._is_circle = arm.idx_q, arm.is_circle
        self._s, self._s_gradient = np.zeros(shape[0]), np.zeros(shape)

    def sensing_functions(self, q: Array) -> Array:
        """Return s_c at a configuration (nq,), of shape (number of regions,) [m]."""
        self._sense(q)
        return self._s.copy()

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Act as `UnsafeSet.add_log_bump`."""
        if not self._sense(q):
            return len(self._member_pair) * math.log1p(theta)
        self.clearance.update(q)
        return _accumulate_sensed_bumps(
            self.clearance.distance,
            self.margin,
            self.clearance.gradient,
            self._member_pair,
            self._member_region,
            self._s,
            self._s_gradient,
            theta,
            out_gradient,
        )

    def _sense(self, q: Array) -> bool:
        """Update s_c and gradients; return whether q is inside any sensing region."""
        return _sensing_functions(
            q,
            self._centre,
            self._inverse,
            self._idx_q,
            self._is_circle,
            self.parameters.sensing_distance,
            self._s,
            self._s_gradient,
        )


@compiled
def _sensing_functions(
    q: Array,
    centre: Array,
    inverse: Array,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    sigma: float,
    s: Array,
    s_gradient: Array,
) -> bool:
    error = np.empty(idx_q.shape[0])
    is_inside = False
    for c in range(s.shape[0]):
        joint_error(centre[c], q, idx_q, is_circle, error)
        level = 0.0
        for i in range(error.shape[0]):
            normal = 0.0
            for j in range(error.shape[0]):
                normal += inverse[c, i, j] * error[j]
            level += error[i] * normal
            s_gradient[c, i] = 2.0 * sigma * normal
        s[c] = sigma * (level - 1.0)
        is_inside = is_inside or s[c] < 0.0
    return is_inside


@compiled
def _accumulate_sensed_bumps(
    distance: Array,
    margin: float,
    h_gradient: Array,
    member_pair: NDArray[np.int64],
    member_region: NDArray[np.int64],
    s: Array,
    s_gradient: Array,
    theta: float,
    out_gradient: Array,
) -> float:
    total = 0.0
    for m in range(member_pair.shape[0]):
        k, c = member_pair[m], member_region[m]
        if s[c] >= 0.0:  # another component may touch by the same pair
            total += math.log1p(theta)
            continue
        h = max(distance[k] - margin, 0.0)
        t = h / (h - s[c])
        value, slope = log_inverse_bump(h, h - s[c], theta)
        total += value
        for i in range(out_gradient.shape[0]):
            change = (1.0 - t) * h_gradient[k, i] + t * s_gradient[c, i]
            out_gradient[i] += slope * change
    return total
