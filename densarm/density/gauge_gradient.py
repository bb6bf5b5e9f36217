"""The gradient of the density in a gauge, from the gradients of its two parts."""

import math
import sys

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.density.gauge import Gauge

LOG_SATURATION = math.log(1e150)
"""Entries of a gradient are held below 1e150 in magnitude, so that its norm is a double too."""

V_MIN = sys.float_info.min
"""Below this V counts as this, where its logarithm is needed."""

_ALPHA_SHARE = {Gauge.DENSITY: -1.0, Gauge.LOG: 0.0, Gauge.RECIPROCAL: 1.0}


def gauge_exponents(gauge: Gauge, alpha: float) -> tuple[float, float]:
    """Return the exponents of V and of Ψ in the factor by which a gauge's gradient is not w.

    Args:
        gauge: whose gradient, as `DensitySample.gradient` has it.
        alpha: α, dimensionless.
    """
    share = _ALPHA_SHARE[gauge]
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
    r"""Write a gauge's gradient, scaled down to entries of at most 1e150 where it is longer.

    .. math:: V^a \Psi^b w, \qquad w = V \nabla\ln\Psi - \alpha \nabla V

    Args:
        log_psi_gradient: ∇ ln Ψ [1/rad or 1/m], shape (nv,).
        goal_distance: V.
        goal_distance_gradient: ∇V [1/rad or 1/m], shape (nv,).
        alpha: α, dimensionless.
        log_psi: ln Ψ.
        distance_exponent: a of `gauge_exponents`.
        psi_exponent: b of `gauge_exponents`.
        out: shape (nv,), overwritten.
    """
    largest = 0.0
    for i in range(out.shape[0]):
        out[i] = goal_distance * log_psi_gradient[i] - alpha * goal_distance_gradient[i]
        largest = max(largest, abs(out[i]))
    if largest > 0.0:
        log_scale = distance_exponent * math.log(max(goal_distance, V_MIN))
        if psi_exponent != 0.0:  # ln Ψ is infinite in contact
            log_scale += psi_exponent * log_psi
        scale = math.exp(min(log_scale + math.log(largest), LOG_SATURATION))
        for i in range(out.shape[0]):
            out[i] = out[i] / largest * scale
