"""JointSpaceCover: the unsafe set of an arm, sensed in convex regions of its joint space."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from densarm.arms.arm import Arm
from densarm.arms.joint_space import joint_error
from densarm.density.inverse_bump import log_inverse_bump
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive, positive_integer
from densarm.values.kernels import compiled
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

MAX_JOINTS = 3
"""The number of cells grows as their number per joint to this power."""

_TOLERANCE = 1e-2  # on the optimality of the volume of an ellipsoid alone
_MOST_ITERATIONS = 10_000
_ENCLOSING = 1.0 + 1e-9  # so that rounding leaves no point outside

Cell = tuple[int, ...]


@dataclass(frozen=True)
class Ellipsoid:
    """Points {c + e : eᵀ S⁻¹ e ≤ 1}."""

    centre: Array
    """c, shape (n,) [rad or m]."""
    shape: Array
    """S (n, n), symmetric and positive definite; its eigenvalues are the squared semi-axes."""

    @property
    def semi_axes(self) -> Array:
        """Semi-axes, ascending, shape (n,) [rad or m]."""
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.shape)))

    @property
    def extent(self) -> Array:
        """Half of the width along each coordinate, shape (n,) [rad or m]."""
        return np.asarray(np.sqrt(np.diag(self.shape)))

    def level(self, points: Array) -> Array:
        """Return eᵀ S⁻¹ e at points (..., n): at most 1 inside, of shape (...)."""
        error = points - self.centre
        return np.asarray(np.sum(error * (error @ np.linalg.inv(self.shape)), axis=-1))

    def inflated(self, by: float) -> "Ellipsoid":
        """Return the ellipsoid with every semi-axis longer by so much [rad or m].

        Besides room it gains roundness: the ratio of the semi-axes comes closer to one.
        """
        squares, axes = np.linalg.eigh(self.shape)
        longer = np.sqrt(squares) + non_negative("by", by)
        return Ellipsoid(self.centre, (axes * longer**2) @ axes.T)


def enclosing_ellipsoid(points: Array) -> Ellipsoid:
    """Return the ellipsoid of (nearly) least volume that contains points.

    Args:
        points: shape (M, n), not all in one hyperplane [rad or m].

    Returns:
        An ellipsoid that contains every point; only its volume is approximate.

    Source: L. G. Khachiyan, Rounding of polytopes in the real number model of computation,
        Mathematics of Operations Research 21(2), 1996.
    """
    count, n = points.shape
    lifted = np.column_stack([points, np.ones(count)])
    weight = np.full(count, 1.0 / count)
    for _ in range(_MOST_ITERATIONS):
        spread = np.linalg.inv((lifted.T * weight) @ lifted)
        level = np.sum((lifted @ spread) * lifted, axis=1)
        farthest = int(level.argmax())
        excess = level[farthest] - n - 1.0
        if excess < _TOLERANCE:
            break
        step = excess / ((n + 1.0) * (level[farthest] - 1.0))
        weight *= 1.0 - step
        weight[farthest] += step
    centre = weight @ points
    error = points - centre
    ellipsoid = Ellipsoid(centre, n * (error.T * weight) @ error)
    return Ellipsoid(centre, ellipsoid.shape * _ENCLOSING * ellipsoid.level(points).max())


@dataclass(frozen=True)
class UnsafeComponent:
    """Cells of the joint space, connected by their faces, edges or corners."""

    centre: Array
    """Centres (C, nv) [rad or m]; on continuous joints unwrapped, so that neighbours are near."""
    half_width: Array
    """Half of a cell's width along each joint, shape (nv,) [rad or m]."""
    pairs: NDArray[np.int64]
    """Indices of the geometry pairs that may touch in these cells."""

    @property
    def corners(self) -> Array:
        """The corners of the cells, each once, shape (M, nv) [rad or m]."""
        steps = np.round((self.centre - self.centre[0]) / (2.0 * self.half_width)).astype(np.int64)
        ends = np.array(list(product((0, 1), repeat=len(self.half_width))))
        corner = np.unique((steps[:, np.newaxis] + ends).reshape(-1, ends.shape[1]), axis=0)
        origin = self.centre[0] - self.half_width
        return np.asarray(origin + 2.0 * self.half_width * corner)


def unsafe_components(check: SweptCheck, depth: int = 8) -> tuple[UnsafeComponent, ...]:
    r"""Map the unsafe set to joint space by coal: the cells that are not proved free of contact.

    The joint space is halved along every joint, `depth` times. A cell with centre c and half
    width η is clear of pair k, and dropped, where

    .. math:: d_k(c) > m + \sum_j r_{kj} \eta_j,

    m and r the margin and the Lipschitz constants: every unsafe configuration lies in a cell
    that is kept.

    Args:
        check: the margin, and the world of an arm with at most `MAX_JOINTS` joints.
        depth: number of halvings; 2^depth cells per joint.

    Returns:
        The connected components of the cells that are left.

    Raises:
        InvalidValueError: too many joints, a joint with an infinite range, or a component that
            winds around a continuous joint.
    """
    arm, world = check.arm, check.world
    lower, span = _ranges(arm)
    index = np.zeros((1, arm.nv), dtype=np.int64)
    halves = np.array(list(product((0, 1), repeat=arm.nv)))
    for level in range(1, positive_integer("depth", depth) + 1):
        index = (2 * index[:, np.newaxis] + halves).reshape(-1, arm.nv)
        width = span / 2.0**level
        centre = arm.configurations(lower + (index + 0.5) * width)
        margin = np.reshape([check.distance_margin(q) for q in centre], (-1, world.n_pairs))
        near = margin <= world.motion_bound(0.5 * width)
        index, near = index[near.any(axis=1)], near[near.any(axis=1)]
    row_of = {cell: row for row, cell in enumerate(map(tuple, index.tolist()))}
    period = np.where(arm.continuous, 2**depth, 0)
    return tuple(
        UnsafeComponent(
            lower + (np.array(list(member.values())) + 0.5) * width,
            0.5 * width,
            np.flatnonzero(near[[row_of[cell] for cell in member]].any(axis=0)),
        )
        for member in _connected(set(row_of), period, arm)
    )


