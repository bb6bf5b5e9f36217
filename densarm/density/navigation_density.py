"""Navigation density: one scalar field that vanishes on unsafe sets and peaks at the goal."""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike

from densarm.arms.joint_space import ConfigurationSpace
from densarm.density.goal_distance import GoalDistance, TorusDistance, checked_weights
from densarm.density.inverse_bump import smooth_step
from densarm.density.unsafe_sets import Curved, SensingParameters, UnsafeSet, sensed_sets
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.checks import non_negative, one_of, positive
from densarm.values.documented import documented, in_short
from densarm.values.kernels import compiled
from densarm.world.world import World

LOG_MAX = math.log(sys.float_info.max)
"""Logarithm of the largest double."""

LOG_SATURATION = math.log(1e150)
"""Entries of a gradient are held below 1e150 in magnitude, so that its norm is a double too."""

V_MIN = sys.float_info.min
"""Below this V counts as this, where its logarithm is needed."""


class Gauge(StrEnum):
    """Functions of ρ whose gradients share their direction, hence their integral curves.

    Modifications that depend on the length of the gradient (a blend at the goal, clipping per
    joint, acceleration limits) tell the gauges apart.
    """

    DENSITY = "density"
    """∇ρ, the field of [ZNV] eq. 11: singular at the goal, flat in contact."""
    LOG = "log"
    """∇ ln ρ."""
    RECIPROCAL = "reciprocal"
    """∇(−1/ρ): smooth and zero at the goal for α = 1, unbounded in contact for θ = 0."""


