"""Velocity fields of the baselines: two potentials and a filter, over the barriers of an arm."""

from dataclasses import dataclass

import daqp
import numpy as np
from numpy.typing import NDArray

from densarm.density.goal_distance import GoalDistance
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, positive
from densarm.world.active_pairs import DistanceBounds, ExactDistances
from densarm.world.world import World

DETECTION_DISTANCE = 0.2
"""Pairs farther apart than this beyond the margin get no row in the filter [m]."""

_LYAPUNOV_RATE = 1.0  # c [1/s]: how fast V shall shrink, per V
_RELAXATION = 10.0  # p, weight of the relaxation δ against the change of the velocity
_REPULSION = 0.01  # η, dimensionless
_SMALLEST_FACTOR, _SMALLEST_GAP = 1e-12, 1e-6  # [m or rad], h in contact
_OPTIMAL = 1  # exit flag of DAQP


class Barriers:
    r"""Functions that are positive where an arm is safe: pairs of bodies, then joint limits.

    .. math::

        h_k = d_k(q) - m, \qquad h = q_i - q_i^{\min}, \quad h = q_i^{\max} - q_i

    Args:
        world: the K pairs, and the arm's limits.
        margin: safety margin m ≥ 0 of the pairs [m].

    Attributes:
        value: h (K + L,) [m, or rad at a revolute joint's limit], overwritten by `update`.
        gradient: its gradients (K + L, nv), overwritten by `update`.
        distances: of all pairs, at the configuration that was updated last.

    Raises:
        InvalidValueError: a negative margin.
    """

    def __init__(self, world: World, margin: float) -> None:
        arm = world.arm
        self.world = world
        self.margin = non_negative("margin", margin)
        bounds = np.concatenate([arm.limits.lower, -arm.limits.upper])
        members: NDArray[np.intp] = np.flatnonzero(np.isfinite(bounds))
        joint = members % arm.nv
        self._index_q = arm.idx_q[joint]
        self._side = np.where(members < arm.nv, 1.0, -1.0)
        self._bound = bounds[members]
        self.distances: DistanceBounds = ExactDistances(np.full(world.n_pairs, np.inf))
        self.value: Array = np.zeros(world.n_pairs + len(members))
        self.gradient: Array = np.zeros((len(self.value), arm.nv))
        self.gradient[world.n_pairs + np.arange(len(members)), joint] = self._side

    def spread(self, pair: float, limit: float) -> Array:
        """Return a vector (K + L,) with one number for every pair and one for every limit."""
        n_pairs = self.world.n_pairs
        return np.repeat([pair, limit], [n_pairs, len(self.value) - n_pairs])

    def update(self, q: Array) -> None:
        """Compute `value` and `gradient` in place at q (nq,)."""
        sample, n_pairs = self.world.clearance(q), self.world.n_pairs
        self.distances = ExactDistances(sample.distance)
        np.subtract(sample.distance, self.margin, out=self.value[:n_pairs])
        self.gradient[:n_pairs] = sample.gradient
        self.value[n_pairs:] = self._side * q[self._index_q] - self._bound


@dataclass(eq=False)
class BarrierField:
    """The pull of the goal, −λ∇V, that barriers bend: a `VelocityField`, each kind in its way."""

    barriers: Barriers
    """h_k, joint limits included."""
    goal: Array
    """Configuration (nq,)."""
    goal_distance: GoalDistance
    """V."""
    rate: float
    """λ [1/s], velocity per ∇V."""

    def __post_init__(self) -> None:
        self._slope = np.zeros(self.barriers.world.arm.nv)

    @property
    def distances(self) -> DistanceBounds:
        """As `VelocityField.distances`."""
        return self.barriers.distances

    def velocity(self, q: Array, metric: Array | None) -> tuple[Array, float]:
        """Act as `VelocityField.velocity`."""
        self.barriers.update(q)
        distance = self.goal_distance.evaluate(q, self.goal, self._slope)
        velocity = self.rate * (self._push(distance) - self._slope)
        if metric is not None:
            velocity = np.asarray(np.linalg.solve(metric, velocity), dtype=np.float64)
        way_left = float(np.linalg.norm(self.barriers.world.arm.difference(self.goal, q)))
        return self._admitted(velocity, distance), way_left

    def _push(self, distance: float) -> Array | float:  # noqa: ARG002
        """Return what adds to −∇V (nv,) [1/rad or 1/m], V being given."""
        return 0.0

    def _admitted(self, velocity: Array, distance: float) -> Array:  # noqa: ARG002
        """Return the velocity in place of the one that is wanted (nv,), V being given."""
        return velocity


