"""Goal distances: the functions V(q) that the density is divided by."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arms.arm import Arm
from densarm.arms.joint_space import joint_error
from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive_tuple
from densarm.values.documented import in_short
from densarm.values.kernels import compiled, compiled_part

KAPPA_MIN = 1e-6
"""Smallest κ of `TorusDistance`, at which its product stays finite for 40 joints."""

INERTIA = "inertia"
"""Name of weights that the masses of the arm give."""


class GoalDistance(Protocol):
    """A function V ≥ 0 of the configuration that vanishes at the goal."""

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        """Return V and write its gradient.

        Args:
            q: configuration, shape (nq,).
            goal: configuration at which V is zero, shape (nq,).
            out_gradient: ∇V over q in the tangent space [1/rad or 1/m], shape (nv,), overwritten.
        """
        ...


class EuclideanDistance:
    r"""The squared distance in Rⁿ.

    .. math:: V(q) = \|q - q_{goal}\|^2

    Source: [ZNV] section III.
    """

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`."""
        np.subtract(q, goal, out=out_gradient)
        value = float(out_gradient @ out_gradient)
        out_gradient *= 2.0
        return value


class TorusDistance:
    r"""A positive definite distance on the joint space, between product and sum over joints.

    .. math::

        V_\kappa(q) = \kappa \left(\prod_i \left(1 + \frac{c_i}{\kappa}\right) - 1\right), \qquad
        c_i = \begin{cases} 2 w_i \sin^2(e_i/2) & \text{continuous} \\ w_i e_i^2/2 &
        \text{bounded} \end{cases}

    κ = ∞ is the sum of the cᵢ; κⁿ⁻¹V_κ tends to their product as κ tends to 0.

    Where metres and radians mix, weights of one count 1 m as 1 rad. In the reciprocal gauge a joint
    settles at a rate in proportion to wᵢ, so that ones let slides and turns settle together; with
    small weights on turns a long body comes late to the angle that it passes at. κ compares with
    cᵢ: farther away than √(2κ/wᵢ) a joint is pulled less the farther it is, and only κ = ∞ leads
    straight through free space.

    Args:
        arm: its joint space.
        weights: wᵢ, as `joint_weights` has them.
        kappa: κ in [`KAPPA_MIN`, ∞], dimensionless.

    Raises:
        InvalidValueError: a weight or κ out of range.
        RobotDescriptionError: weights by inertia, and links without a mass.
    """

    def __init__(
        self, arm: Arm, weights: ArrayLike | str | None = None, kappa: float = 1.0
    ) -> None:
        if not kappa >= KAPPA_MIN:
            raise InvalidValueError("kappa", kappa, f"a number >= {KAPPA_MIN}, or infinity")
        self.weights = joint_weights("weights", arm, weights)
        self.kappa = float(kappa)
        self._joint_index = arm.joint_index

    def __repr__(self) -> str:
        return f"TorusDistance(weights={in_short(self.weights)}, kappa={self.kappa:g})"

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`."""
        return _evaluate_torus_distance(
            q, goal, self._joint_index, self.weights, self.kappa, out_gradient
        )


def joint_weights(name: str, arm: Arm, weights: ArrayLike | str | None) -> Array:
    r"""Return the weights wᵢ of a goal distance (nv,) [rad⁻² or m⁻²].

    .. math:: w_i = M_{ii}(q_0) / \max_j M_{jj}(q_0)

    by inertia, q_0 in the middle of what joints can do, at 0 where one has no end. What carries
    the arm goes first then, and the rest gives way: level sets of V that are longest in the joints
    that carry little leave the density fewer maxima beside an obstacle, where V presses against it.

    Args:
        name: what errors call the weights.
        arm: its joint space.
        weights: positive numbers (nv,), "inertia", or None for ones.

    Raises:
        InvalidValueError: another word, a weight that is not positive, or not one per joint.
        RobotDescriptionError: weights by inertia, and links without a mass.
    """
    checked = checked_weights(name, weights)
    if checked is None:
        return np.ones(arm.nv)
    if isinstance(checked, str):
        arm.require_masses(f"{name} = {checked!r}")
        lower, upper = arm.limits.lower, arm.limits.upper
        ends = np.where(np.isfinite(lower) & np.isfinite(upper), [lower, upper], 0.0)
        inertia = arm.mass_matrix(arm.configurations(ends.mean(axis=0))).diagonal()
        checked = positive_tuple(name, inertia / inertia.max(), arm.nv)
    return finite_vector(name, checked, arm.nv, f": one per joint, or {INERTIA!r}")


def checked_weights(name: str, weights: ArrayLike | str | None) -> tuple[float, ...] | str | None:
    """Return weights of a goal distance as `DensityParameters` keeps them, for any arm.

    Raises:
        InvalidValueError: another word than "inertia", or a weight that is not positive.
    """
    if weights is None:
        return None
    if isinstance(weights, str):
        if weights != INERTIA:
            raise InvalidValueError(name, weights, f"one number > 0 per joint, or {INERTIA!r}")
        return weights
    return positive_tuple(name, weights, np.size(weights))


class ProductDistance:
    r"""The product over joints of [ZNV] section V, which is degenerate.

    .. math:: V(q) = \prod_i c_i, \qquad c_i = 1 - \cos e_i \ \text{(continuous)}, \quad
        c_i = e_i^2/2 \ \text{(bounded)}

    It is zero, and the density infinite, wherever *one* joint is at its goal: trajectories are
    drawn to these hyperplanes and stay on them. Kept for reproduction; `TorusDistance` is the
    distance to use.

    Args:
        arm: its joint space.
    """

    def __init__(self, arm: Arm) -> None:
        self._arm = arm

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`."""
        error, continuous = self._arm.difference(goal, q), self._arm.continuous
        costs = np.where(continuous, 2.0 * np.sin(error / 2.0) ** 2, error**2 / 2.0)
        slopes = np.where(continuous, np.sin(error), error)
        others = np.where(np.eye(error.size, dtype=bool), 1.0, costs).prod(axis=1)
        np.multiply(others, slopes, out=out_gradient)
        return float(costs.prod())


class InertiaDistance:
    r"""A distance whose gradient, as a torque, moves the arm straight to the goal.

    .. math::

        V = \tfrac12 s^T W s + \sum_i W_{ii} (c_i - \tfrac12 s_i^2), \qquad
        W = M(q) / \max_i M_{ii}(q_0)

    with s = sin e and c = 1 - cos e of a continuous joint, s = e and c = e²/2 of a bounded one.
    c_i ≥ s_i²/2, so that V is positive definite. Where all joints are bounded, W⁻¹∇V = e.

    W is taken where the arm is, and ∇V at that W: V adapts to the place, which [ZNV] Remark 1
    allows, and the rest of its derivative, of the order of e², is left out. With a W that is kept
    from one sub-goal to the next, M⁻¹∇ρ turns at each of them, and the arm shakes.

    Args:
        arm: its inertia.
        q: configuration q_0 (nq,), such as the goal.
    """

    def __init__(self, arm: Arm, q: Array) -> None:
        self._arm = arm
        self._scale = 1.0 / arm.mass_matrix(q).diagonal().max()

    def evaluate(self, q: Array, goal: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`, the gradient at the W of q."""
        e, continuous = self._arm.difference(goal, q), self._arm.continuous
        s = np.where(continuous, np.sin(e), e)
        slope = np.where(continuous, np.cos(e), 1.0)
        rest = np.where(continuous, 2.0 * np.sin(0.5 * e) ** 2, 0.5 * e**2) - 0.5 * s**2
        inertia = self._scale * self._arm.mass_matrix(q)
        own, pull = inertia.diagonal(), inertia @ s
        out_gradient[:] = slope * pull + (1.0 - slope) * own * s
        return float(0.5 * s @ pull + own @ rest)


