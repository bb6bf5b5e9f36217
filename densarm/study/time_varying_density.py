"""TimeVaryingDensity: the density among obstacles, and of a goal, that move."""

import numpy as np

from densarm.control.controller import Gains
from densarm.density.critical_points import find_stall
from densarm.density.goal_distance import GoalDistance
from densarm.density.inverse_bump import log_inverse_bump
from densarm.density.navigation_density import V_MIN, Gauge, NavigationDensity
from densarm.density.unsafe_sets import SensingParameters, sensed_sets
from densarm.values.arrays import Array
from densarm.values.checks import positive
from densarm.world.active_pairs import DistanceBounds
from densarm.world.world import World

_DECAY = 8.0  # γ [1/s]


class TimeVaryingDensity:
    r"""The gradient of ρ(q, t) as the scene stands, and no faster a fall of ρ: a `VelocityField`.

    .. math::

        \rho(q, t) = \frac{\prod_k \Psi_k(q, t)}{V(q \ominus q_d(t))^\alpha}, \qquad
        k_0 = \lambda \nabla(-1/\rho) + \dot q_d, \qquad L = \ln\rho, \\
        k = k_0 + \frac{\max\{0,\ -\gamma - \partial_t L - \nabla L \cdot k_0\}}{\|\nabla L\|^2}
        \nabla L, \qquad
        \partial_t L = \sum_k \frac{\partial \ln\Psi_k}{\partial h_k}\, n_k \cdot w_k
        + \frac{\alpha}{V} \nabla V \cdot \dot q_d

    n_k is the normal from body 1 to body 2 of a pair and w_k the velocity of an obstacle that is
    body 2, as the difference of its positions at two calls: obstacles are moved by
    `World.move_obstacle`, and do not turn. k is the velocity nearest to k_0 along which ln ρ falls
    by at most γ per second; where nothing moves it is k_0, the plain density's.

    Args:
        world: the arm among obstacles, which may be moved between two calls.
        goal: configuration (nq,).
        goal_distance: V.
        sensing: sensing distances.
        margin: safety margin m of the pairs [m].
        gains: λ = K_p/K_v [1/s].
        period: time between two calls [s].
        decay: γ > 0 [1/s].

    Source: S. S. K. S. Narayanan, J. Moyalan, U. Vaidya, arXiv 2411.12206, of which the abstract
        and the code (github.com/sriram-2502/time_varying_density) were read, not the text: from
        there are ρ(x, t), u = λ ∇_x ρ(x, t) and inverse dynamics around it. −1/ρ in place of ρ,
        q̇_d in k_0, ∂L/∂t, γ and the correction are densarm's own.
    """

    def __init__(
        self,
        world: World,
        goal: Array,
        goal_distance: GoalDistance,
        sensing: SensingParameters,
        margin: float = 0.0,
        gains: Gains = Gains(),
        period: float = 0.001,
        decay: float = _DECAY,
    ) -> None:
        self._world, self._rate = world, gains.rate
        self._pairs, self._limits = unsafe = sensed_sets(world, margin, sensing)
        self.density = NavigationDensity(world.arm, goal, unsafe, goal_distance)
        self._period, self._decay = positive("period", period), positive("decay", decay)
        self._goal_velocity = np.zeros(world.arm.nv)
        self._version, self._position = world.version, self._positions()
        self._velocity: dict[str, Array] = {}

    @property
    def distances(self) -> DistanceBounds:
        """As `VelocityField.distances`."""
        return self._pairs.pairs

    def set_goal(self, q: Array, velocity: Array) -> None:
        """Move the goal to q_d (nq,), which moves on at a velocity (nv,) [rad/s or m/s]."""
        self.density.set_goal(q)
        self._goal_velocity[:] = velocity

    def log_density(self, q: Array) -> tuple[float, Array, float]:
        """Return ln ρ at q (nq,), its gradient (nv,) [1/rad or 1/m] and ∂ ln ρ/∂t [1/s].

        To be called once a period: obstacles count as having moved since the last call.
        """
        if self._world.version != self._version:
            before, self._position = self._position, self._positions()
            self._version = self._world.version
            moves = {name: p - before.get(name, p) for name, p in self._position.items()}
            self._velocity = {name: w / self._period for name, w in moves.items() if w.any()}
        else:
            self._velocity = {}
        density = self.density
        density.update(q)
        slope = np.empty(self._world.arm.nv)
        density.write_gradient(Gauge.LOG, slope)
        pull = float(density.goal_distance_gradient @ self._goal_velocity)
        change = density.parameters.alpha * pull / max(density.goal_distance_value, V_MIN)
        return density.log_value(), slope, change + self._approach()

    def velocity(self, q: Array, metric: Array | None) -> tuple[Array, float]:
        """Act as `VelocityField.velocity`; where ρ would fall too fast, no end is in sight."""
        _, slope, change = self.log_density(q)
        velocity = np.empty_like(slope)
        self.density.write_gradient(Gauge.RECIPROCAL, velocity)
        velocity *= self._rate
        if metric is not None:
            velocity = np.asarray(np.linalg.solve(metric, velocity), dtype=np.float64)
        velocity += self._goal_velocity
        lacking = -self._decay - change - float(slope @ velocity)
        if lacking <= 0.0:
            return velocity, float(np.linalg.norm(self.density.error(q)))
        return velocity + lacking / max(float(slope @ slope), V_MIN) * slope, np.inf

    def describe_stall(self, q: Array) -> str:
        """Return, as a phrase, why the density leads nowhere from q (nq,), and what blocks it."""
        return find_stall(self.density, self._pairs, self._limits, q).description

    def _positions(self) -> dict[str, Array]:
        return {item.name: np.array(item.position) for item in self._world.scene}

    def _approach(self) -> float:
        """Return Σ ∂lnΨ/∂h n · w over the pairs of obstacles that move [1/s]."""
        if not self._velocity:
            return 0.0
        unsafe, rows, total = self._pairs, self._pairs.pairs.rows, 0.0
        for k in np.flatnonzero(unsafe.pairs.state).tolist():
            shape = self._world.pairs[k][1]
            w = self._velocity.get(shape, self._velocity.get(shape.rpartition(".")[0]))
            if w is not None:
                h, width = rows[k, 0] - unsafe.margin, unsafe.sensing_distance[k]
                slope = log_inverse_bump(h, width, self.density.parameters.theta)[1]
                total += slope * float(rows[k, 1:4] @ w)
        return total