def _ranges(arm: Arm) -> tuple[Array, Array]:
    """Return where each joint's range begins and how long it is, (nv,) each [rad or m]."""
    if arm.nv > MAX_JOINTS:
        raise InvalidValueError("number of joints", arm.nv, f"at most {MAX_JOINTS}")
    lower = np.where(arm.continuous, -np.pi, arm.limits.lower)
    span = np.where(arm.continuous, 2.0 * np.pi, arm.limits.upper - lower)
    if not np.isfinite(span).all():
        raise InvalidValueError("range of the joints", span, "finite")
    return lower, span


def _connected(left: set[Cell], period: NDArray[np.int64], arm: Arm) -> Iterator[dict[Cell, Cell]]:
    """Yield components as cell to unwrapped cell; `period` is 0 for a joint that is bounded."""
    neighbours = list(product((-1, 0, 1), repeat=arm.nv))
    while left:
        first = min(left)
        left.remove(first)
        unwrapped, border = {first: first}, [first]
        while border:
            here = unwrapped[border.pop()]
            for offset in neighbours:
                there = tuple(a + b for a, b in zip(here, offset, strict=True))
                cell = tuple(a % n if n else a for a, n in zip(there, period.tolist(), strict=True))
                if cell in left:
                    left.remove(cell)
                    unwrapped[cell] = there
                    border.append(cell)
                elif unwrapped.get(cell, there) != there:
                    joint = arm.joint_names[np.flatnonzero(np.subtract(unwrapped[cell], there))[0]]
                    allowed = "one that does not wind around a continuous joint"
                    raise InvalidValueError("unsafe component", f"around joint {joint}", allowed)
        yield unwrapped


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
        world: the pairs.
        margin: m ≥ 0 [m].
        depth: halvings of the joint space, as `unsafe_components` has them.
        inflation: by how much the semi-axes of a sensing region exceed those of the ellipsoid
            around its part of the unsafe set [rad or m]: the more, the rounder.
        sensing_distance: σ [m]: the larger against the clearance on the rim, the later the bump
            falls off, and the more its level sets take the shape of the rim instead of the unsafe
            set's.

    Attributes:
        regions: the sensing regions, in joint positions; less than a turn wide.

    Raises:
        InvalidValueError: a number out of its range, as `unsafe_components`, or a sensing region a
            turn wide or wider.
    """

    def __init__(
        self,
        world: World,
        margin: float = 0.0,
        *,
        depth: int = 8,
        inflation: float = 0.4,
        sensing_distance: float = 0.2,
    ) -> None:
        arm = world.arm
        self.world = world
        self.margin = margin
        self._sigma = positive("sensing_distance", sensing_distance)
        positive("inflation", inflation)
        components = unsafe_components(SweptCheck(world, margin), depth)
        self.regions = tuple(
            enclosing_ellipsoid(component.corners).inflated(inflation) for component in components
        )
        for region in self.regions:
            width = 2.0 * region.extent[arm.continuous].max(initial=0.0)
            if width >= 2.0 * np.pi:
                raise InvalidValueError("width of a sensing region", width, "below 2π rad")
        shape = (len(components), arm.nv)
        self._centre = arm.configurations(np.reshape([e.centre for e in self.regions], shape))
        inverses = [np.linalg.inv(region.shape) for region in self.regions]
        self._inverse = np.reshape(inverses, (*shape, arm.nv))
        self._members = [(c, int(k)) for c, part in enumerate(components) for k in part.pairs]
        self._joint_index = arm.joint_index
        self._s, self._s_gradient = np.zeros(shape[0]), np.zeros(shape)

    def sensing_functions(self, q: Array) -> Array:
        """Return s_c at a configuration (nq,), of shape (number of regions,) [m]."""
        self._sense(q)
        return self._s.copy()

    def add_log_bump(self, q: Array, theta: float, out_gradient: Array) -> float:
        """Act as `UnsafeSet.add_log_bump`."""
        free = math.log1p(theta)
        if not self._sense(q):
            return len(self._members) * free
        sample, total = self.world.clearance(q), 0.0
        for c, k in self._members:
            s = self._s[c]
            if s >= 0.0:  # another component may touch by the same pair
                total += free
                continue
            h = max(sample.distance[k] - self.margin, 0.0)
            t = h / (h - s)
            value, slope = log_inverse_bump(h, h - s, theta)
            total += value
            change = (1.0 - t) * sample.gradient[k] + t * self._s_gradient[c]
            out_gradient += slope * change
        return total

    def _sense(self, q: Array) -> bool:
        """Update s_c and gradients; return whether q is inside any sensing region."""
        return _sensing_functions(
            q,
            self._centre,
            self._inverse,
            self._joint_index,
            self._sigma,
            self._s,
            self._s_gradient,
        )


@compiled
def _sensing_functions(
    q: Array,
    centre: Array,
    inverse: Array,
    joint_index: NDArray[np.int64],
    sigma: float,
    s: Array,
    s_gradient: Array,
) -> bool:
    error = np.empty(joint_index.shape[1])
    is_inside = False
    for c in range(s.shape[0]):
        joint_error(centre[c], q, joint_index, error)
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