@compiled
def _evaluate_torus_distance(
    q: Array,
    goal: Array,
    joint_index: NDArray[np.int64],
    weights: Array,
    kappa: float,
    out_gradient: Array,
) -> float:
    joint_error(goal, q, joint_index, out_gradient)
    return torus_distance(out_gradient, joint_index, weights, kappa)


@compiled_part
def torus_distance(
    error: Array, joint_index: NDArray[np.int64], weights: Array, kappa: float
) -> float:
    r"""Evaluate V_κ of `TorusDistance` at an error, and write its gradient in the error's place.

    .. math::

        V_\kappa = \kappa \operatorname{expm1} \sum_i \operatorname{log1p}(c_i/\kappa), \qquad
        \frac{\partial V_\kappa}{\partial e_i}
        = \frac{\partial c_i}{\partial e_i} \prod_{j \ne i} \left(1 + \frac{c_j}{\kappa}\right)

    The form by logarithms keeps V at e = 1e-8, where the product minus one cancels to 0.
    """
    log_product, total = 0.0, 0.0
    for i in range(error.shape[0]):
        cost = _joint_cost(error[i], joint_index[1, i], weights[i])
        log_product += math.log1p(cost / kappa)
        total += cost
    product = math.exp(log_product)
    for i in range(error.shape[0]):
        cost = _joint_cost(error[i], joint_index[1, i], weights[i])
        slope = weights[i] * (math.sin(error[i]) if joint_index[1, i] else error[i])
        error[i] = slope * product / (1.0 + cost / kappa)
    return total if math.isinf(kappa) else kappa * math.expm1(log_product)


@compiled_part
def _joint_cost(error: float, continuous: int, weight: float) -> float:
    root = 2.0 * math.sin(error / 2.0) if continuous else error
    return weight * root * root / 2.0
