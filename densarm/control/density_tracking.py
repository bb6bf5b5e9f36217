"""DensityTracking: the density inverse-dynamics controller along a reference."""

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from densarm.arm import Arm
from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.control.controller import checked_state
from densarm.control.gains import Gains
from densarm.control.inverse_dynamics import InverseDynamics, limited_torque
from densarm.density import NavigationDensity, NearClearanceSet, TorusDistance
from densarm.density.gauge_gradient import gauge_exponents, write_gauge_gradient
from densarm.density.goal_distance import torus_distance, write_configuration
from densarm.density.joint_error import joint_error
from densarm.proof.straight_brake import HELD_SHARE
from densarm.reference.reference import Reference, hermite


class DensityTracking:
    r"""Track q_d(t), obstacles acting at the true configuration.

    .. math::

        \tau = H + M \big( \ddot q_d + K_p \nabla\rho(e) - K_v \dot e \big), \qquad
        e = q \ominus q_d, \quad \rho(e) = \Psi(q) / V(q \ominus q_d)^\alpha

    In the reciprocal gauge the feedback is smooth at e = 0 and tends to -K_p e. The torque is taken
    to be held for the reference's period: q̈_d is its mean over that time.

    Args:
        arm: the arm.
        density: Ψ at the true configuration, and V, whose goal is moved along the reference.
        reference: q_d(t) and its derivatives.
        gains: K_p and K_v.

    Source: [ZNV] eq. 17.
    """

    def __init__(
        self,
        arm: Arm,
        density: NavigationDensity[TorusDistance],
        reference: Reference,
        gains: Gains,
    ) -> None:
        self._arm = arm
        self._density = density
        self._dynamics = InverseDynamics(
            arm, HELD_SHARE * arm.limits.acceleration, _mass_data(density)
        )
        parameters, goal_distance = density.parameters, density.goal_distance
        numbers = (
            reference.period,
            goal_distance.kappa,
            parameters.alpha,
            *gauge_exponents(parameters.gauge, parameters.alpha),
            gains.position,
            gains.velocity,
        )
        self._fixed: tuple[Any, ...] = (
            np.array(numbers),
            reference.samples,
            arm.idx_q,
            arm.is_circle,
            goal_distance.goal,
            goal_distance.weights,
            density.log_psi_gradient,
            *self._dynamics.terms,
            np.zeros((6, arm.nv)),
        )
        # Kernels are loaded, or compiled, here rather than in the first step of a control loop.
        self.torque(0.0, goal_distance.goal, np.zeros(arm.nv))
        self.tracking_error: float = 0.0
        """Largest |e| of a joint at the last call, zero before the first [rad or m]."""

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Act as `Controller.torque`."""
        q, v = checked_state(self._arm, q, v)
        density = self._density
        density.update_psi(q)
        self._dynamics.update(q, v)
        tau = np.empty(len(v))
        self.tracking_error = write_torque(float(t), q, v, density.log_psi, tau, *self._fixed)
        return tau


def _mass_data(density: NavigationDensity[TorusDistance]) -> pin.Data | None:
    """Return the data in which a density computes M at its configuration, if it does."""
    near = [item.pairs.data for item in density.unsafe_sets if isinstance(item, NearClearanceSet)]
    return near[0] if near else None


@compiled
def write_torque(
    t: float,
    q: Array,
    v: Array,
    log_psi: float,
    tau: Array,
    numbers: Array,
    samples: Array,
    idx_q: NDArray[np.int64],
    is_circle: NDArray[np.bool_],
    goal: Array,
    weights: Array,
    log_psi_gradient: Array,
    mass: Array,
    nonlinear: Array,
    limits_and_parts: Array,
    workspace: Array,
) -> float:
    """Write the torque of `DensityTracking`, and return its tracking error.

    It is one kernel, of few arguments, since every call and every argument has its cost.
    """
    period, kappa, alpha = numbers[0], numbers[1], numbers[2]
    distance_exponent, psi_exponent = numbers[3], numbers[4]
    position_gain, velocity_gain = numbers[5], numbers[6]
    point, brake, attract, slope = workspace[:3], workspace[3], workspace[4], workspace[5]
    hermite(t / period, t / period + 0.5, period, samples, point)
    write_configuration(point[0], idx_q, is_circle, goal)
    distance = torus_distance(goal, q, idx_q, is_circle, weights, kappa, slope)
    write_gauge_gradient(
        log_psi_gradient,
        distance,
        slope,
        alpha,
        log_psi,
        distance_exponent,
        psi_exponent,
        attract,
    )
    joint_error(goal, q, idx_q, is_circle, brake)
    tracking_error = 0.0
    for i in range(v.shape[0]):
        tracking_error = max(tracking_error, abs(brake[i]))
        brake[i] = point[2, i] - velocity_gain * (v[i] - point[1, i])
        attract[i] *= position_gain
    limited_torque(mass, nonlinear, limits_and_parts, brake, attract, tau)
    return tracking_error
