"""Goal distances: the functions V(q) that the density is divided by."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.density.joint_error import joint_error
from densarm.errors import InvalidValueError
from densarm.validation import finite_vector, positive

if TYPE_CHECKING:
    from densarm.arm import Arm

KAPPA_MIN = 1e-6
"""Smallest κ of `TorusDistance`, at which its product stays finite for 40 joints."""


class GoalDistance(Protocol):
    """A function V ≥ 0 of the configuration that vanishes at a goal."""

    @property
    def goal(self) -> Array:
        """Goal configuration, shape (nq,)."""
        ...

    def set_goal(self, q: Array) -> None:
        """Move the goal to `q`, shape (nq,), in place.

        Raises:
            InvalidValueError: a wrong shape.
        """
        ...

    def evaluate(self, q: Array, out_gradient: Array) -> float:
        """Return V(q), `q` of shape (nq,), and write ∇V into `out_gradient`, shape (nv,)."""
        ...

    def error(self, q: Array) -> Array:
        """Return the tangent-space error e = q ⊖ q_goal, shape (nv,) [rad or m]."""
        ...


class EuclideanDistance:
    r"""The squared distance in Rⁿ.

    .. math:: V(q) = \|q - q_{goal}\|^2

    Args:
        goal: shape (n,).

    Raises:
        InvalidValueError: a goal that is not a vector of finite numbers.

    Source: [ZNV] section III.
    """

    def __init__(self, goal: ArrayLike) -> None:
        self.goal = finite_vector("goal", goal, np.size(goal))

    def set_goal(self, q: Array) -> None:
        """Act as `GoalDistance.set_goal`."""
        _move(self.goal, q)

    def evaluate(self, q: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`."""
        np.subtract(q, self.goal, out=out_gradient)
        value = float(out_gradient @ out_gradient)
        out_gradient *= 2.0
        return value

    def error(self, q: Array) -> Array:
        """Act as `GoalDistance.error`."""
        return np.subtract(q, self.goal)


