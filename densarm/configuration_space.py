"""ConfigurationSpace: where a motion takes place, the joint space of an arm or Rⁿ."""

from typing import Protocol

from densarm.arrays import Array
from densarm.validation import positive_integer


class ConfigurationSpace(Protocol):
    """Configurations q (nq,) and the tangent vectors (nv,) between them; an `Arm` is one."""

    @property
    def nv(self) -> int:
        """Number of tangent directions."""
        ...

    def difference(self, q_from: Array, q_to: Array) -> Array:
        """Return the tangent vectors (..., nv) from configurations (..., nq) to others."""
        ...

    def integrate(self, q: Array, step: Array) -> Array:
        """Return q ⊕ step: the configurations (..., nq) that tangent vectors (..., nv) lead to."""
        ...


class EuclideanSpace:
    """The space Rⁿ of points.

    Args:
        n: its dimension.

    Raises:
        InvalidValueError: a dimension below one.
    """

    def __init__(self, n: int) -> None:
        self.nv = positive_integer("n", n)

    def difference(self, q_from: Array, q_to: Array) -> Array:
        """Return q_to - q_from, both (..., n) [m]."""
        return q_to - q_from

    def integrate(self, q: Array, step: Array) -> Array:
        """Return q + step, both (..., n) [m]."""
        return q + step
