"""NavigationField: what the density and its rivals on Rⁿ have in common."""

from collections.abc import Sequence
from typing import Protocol

from densarm.arrays import Array
from densarm.density.implicit_function import ImplicitFunction


class NavigationField(Protocol):
    """A planning system ẋ = k(x) on Rⁿ, evaluated at many points at once."""

    @property
    def goal(self) -> Array:
        """The point that k should lead to, shape (n,) [m]."""
        ...

    @property
    def obstacles(self) -> Sequence[ImplicitFunction]:
        """Functions h_k; {h_k ≤ 0} must not be entered."""
        ...

    def direction(self, x: Array) -> Array:
        """Return k at points `x` (..., n) [m], of shape (..., n); zero at critical points."""
        ...

    def height(self, x: Array) -> Array:
        """Return a function that k climbs at points `x` (..., n), of shape (...)."""
        ...