@dataclass(eq=False)
class JointPotentialField(BarrierField):
    r"""Khatib's attractive and repulsive potential on the joint space of an arm, k = λ∇φ.

    .. math::

        \phi(q) = -V(q) - \frac{\eta}{2} \sum_{h_k < h_0} \left(\frac{h_0}{h_k} - 1\right)^2

    Raises:
        InvalidValueError: a parameter ≤ 0.

    Source: O. Khatib, IJRR 5(1), 1986, with η h_0² in place of his η, which has a unit.
    """

    pair_influence: float
    """h_0 > 0 of the pairs, below which they repel [m]."""
    limit_influence: float
    """h_0 > 0 of the joint limits [rad or m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._influence = self.barriers.spread(
            positive("pair_influence", self.pair_influence),
            positive("limit_influence", self.limit_influence),
        )

    def _push(self, distance: float) -> Array:  # noqa: ARG002
        h = np.maximum(self.barriers.value, _SMALLEST_GAP)
        excess = np.maximum(self._influence / h - 1.0, 0.0)
        return np.asarray(_REPULSION * excess * self._influence / h**2 @ self.barriers.gradient)


@dataclass(eq=False)
class JointNavigationFunction(BarrierField):
    r"""Rimon and Koditschek's function of the clearances of an arm, by logarithms, k = λV∇φ.

    .. math::

        \psi = \frac{V}{(V^\kappa + \beta)^{1/\kappa}}, \quad \beta = \prod_k h_k, \qquad
        \phi = \frac{1}{\kappa} \ln\beta - \ln V

    ψ falls where φ grows, and φ neither over- nor underflows. It is a navigation function, with
    no maximum but the goal, on sphere worlds for κ large enough; the free joint space of an arm
    is none.

    Raises:
        InvalidValueError: κ ≤ 0.

    Source: E. Rimon, D. E. Koditschek, IEEE T-RA 8(5), 1992.
    """

    kappa: float
    """κ > 0, dimensionless."""

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("kappa", self.kappa)

    def _push(self, distance: float) -> Array:
        h = np.maximum(self.barriers.value, _SMALLEST_FACTOR)
        return np.asarray(distance / self.kappa / h @ self.barriers.gradient)


@dataclass(eq=False)
class BarrierFilter(BarrierField):
    r"""The velocity next to the goal's pull that keeps every barrier; zero where none does.

    .. math::

        \min_{\dot q, \delta} \|\dot q - k_{nom}\|^2 + p \delta^2 \quad \text{subject to} \quad
        \nabla h_k \cdot \dot q \ge -\gamma h_k, \quad
        \frac{\nabla V \cdot \dot q + c V}{\|\nabla V\|} \le \delta, \quad
        |\dot q_i| \le v_i^{\max}

    with k_nom = −λ∇V shortened to the velocity limits. V is the control Lyapunov function, whose
    row δ relaxes. Shortening the solution, as the speed law does, keeps every row of a barrier that
    is not negative.

    Raises:
        InvalidValueError: γ ≤ 0.

    Source: A. D. Ames et al., Control Barrier Functions: Theory and Applications, ECC 2019;
        solver: D. Arnström et al., IEEE TAC 67(8), 2022.
    """

    barrier_rate: float
    """γ [1/s]: how fast h may shrink, per h."""

    def __post_init__(self) -> None:
        super().__post_init__()
        positive("barrier_rate", self.barrier_rate)
        arm = self.barriers.world.arm
        self._detection = self.barriers.spread(DETECTION_DISTANCE, np.inf)
        self._bound = np.append(arm.limits.velocity, np.inf)
        self._hessian = np.diag(np.append(np.ones(arm.nv), _RELAXATION))

    def _admitted(self, velocity: Array, distance: float) -> Array:
        steepness = float(np.linalg.norm(self._slope))
        if steepness == 0.0:
            return np.zeros_like(velocity)
        nominal = velocity / max(1.0, float((np.abs(velocity) / self._bound[:-1]).max()))
        h = self.barriers.value
        near = np.flatnonzero(h < self._detection)
        rows = np.zeros((1 + len(near), len(nominal) + 1))
        rows[0, :-1], rows[0, -1] = -self._slope / steepness, 1.0
        rows[1:, :-1] = self.barriers.gradient[near]
        floor = np.append(_LYAPUNOV_RATE * distance / steepness, -self.barrier_rate * h[near])
        solution, _, flag, _ = daqp.solve(
            self._hessian,
            np.append(-nominal, 0.0),
            rows,
            np.append(self._bound, np.full(len(rows), np.inf)),
            np.concatenate([-self._bound, floor]),
        )
        return np.asarray(solution[:-1]) if flag == _OPTIMAL else np.zeros_like(nominal)
