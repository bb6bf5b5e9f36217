"""ControlDensity: the control density function's quadratic program."""

import daqp
import numpy as np

from densarm.control.controller import Gains
from densarm.density.critical_points import find_stall
from densarm.density.goal_distance import GoalDistance
from densarm.density.navigation_density import DensityParameters, NavigationDensity
from densarm.density.sub_goals import CRITICAL_SLOPE
from densarm.density.unsafe_sets import SensingParameters, sensed_sets
from densarm.values.arrays import Array
from densarm.world.active_pairs import DistanceBounds
from densarm.world.world import World

STEP = 1e-3
"""ε, how far the neighbours are of which the program takes ∇·u [rad or m]."""

_OPTIMAL = 1  # exit flag of DAQP


class ControlDensity:
    r"""The shortest velocity along which the density's flow does not contract: a `VelocityField`.

    .. math:: \min \|u\|^2 \quad \text{subject to} \quad \nabla \cdot (\rho (f + g u)) \ge 0

    An arm under inverse dynamics is the integrator q̇ = u: f = 0, g = 1. Divided by ρ > 0 that is
    ∇L·u + ∇·u ≥ 0 with L = ln ρ. As ∇·u is not known of one point, u⁰ at z⁰ = q is found together
    with velocities uⁱ at its neighbours zⁱ = q ⊕ ε eᵢ,

    .. math::

        \min \sum_{i=0}^{n} \|u^i\|^2 \quad \text{subject to} \quad
        \nabla L(z^i) \cdot u^i \ge \beta, \qquad
        \Big| \sum_{i=1}^{n} (u^i_i - u^0_i)/\epsilon \Big| \le \beta.

    Where the last row is not active u = β ∇L/‖∇L‖², a feedback of which the sum is ∇·u up to ε.
    Where it is, the neighbours' own programs may have other solutions than uⁱ, and the condition is
    not shown for the feedback. β = 2αλ gives the pull −λe near the goal. α is the number of joints:
    in free space the condition asks for more than half of it. Towards a critical point of ρ u grows
    without bound, so that the arm shakes where the plain density would rest.

    Args:
        world: the arm among obstacles.
        goal: configuration (nq,).
        goal_distance: V.
        sensing: sensing distances.
        margin: safety margin m of the pairs [m].
        gains: λ = K_p/K_v [1/s].

    Attributes:
        bound: β [1/s].
        divergence: ∇·u of the last solution as the program has it [1/s].

    Source: J. Moyalan, S. S. K. S. Narayanan, A. Zheng, U. Vaidya, ACC 2024, arXiv 2403.14464,
        eq. 8 to 14 and Algorithm 1, read whole. The integrator in place of the arm is what they do
        with a car; the choice of α and β and the closed form are densarm's own. Solver: D.
        Arnström et al., IEEE TAC 67(8), 2022.
    """

    def __init__(
        self,
        world: World,
        goal: Array,
        goal_distance: GoalDistance,
        sensing: SensingParameters,
        margin: float = 0.0,
        gains: Gains = Gains(),
    ) -> None:
        n = world.arm.nv
        self._pairs, self._limits = unsafe = sensed_sets(world, margin, sensing)
        parameters = DensityParameters(alpha=float(n))
        self.density = NavigationDensity(world.arm, goal, unsafe, goal_distance, parameters)
        self.bound = 2.0 * n * gains.rate
        self.divergence = 0.0
        # q is the last, so that distances are its own afterwards.
        self._steps = np.vstack([STEP * np.eye(n), np.zeros(n)])
        self._divergence_row = np.vstack([np.eye(n), -np.ones(n)]).ravel() / STEP

    @property
    def distances(self) -> DistanceBounds:
        """As `VelocityField.distances`."""
        return self._pairs.pairs

    def velocity(self, q: Array, metric: Array | None) -> tuple[Array, float]:
        """Act as `VelocityField.velocity`."""
        slopes = self.density.log_gradients(q, self._steps)
        velocity = self._solution(slopes)
        if metric is not None:
            velocity = np.asarray(np.linalg.solve(metric, velocity), dtype=np.float64)
        return velocity, float(np.linalg.norm(self.density.error(q)))

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the density leads nowhere from q (nq,), and what blocks it."""
        return find_stall(self.density, self._pairs, self._limits, q).description

    def _solution(self, slopes: Array) -> Array:
        """Return u⁰ (nv,) for ∇L at the neighbours and at q (nv + 1, nv); zero where critical."""
        steepness = np.linalg.norm(slopes, axis=1)
        if not (steepness > CRITICAL_SLOPE).all():
            return np.zeros(slopes.shape[1])
        count, n = slopes.shape
        least = self.bound / steepness
        closest = (least / steepness)[:, np.newaxis] * slopes
        self.divergence = float(self._divergence_row @ closest.ravel())
        if abs(self.divergence) <= self.bound:
            return np.asarray(closest[-1])
        # In units of the solution without the last row, whose lengths span many decades.
        unit = float(least.max())
        rows = np.zeros((count + 1, count * n))
        for i in range(count):
            rows[i, i * n : (i + 1) * n] = slopes[i] / steepness[i]
        scale = STEP / np.sqrt(2.0 * n)
        rows[-1] = scale * self._divergence_row
        width = scale * self.bound / unit
        solution, _, flag, _ = daqp.solve(
            np.eye(count * n),
            np.zeros(count * n),
            rows,
            np.append(np.full(count, np.inf), width),
            np.append(least / unit, -width),
        )
        if flag != _OPTIMAL:
            return np.zeros(n)
        self.divergence = unit * float(self._divergence_row @ solution)
        return unit * np.asarray(solution[-n:])