class TorusDistance:
    r"""A positive definite distance on the joint space, between product and sum over joints.

    .. math::

        V_\kappa(q) = \kappa \left(\prod_i \left(1 + \frac{c_i}{\kappa}\right) - 1\right), \qquad
        c_i = \begin{cases} 2 w_i \sin^2(e_i/2) & \text{circle} \\ w_i e_i^2/2 & \text{bounded}
        \end{cases}

    κ = ∞ is the sum of the cᵢ; κⁿ⁻¹V_κ tends to their product as κ tends to 0.

    Where metres and radians mix, weights of one count 1 m as 1 rad. In the reciprocal gauge a joint
    settles at a rate in proportion to wᵢ, so that ones let slides and turns settle together; with
    small weights on turns a long body comes late to the angle that it passes at. κ compares with
    cᵢ: farther away than √(2κ/wᵢ) a joint is pulled less the farther it is, and only κ = ∞ leads
    straight through free space.

    Args:
        arm: its `nq`, `idx_q` and `is_circle` are read.
        goal: configuration, shape (nq,).
        weights: wᵢ > 0 [rad⁻² or m⁻²], shape (nv,); ones by default.
        kappa: κ in [`KAPPA_MIN`, ∞], dimensionless.

    Raises:
        InvalidValueError: a goal of the wrong shape, a weight or κ out of range.
    """

    def __init__(
        self, arm: Arm, goal: ArrayLike, weights: ArrayLike | None = None, kappa: float = 1.0
    ) -> None:
        if not kappa >= KAPPA_MIN:
            raise InvalidValueError("kappa", kappa, f"a number >= {KAPPA_MIN}, or infinity")
        nv = len(arm.idx_q)
        self.goal = finite_vector("goal", goal, arm.nq, CONFIGURATION_HINT)
        self.weights = np.ones(nv) if weights is None else finite_vector("weights", weights, nv)
        for weight in self.weights:
            positive("weights", weight)
        self.kappa = float(kappa)
        self._idx_q, self._is_circle = arm.idx_q, arm.is_circle

    def set_goal(self, q: Array) -> None:
        """Act as `GoalDistance.set_goal`."""
        _move(self.goal, q)

    def set_goal_angles(self, angles: Array) -> None:
        """Move the goal to joint positions (nv,) [rad or m], in place and without checks."""
        write_configuration(angles, self._idx_q, self._is_circle, self.goal)

    def evaluate(self, q: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`."""
        return torus_distance(
            self.goal, q, self._idx_q, self._is_circle, self.weights, self.kappa, out_gradient
        )

    def error(self, q: Array) -> Array:
        """Act as `GoalDistance.error`."""
        error = np.empty(len(self._idx_q))
        joint_error(self.goal, q, self._idx_q, self._is_circle, error)
        return error


class ProductDistance:
    r"""The product over joints of [ZNV] section V, which is degenerate.

    .. math:: V(q) = \prod_i c_i, \qquad c_i = 1 - \cos e_i \ \text{(circle)}, \quad
        c_i = e_i^2/2 \ \text{(bounded)}

    It is zero, and the density infinite, wherever *one* joint is at its goal: trajectories are
    drawn to these hyperplanes and stay on them. Kept for reproduction; `TorusDistance` is the
    distance to use.

    Args:
        arm: its `nq`, `idx_q` and `is_circle` are read.
        goal: configuration, shape (nq,).

    Raises:
        InvalidValueError: a goal of the wrong shape.
    """

    def __init__(self, arm: Arm, goal: ArrayLike) -> None:
        self.goal = finite_vector("goal", goal, arm.nq, CONFIGURATION_HINT)
        self._idx_q, self._is_circle = arm.idx_q, arm.is_circle

    def set_goal(self, q: Array) -> None:
        """Act as `GoalDistance.set_goal`."""
        _move(self.goal, q)

    def evaluate(self, q: Array, out_gradient: Array) -> float:
        """Act as `GoalDistance.evaluate`."""
        error = self.error(q)
        costs = np.where(self._is_circle, 2.0 * np.sin(error / 2.0) ** 2, error**2 / 2.0)
        slopes = np.where(self._is_circle, np.sin(error), error)
        others = np.where(np.eye(error.size, dtype=bool), 1.0, costs).prod(axis=1)
        np.multiply(others, slopes, out=out_gradient)
        return float(costs.prod())

    def error(self, q: Array) -> Array:
        """Act as `GoalDistance.error`."""
        error = np.empty(len(self._idx_q))
        joint_error(self.goal, q, self._idx_q, self._is_circle, error)
        return error


@compiled
def write_configuration(
    angles: Array, idx_q: NDArray[np.int64], is_circle: NDArray[np.bool_], out: Array
) -> None:
    """Write the configuration (nq,) of joint positions (nv,) [rad or m] into `out`."""
    for i in range(angles.shape[0]):
        if is_circle[i]:
            out[idx_q[i]] = math.cos(angles[i])
            out[idx_q[i] + 1] = math.sin(angles[i])
        else:
            out[idx_q[i]] = angles[i]


@compiled
def torus_distance(
    q_goal: Array,
    q: Array,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    weights: Array,
    kappa: float,
    out_gradient: Array,
) -> float:
    r"""Evaluate V_κ of `TorusDistance` and write its gradient.

    .. math::

        V_\kappa = \kappa \operatorname{expm1} \sum_i \operatorname{log1p}(c_i/\kappa), \qquad
        \frac{\partial V_\kappa}{\partial e_i}
        = \frac{\partial c_i}{\partial e_i} \prod_{j \ne i} \left(1 + \frac{c_j}{\kappa}\right)

    The form by logarithms keeps V at e = 1e-8, where the product minus one cancels to 0.

    Args:
        q_goal: goal configuration, shape (nq,).
        q: configuration, shape (nq,).
        idx_q: first index in a configuration of each joint, shape (nv,).
        is_circle: whether the joint is a circle, shape (nv,).
        weights: wᵢ > 0 [rad⁻² or m⁻²], shape (nv,).
        kappa: κ, dimensionless; infinity for the plain sum.
        out_gradient: ∇V_κ [1/rad or 1/m], shape (nv,), overwritten.

    Returns:
        V_κ.
    """
    joint_error(q_goal, q, idx_q, is_circle, out_gradient)
    log_product, total = 0.0, 0.0
    for i in range(out_gradient.shape[0]):
        cost = _joint_cost(out_gradient[i], is_circle[i], weights[i])
        log_product += math.log1p(cost / kappa)
        total += cost
    for i in range(out_gradient.shape[0]):
        error = out_gradient[i]
        cost = _joint_cost(error, is_circle[i], weights[i])
        slope = weights[i] * (math.sin(error) if is_circle[i] else error)
        out_gradient[i] = slope * math.exp(log_product) / (1.0 + cost / kappa)
    return total if math.isinf(kappa) else kappa * math.expm1(log_product)


@compiled
def _joint_cost(error: float, is_circle: bool, weight: float) -> float:
    root = 2.0 * math.sin(error / 2.0) if is_circle else error
    return weight * root * root / 2.0


CONFIGURATION_HINT = " (arm.configuration makes one from joint angles)"


def _move(goal: Array, q: Array) -> None:
    if np.shape(q) != goal.shape:
        raise InvalidValueError("goal", q, f"of shape {goal.shape}{CONFIGURATION_HINT}")
    goal[:] = q
