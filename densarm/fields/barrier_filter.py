"""BarrierFilter: the goal's pull, filtered by control barrier functions in a quadratic program."""

from dataclasses import dataclass

import daqp
import numpy as np

from densarm.arrays import Array
from densarm.density.distance_bounds import DistanceBounds, ExactDistances
from densarm.density.goal_distance import GoalDistance
from densarm.fields.barriers import Barriers
from densarm.fields.speed_law import SpeedLaw
from densarm.validation import positive

_OPTIMAL = 1  # exit flag of DAQP


@dataclass(frozen=True)
class BarrierParameters:
    """Parameters of the filter.

    Raises:
        InvalidValueError: a value that is not positive.
    """

    barrier_rate: float = 5.0
    """γ [1/s]: how fast h may shrink, per h."""
    detection_distance: float = 0.2
    """Pairs farther apart than this beyond the margin get no row [m]."""
    lyapunov_rate: float = 1.0
    """c [1/s]: how fast V shall shrink, per V."""
    relaxation: float = 10.0
    """p, weight of the relaxation δ against the change of the velocity, dimensionless."""

    def __post_init__(self) -> None:
        for name in ("barrier_rate", "detection_distance", "lyapunov_rate", "relaxation"):
            positive(name, getattr(self, name))


class BarrierFilter:
    r"""The velocity next to the goal's pull that keeps every barrier.

    .. math::

        \min_{\dot q, \delta} \|\dot q - k_{nom}\|^2 + p \delta^2 \quad \text{subject to} \quad
        \nabla h_k \cdot \dot q \ge -\gamma h_k, \quad
        \frac{\nabla V \cdot \dot q + c V}{\|\nabla V\|} \le \delta, \quad
        |\dot q_i| \le v_i^{\max}

    with k_nom = −λ∇V shortened to the velocity limits. The solution goes no faster than the speed
    law allows; shortening keeps every row of a barrier that is not negative.

    Args:
        barriers: h_k, joint limits included.
        goal_distance: V, the control Lyapunov function; δ relaxes its row.
        speed_law: the speed law.
        rate: λ [1/s], velocity per ∇V.
        parameters: γ, c, p and the detection distance.

    Source: A. D. Ames et al., Control Barrier Functions: Theory and Applications, ECC 2019;
        solver: D. Arnström et al., IEEE TAC 67(8), 2022.
    """

    def __init__(
        self,
        barriers: Barriers,
        goal_distance: GoalDistance,
        speed_law: SpeedLaw,
        rate: float,
        parameters: BarrierParameters = BarrierParameters(),
    ) -> None:
        arm = barriers.clearance.arm
        self.barriers = barriers
        self.goal_distance = goal_distance
        self.speed_law = speed_law
        self._rate = rate
        self._parameters = parameters
        self._slope = np.zeros(arm.nv)
        self._detection = barriers.spread(parameters.detection_distance, np.inf)
        self._bound = np.append(arm.limits.velocity, np.inf)
        self._hessian = np.diag(np.append(np.ones(arm.nv), parameters.relaxation))

    @property
    def distances(self) -> DistanceBounds:
        """As `VelocityField.distances`."""
        return ExactDistances(self.barriers.clearance.distance)

    def restart(self) -> None:
        """Act as `VelocityField.restart`, with nothing to forget."""

    def update(self, q: Array) -> Array:
        """Return k (nv,) at q (nq,) [rad/s or m/s]; zero where no velocity keeps every row."""
        self.barriers.update(q)
        value = self.goal_distance.evaluate(q, self._slope)
        steepness = float(np.linalg.norm(self._slope))
        if steepness == 0.0:
            return np.zeros_like(self._slope)
        velocity = self._filter(self._nominal(), value / steepness, self._slope / steepness)
        way_left = float(np.linalg.norm(self.goal_distance.error(q)))
        return self.speed_law.limit(q, velocity, self.distances, way_left)

    def _nominal(self) -> Array:
        velocity = -self._rate * self._slope
        return np.asarray(velocity / max(1.0, float((np.abs(velocity) / self._bound[:-1]).max())))

    def _filter(self, nominal: Array, distance: float, ascent: Array) -> Array:
        """Return the solution (nv,), V and ∇V given in units of ‖∇V‖."""
        p, h = self._parameters, self.barriers.value
        near = np.flatnonzero(h < self._detection)
        rows = np.zeros((1 + len(near), len(nominal) + 1))
        rows[0, :-1], rows[0, -1] = -ascent, 1.0
        rows[1:, :-1] = self.barriers.gradient[near]
        floor = np.append(p.lyapunov_rate * distance, -p.barrier_rate * h[near])
        solution, _, flag, _ = daqp.solve(
            self._hessian,
            np.append(-nominal, 0.0),
            rows,
            np.append(self._bound, np.full(len(rows), np.inf)),
            np.concatenate([-self._bound, floor]),
        )
        return np.asarray(solution[:-1]) if flag == _OPTIMAL else np.zeros_like(nominal)
