"""Smooth step: the C∞ transition from 0 to 1 that inverse bumps are made of."""

import math

import numpy as np
from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.compiled import compiled

T_MIN = 1e-6
"""Below this argument the step is contact: f̄(T_MIN) = exp(−10⁶) is no longer a double."""


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


@compiled
def log_shifted_step(t: float, theta: float) -> tuple[float, float]:
    r"""Evaluate the logarithm of the shifted smooth step, and its slope.

    .. math::

        \ln(\bar f(t) + \theta), \qquad
        \frac{\bar f}{\bar f + \theta} (1 - \bar f)
        \left(\frac{1}{t^2} + \frac{1}{(1 - t)^2}\right)

    With the logistic form f̄ = 1/(1 + exp z), z = 1/t − 1/(1−t), neither overflows. In contact,
    t < `T_MIN`, the shifted step is the constant θ: ``(ln θ, 0)``. For θ = 0 that has no
    slope, and the slope at `T_MIN` stands for it, so that gradients are finite and still
    point out of contact: ``(−inf, slope)``.

    Args:
        t: argument, dimensionless.
        theta: shift θ ≥ 0, dimensionless.

    Returns:
        The logarithm and its derivative with respect to t.

    Source: [ZNV] eq. 5-6 and 8.
    """
    if t >= 1.0:
        return math.log1p(theta), 0.0
    if t < T_MIN:
        if theta > 0.0:
            return math.log(theta), 0.0
        return -math.inf, 1.0 / T_MIN**2 + 1.0 / (1.0 - T_MIN) ** 2
    from_zero, from_one = 1.0 / t, 1.0 / (1.0 - t)
    z = from_zero - from_one
    decay = math.exp(-abs(z))
    log_step = -max(z, 0.0) - math.log1p(decay)
    complement = (1.0 if z >= 0.0 else decay) / (1.0 + decay)
    log_value, share = log_step, 1.0
    if theta > 0.0:
        log_theta = math.log(theta)
        log_value = max(log_step, log_theta) + math.log1p(math.exp(-abs(log_step - log_theta)))
        share = math.exp(log_step - log_value)
    return log_value, share * complement * (from_zero * from_zero + from_one * from_one)
