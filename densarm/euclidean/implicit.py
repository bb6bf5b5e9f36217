"""ImplicitFunction: a smooth function on Rⁿ whose sign tells inside from outside, in batches."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.checks import finite_vector, positive, positive_array


class ImplicitFunction(Protocol):
    """A function f on Rⁿ, of batches of points; {f ≤ 0} is the set it describes."""

    def __call__(self, x: Array) -> Array:
        """Return f at points `x`, shape (..., n) [m], of shape (...)."""
        ...

    def gradient(self, x: Array) -> Array:
        """Return ∇f at points `x`, shape (..., n) [m], of shape (..., n) [unit of f per m]."""
        ...


class Placed:
    """A function moved, turned and stretched: g(x) = f(D⁻¹Rᵀ(x − p)).

    Args:
        function: f.
        position: p, shape (n,) [m].
        rotation: R, shape (n, n), orthogonal, or the angle [rad] in the plane; None turns nothing.
        scale: diagonal of D > 0, dimensionless, one number or shape (n,).
    """

    def __init__(
        self,
        function: ImplicitFunction,
        position: ArrayLike,
        rotation: ArrayLike | None = None,
        scale: ArrayLike = 1.0,
    ) -> None:
        self.function = function
        self.position = finite_vector("position", position, np.size(position))
        factors = positive_array("scale", scale, self.position.size)
        # Rows of x − p times this are D⁻¹Rᵀ(x − p); gradients come back by its transpose.
        self._map: Array = _rotation_matrix(rotation, self.position.size) / factors

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return self.function(self._local(x))

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        return self.function.gradient(self._local(x)) @ self._map.T

    def _local(self, x: Array) -> Array:
        """Return D⁻¹Rᵀ(x − p) in the memory layout of x, which Fortran's order makes fast."""
        offset = (x - self.position).reshape(-1, x.shape[-1])
        return (self._map.T @ offset.T).T.reshape(x.shape)


@dataclass(frozen=True)
class Lowered:
    """A function less a constant: the same shape, larger. Source: [ZNV] Remark 1."""

    function: ImplicitFunction
    """f."""
    by: float
    """σ > 0, in the unit of f; s = h − σ bounds a sensing region that follows h."""

    def __post_init__(self) -> None:
        positive("by", self.by)

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return self.function(x) - self.by

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        return self.function.gradient(x)


@dataclass(frozen=True)
class Complement:
    """−f: what lies outside the set, such as all beyond the bound of a world."""

    function: ImplicitFunction
    """f."""

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return -self.function(x)

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        return -self.function.gradient(x)


@dataclass(frozen=True)
class UnsafeRegion:
    """An unsafe set {h ≤ 0} with its sensing region {s ≤ 0}. Source: [ZNV] eq. 2-3."""

    h: ImplicitFunction
    """Function of the unsafe set."""
    s: ImplicitFunction
    """Sensing function, in the unit of `h`; below `h` wherever h ≤ 0 if the region is to
    contain the unsafe set. Where it does not, the density jumps to θ at the unsafe set's rim."""


def smallest_value(functions: Sequence[ImplicitFunction], x: Array) -> Array:
    """Return the smallest of functions at points `x` (..., n); +inf of no function."""
    values = [function(x) for function in functions]
    return np.min(values, axis=0) if values else np.full(x.shape[:-1], np.inf)


def _rotation_matrix(rotation: ArrayLike | None, n: int) -> Array:
    if rotation is None:
        return np.eye(n)
    matrix = np.asarray(rotation, np.float64)
    if matrix.shape == () and n == 2:
        cosine, sine = np.cos(matrix), np.sin(matrix)
        return np.array([[cosine, -sine], [sine, cosine]])
    if matrix.shape != (n, n) or not np.allclose(matrix @ matrix.T, np.eye(n), atol=1e-9):
        raise InvalidValueError("rotation", rotation, f"an orthogonal matrix, {n} by {n}")
    return matrix
