"""SaturatedVelocity: a planning system on Rⁿ as a velocity controller, its control bounded."""

import numpy as np
from numpy.typing import ArrayLike

from densarm.arrays import Array
from densarm.fields.navigation_field import NavigationField
from densarm.fields.saturation import saturate


class SaturatedVelocity:
    r"""Command a field on Rⁿ up to a bound on every component.

    .. math:: u = \bar u(g\, k(x)), \qquad \|u\|_\infty \le u_{max}

    Args:
        field: k(x).
        u_max: bound of each component of u [m/s]; infinity for none.
        gain: factor g > 0 of the field before the bound, [m/s] per unit of k.

    Source: [ZNV] eq. 13-14.
    """

    def __init__(self, field: NavigationField, u_max: float, gain: float = 1.0) -> None:
        self._field = field
        self._u_max = u_max
        self._gain = gain

    def velocity(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        """Return u at points `q` (..., n) [m], as `VelocityController.velocity` at one."""
        direction = self._field.direction(np.asarray(q, np.float64))
        return saturate(self._gain * direction, self._u_max)
