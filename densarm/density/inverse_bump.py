"""Inverse bumps, and the smooth step that they are made of.

An inverse bump is zero on an unsafe set, one beyond its sensing region, and smooth between.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from densarm.values.arrays import Array
from densarm.values.kernels import compiled

T_MIN = 1e-6
"""Below this argument the step is contact: f̄(T_MIN) = exp(−10⁶) is no longer a double."""

_CONTACT_SLOPE = 1.0 / (T_MIN * T_MIN) + 1.0 / ((1.0 - T_MIN) * (1.0 - T_MIN))
_DIFFERENCE = 1e-4  # of the width


def smooth_step(t: ArrayLike) -> Array:
    r"""Evaluate the smooth step.

    .. math::

        \bar f(t) = \frac{f(t)}{f(t) + f(1 - t)}, \qquad
        f(t) = \begin{cases} \exp(-1/t) & t > 0 \\ 0 & t \le 0 \end{cases}

    Args:
        t: arguments of any shape, dimensionless.

    Returns:
        f̄(t), of the shape of `t`: exactly 0 for t ≤ 0 and exactly 1 for t ≥ 1.

    Source: [ZNV] eq. 5-6.
    """
    t = np.asarray(t, dtype=np.float64)
    inside = np.clip(t, T_MIN, 1.0 - T_MIN)
    step = np.exp(-np.logaddexp(0.0, 1.0 / inside - 1.0 / (1.0 - inside)))
    return np.where(t <= 0.0, 0.0, np.where(t >= 1.0, 1.0, step))


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

    With t = h/w, w = h − s, it is the logarithm of the shifted smooth step,

    .. math::

        \ln\Psi = \ln(\bar f(t) + \theta), \qquad
        \frac{\partial \ln\Psi}{\partial h} = \frac{1}{w} \frac{\bar f}{\bar f + \theta}
        (1 - \bar f) \left(\frac{1}{t^2} + \frac{1}{(1 - t)^2}\right), \qquad
        \nabla \ln\Psi = \frac{\partial \ln\Psi}{\partial h} (\nabla h - t \nabla w).

    With the logistic form f̄ = 1/(1 + exp z), z = 1/t − 1/(1−t), nothing overflows. In contact,
    t < `T_MIN`, Ψ is the constant θ: ``(ln θ, 0)``. For θ = 0 that has no slope, and the slope at
    `T_MIN` stands for it, so that gradients are finite and still point out of contact:
    ``(−inf, slope)``.

    Args:
        h: function of the unsafe set {h ≤ 0} (m for a clearance).
        width: w = h − s, positive wherever h ≤ 0; the sensing distance σ if constant.
        theta: shift θ ≥ 0, dimensionless.

    Returns:
        ln Ψ and ∂lnΨ/∂h at constant width.

    Source: [ZNV] eq. 5-8.
    """
    t = h / width
    if t >= 1.0 or (h > 0.0 and h >= width):
        return math.log1p(theta), 0.0
    if t < T_MIN:
        if theta > 0.0:
            return math.log(theta), 0.0
        return -math.inf, _CONTACT_SLOPE / width
    from_zero, from_one = 1.0 / t, 1.0 / (1.0 - t)
    z = from_zero - from_one
    decay = math.exp(-abs(z))
    log_step = -max(0.0, z) - math.log1p(decay)
    complement = (1.0 if z >= 0.0 else decay) / (1.0 + decay)
    log_value, share = log_step, 1.0
    if theta > 0.0:
        log_theta = math.log(theta)
        log_value = max(log_theta, log_step) + math.log1p(math.exp(-abs(log_step - log_theta)))
        share = math.exp(log_step - log_value)
    return log_value, share * complement * (from_zero * from_zero + from_one * from_one) / width


@compiled
def bump_curvature(h: float, width: float, theta: float) -> float:
    """Return -∂²lnΨ/∂h² at constant width where that is positive, else zero.

    By a central difference of the slope of `log_inverse_bump`, whose arguments these are: it
    decides how long a step is, and no more.
    """
    if h >= width:
        return 0.0
    step = _DIFFERENCE * width
    below = log_inverse_bump(h - step, width, theta)[1]
    above = log_inverse_bump(h + step, width, theta)[1]
    return max(0.0, (below - above) / (2.0 * step))
