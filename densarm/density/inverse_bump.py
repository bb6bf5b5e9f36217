"""Inverse bump: zero on an unsafe set, one beyond its sensing region, smooth between."""

import math

import numpy as np
from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.density.smooth_step import log_shifted_step, smooth_step


def inverse_bump(h: ArrayLike, s: ArrayLike, theta: float = 0.0) -> Array:
    r"""Evaluate the shifted inverse bump of an unsafe set.

    .. math::

        \Psi = \Phi + \theta, \qquad
        \Phi = \begin{cases} 0 & h \le 0 \\
        \bar f\!\left(\dfrac{h}{h - s}\right) & h > 0,\ s \le 0 \\ 1 & \text{otherwise}
        \end{cases}

    Args:
        h: function of the unsafe set {h ≤ 0}, any shape and unit (m for a clearance).
        s: sensing function, zero at the rim of the sensing region, in the unit of `h`.
        theta: shift θ ≥ 0, dimensionless.

    Returns:
        Ψ, of the broadcast shape of `h` and `s`.

    Source: [ZNV] eq. 7-8.
    """
    h, s = np.broadcast_arrays(np.asarray(h, np.float64), np.asarray(s, np.float64))
    sensed = (h > 0.0) & (s <= 0.0)
    t = np.where(h > 0.0, 1.0, 0.0)
    np.divide(h, h - s, out=t, where=sensed)
    return smooth_step(t) + theta


@compiled
def log_inverse_bump(h: float, width: float, theta: float) -> tuple[float, float]:
    r"""Evaluate ln Ψ of one unsafe set, and its derivative in h at a fixed width.

    With t = h/w, w = h − s, the gradient over the configuration is

    .. math::

        \nabla \ln\Psi = \frac{\partial \ln\Psi}{\partial h} (\nabla h - t \nabla w),

    which equals ∂lnΨ/∂t · (h ∇s − s ∇h)/(h − s)².

    Args:
        h: function of the unsafe set {h ≤ 0} (m for a clearance).
        width: w = h − s, positive wherever h ≤ 0; the sensing distance σ if constant.
        theta: shift θ ≥ 0, dimensionless.

    Returns:
        ln Ψ and ∂lnΨ/∂h at constant width; in contact as `log_shifted_step` has them.

    Source: [ZNV] eq. 7-8.
    """
    if h > 0.0 and h >= width:
        return math.log1p(theta), 0.0
    value, slope = log_shifted_step(h / width, theta)
    return value, slope / width


@compiled
def accumulate_log_bumps(
    distance: Array,
    margin: float,
    h_gradient: Array,
    width: Array,
    theta: float,
    out_gradient: Array,
) -> float:
    r"""Sum ln Ψ over unsafe sets with s_k = h_k − σ_k; add the gradient of the sum in place.

    .. math::

        \sum_k \ln\Psi_k, \qquad \sum_k \frac{\partial \ln\Psi_k}{\partial h_k} \nabla h_k

    Args:
        distance: values d_k, shape (K,).
        margin: m, in the unit of `distance`.
        h_gradient: ∇h_k, shape (K, nv).
        width: sensing distances σ_k > 0, shape (K,), in the unit of `distance`.
        theta: shift θ ≥ 0, dimensionless.
        out_gradient: shape (nv,), added to.

    Returns:
        Σ ln Ψ_k.

    Source: [ZNV] eq. 7-8.
    """
    total = 0.0
    for k in range(distance.shape[0]):
        value, slope = log_inverse_bump(distance[k] - margin, width[k], theta)
        total += value
        if slope != 0.0:
            for i in range(out_gradient.shape[0]):
                out_gradient[i] += slope * h_gradient[k, i]
    return total