@documented
@dataclass(frozen=True)
class DensityParameters:
    """Parameters of a navigation density.

    Raises:
        InvalidValueError: a parameter out of its range.
    """

    alpha: float = 1.0
    """Exponent α > 0 of the goal distance, dimensionless."""
    theta: float = 0.0
    """Shift θ ≥ 0 of the inverse bumps, dimensionless; above 0 obstacles can be entered."""
    gauge: Gauge = Gauge.RECIPROCAL
    """The gauge of `DensitySample.blended_gradient`, or its name."""
    blend_radius: float = 0.0
    """δ ≥ 0 of [ZNV] Remark 2, rad or m in the norm of the goal error; 0 blends nothing."""
    weights: tuple[float, ...] | str | None = None
    """Weights of the goal distance V, one per joint [rad⁻² or m⁻²], "inertia" for those of the
    arm's masses, None for ones. They lead the planning system and regulation; the feedback of
    tracking has ones, for K_p to be the same in all joints."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", checked_weights("weights", self.weights))
        positive("alpha", self.alpha)
        non_negative("theta", self.theta)
        non_negative("blend_radius", self.blend_radius)
        object.__setattr__(self, "gauge", Gauge(one_of("gauge", self.gauge, list(Gauge))))


@documented
@dataclass(frozen=True)
class DensitySample:
    """A navigation density and its parts at one configuration."""

    log_psi: float
    """ln Ψ = Σ ln Ψ_k; −inf in contact for θ = 0."""
    log_psi_gradient: Array
    """∇ ln Ψ [1/rad or 1/m], shape (nv,)."""
    goal_distance: float
    """V."""
    goal_distance_gradient: Array
    """∇V [1/rad or 1/m], shape (nv,)."""
    goal_error: Array
    """e = q ⊖ q_goal [rad or m], shape (nv,)."""
    parameters: DensityParameters
    """Parameters of the density."""

    @property
    def log_value(self) -> float:
        """L = ln Ψ − α ln V: −inf in contact for θ = 0, else +inf at the goal."""
        if self.goal_distance == 0.0:
            return -math.inf if self.log_psi == -math.inf else math.inf
        return self.log_psi - self.parameters.alpha * math.log(self.goal_distance)

    @property
    def value(self) -> float:
        """ρ = Ψ/V^α, infinite where it exceeds the doubles. Source: [ZNV] eq. 4."""
        return math.exp(self.log_value) if self.log_value <= LOG_MAX else math.inf

    @property
    def log_gradient(self) -> Array:
        """∇L, shape (nv,), as `gradient` has it."""
        return self.gradient(Gauge.LOG)

    def gradient(self, gauge: Gauge) -> Array:
        r"""Return the gradient of the density in a gauge.

        .. math::

            w = V \nabla\ln\Psi - \alpha \nabla V, \qquad
            \nabla\rho = \frac{\Psi}{V^{\alpha+1}} w, \quad
            \nabla\ln\rho = \frac{1}{V} w, \quad
            \nabla(-1/\rho) = \frac{V^{\alpha-1}}{\Psi} w

        All three are positive multiples of w: zero where w is, the goal included, and scaled
        down to entries of at most 1e150 where they are longer.

        Args:
            gauge: which of the three.

        Returns:
            Tangent-space gradient [1/rad or 1/m, in the unit of the gauge's function], (nv,).

        Source: [ZNV] eq. 11.
        """
        out = np.empty_like(self.goal_distance_gradient)
        write_gauge_gradient(
            self.log_psi_gradient,
            self.goal_distance,
            self.goal_distance_gradient,
            self.parameters.alpha,
            self.log_psi,
            *gauge_exponents(gauge, self.parameters.alpha),
            out,
        )
        return out

    def blended_gradient(self) -> Array:
        """Return the gradient (nv,) in the density's own gauge, `blended` near the goal."""
        gradient = self.gradient(self.parameters.gauge)
        return blended(gradient, self.goal_error, self.parameters.blend_radius)


class NavigationDensity:
    r"""The density of where an arm may spend its time.

    .. math:: \rho(q) = \frac{\prod_k \Psi_k(q)}{V(q)^\alpha}

    Args:
        space: the joint space, such as an `Arm`.
        goal: configuration (nq,), which may be moved at any time.
        unsafe_sets: families of unsafe sets, whose inverse bumps are multiplied.
        goal_distance: V.
        parameters: α, θ, gauge and blend.

    Attributes:
        goal: the goal (nq,).
        log_psi: ln Ψ after `update`.
        log_psi_gradient: ∇ ln Ψ [1/rad or 1/m], shape (nv,), overwritten by `update`.
        goal_distance_value: V after `update`.
        goal_distance_gradient: ∇V [1/rad or 1/m], shape (nv,), overwritten by `update`.

    Raises:
        InvalidValueError: a goal that is no configuration of the space.

    Source: [ZNV] eq. 4.
    """

    def __init__(
        self,
        space: ConfigurationSpace,
        goal: ArrayLike,
        unsafe_sets: Sequence[UnsafeSet],
        goal_distance: GoalDistance,
        parameters: DensityParameters = DensityParameters(),
    ) -> None:
        self._space = space
        self.goal: Array = np.array(space.check_configuration("goal", goal))
        self.unsafe_sets = tuple(unsafe_sets)
        self._curved = [item for item in unsafe_sets if isinstance(item, Curved)]
        self.goal_distance = goal_distance
        self.parameters = parameters
        self._exponents = {gauge: gauge_exponents(gauge, parameters.alpha) for gauge in Gauge}
        self.log_psi = 0.0
        self.log_psi_gradient: Array = np.zeros(space.nv)
        self.goal_distance_value = 0.0
        self.goal_distance_gradient: Array = np.zeros(space.nv)

    def __repr__(self) -> str:
        return f"NavigationDensity(goal={in_short(self.goal)}, {self.parameters})"

    def set_goal(self, q: Array) -> None:
        """Move the goal to a configuration (nq,).

        Raises:
            InvalidValueError: of another shape.
        """
        if np.shape(q) != self.goal.shape:
            raise InvalidValueError("goal", q, f"of shape {self.goal.shape}")
        self.goal[:] = q

    def update(self, q: Array) -> None:
        """Evaluate the parts of ρ at `q`, shape (nq,), into the attributes, in place."""
        self.update_psi(q)
        self.goal_distance_value = self.goal_distance.evaluate(
            q, self.goal, self.goal_distance_gradient
        )

    def update_psi(self, q: Array) -> None:
        """As `update`, but leave V and its gradient as they are."""
        gradient, theta, log_psi = self.log_psi_gradient, self.parameters.theta, 0.0
        gradient.fill(0.0)
        for unsafe_set in self.unsafe_sets:
            log_psi += unsafe_set.add_log_bump(q, theta, gradient)
        self.log_psi = log_psi

    def log_value(self) -> float:
        """Return L = ln ρ at the last `update`; large at the goal, where it is infinite."""
        log_distance = math.log(max(self.goal_distance_value, V_MIN))
        return self.log_psi - self.parameters.alpha * log_distance

    def write_gradient(self, gauge: Gauge, out: Array) -> None:
        """Write `DensitySample.gradient` at the last `update` into `out`, shape (nv,)."""
        write_gauge_gradient(
            self.log_psi_gradient,
            self.goal_distance_value,
            self.goal_distance_gradient,
            self.parameters.alpha,
            self.log_psi,
            *self._exponents[gauge],
            out,
        )

    def write_curvature(self, q: Array, out: Array) -> None:
        """Write what the unsafe sets that are `Curved` add to `out` (nv, nv); q was updated."""
        out[:] = 0.0
        for unsafe_set in self._curved:
            unsafe_set.add_curvature(q, self.parameters.theta, out)

    def log_gradients(self, q: Array, steps: Array) -> Array:
        """Return ∇ ln ρ (..., nv) at all q ⊕ x, for steps x (..., nv) from q (nq,)."""
        out = np.empty_like(steps)
        for index in np.ndindex(steps.shape[:-1]):
            self.update(self._space.integrate(q, steps[index]))
            self.write_gradient(Gauge.LOG, out[index])
        return out

    def error(self, q: Array) -> Array:
        """Return the tangent-space error e = q ⊖ q_goal [rad or m], shape (nv,)."""
        return self._space.difference(self.goal, q)

    def evaluate(self, q: Array) -> DensitySample:
        """Return the density and its parts at `q`, shape (nq,)."""
        self.update(q)
        return DensitySample(
            self.log_psi,
            self.log_psi_gradient.copy(),
            self.goal_distance_value,
            self.goal_distance_gradient.copy(),
            self.error(q),
            self.parameters,
        )


def density_towards(
    world: World,
    goal: ArrayLike,
    *,
    margin: float = 0.0,
    kappa: float = 1.0,
    goal_distance: GoalDistance | None = None,
    parameters: DensityParameters = DensityParameters(),
    sensing: SensingParameters = SensingParameters(),
) -> NavigationDensity:
    r"""Return the plain density of a goal, as [ZNV] has it, sensing as far as it may.

    .. math:: \rho(q) = \frac{\prod_k \Psi_k(q)}{V_\kappa(q)^\alpha}

    Args:
        world: the pairs of bodies, and the joint limits.
        goal: configuration (nq,).
        margin: safety margin m of the pairs [m].
        kappa: of the `TorusDistance`, where no other distance is given.
        goal_distance: V; None for a `TorusDistance`.
        parameters: α, θ, gauge, blend, and the weights of the `TorusDistance`.
        sensing: sensing distances.

    Raises:
        InvalidValueError: a goal that is no configuration of the arm, or a number out of its range.

    Source: [ZNV] eq. 4.
    """
    unsafe = sensed_sets(world, margin, sensing)
    distance = goal_distance or TorusDistance(world.arm, parameters.weights, kappa)
    return NavigationDensity(world.arm, goal, unsafe, distance, parameters)


def blended(gradient: Array, error: Array, radius: float) -> Array:
    r"""Return gradients of a density, made linear near the goal.

    .. math:: (1 - \bar f(\tau)) \nabla\rho - \bar f(\tau) e, \qquad \tau = 2 - \|e\|/\delta

    [ZNV] leaves τ open; this one is the linear feedback −e inside the ball of radius δ and the
    gradient alone outside that of radius 2δ.

    Args:
        gradient: ∇ρ in any gauge (..., n).
        error: e (..., n) [rad or m].
        radius: δ ≥ 0 [rad or m]; 0 for the gradient everywhere.

    Source: [ZNV] Remark 2.
    """
    if radius == 0.0:
        return gradient
    share = smooth_step(2.0 - np.linalg.norm(error, axis=-1, keepdims=True) / radius)
    return (1.0 - share) * gradient - share * error


def gauge_exponents(gauge: Gauge, alpha: float) -> tuple[float, float]:
    """Return the exponents of V and of Ψ in the factor of w in `DensitySample.gradient`."""
    share = {Gauge.DENSITY: -1.0, Gauge.LOG: 0.0, Gauge.RECIPROCAL: 1.0}[gauge]
    return share * alpha - 1.0, -share


@compiled
def write_gauge_gradient(
    log_psi_gradient: Array,
    goal_distance: float,
    goal_distance_gradient: Array,
    alpha: float,
    log_psi: float,
    distance_exponent: float,
    psi_exponent: float,
    out: Array,
) -> None:
    r"""Write `DensitySample.gradient`: V^a Ψ^b w, with the exponents of `gauge_exponents`."""
    largest = 0.0
    for i in range(out.shape[0]):
        out[i] = goal_distance * log_psi_gradient[i] - alpha * goal_distance_gradient[i]
        largest = max(largest, abs(out[i]))
    if largest > 0.0:
        log_scale = distance_exponent * math.log(max(V_MIN, goal_distance))
        if psi_exponent != 0.0:  # ln Ψ is infinite in contact
            log_scale += psi_exponent * log_psi
        scale = math.exp(min(LOG_SATURATION, log_scale + math.log(largest)))
        for i in range(out.shape[0]):
            out[i] = out[i] / largest * scale
