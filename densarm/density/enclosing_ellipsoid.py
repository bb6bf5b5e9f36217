"""Ellipsoid: the convex body, curved everywhere, that an unsafe set is sensed in."""

from dataclasses import dataclass

import numpy as np

from densarm.arrays import Array
from densarm.validation import non_negative

_TOLERANCE = 1e-2  # on the optimality of the volume alone
_MOST_ITERATIONS = 10_000


@dataclass(frozen=True)
class Ellipsoid:
    """Points {c + e : eᵀ S⁻¹ e ≤ 1}."""

    centre: Array
    """c, shape (n,) [rad or m]."""
    shape: Array
    """S (n, n), symmetric and positive definite; its eigenvalues are the squared semi-axes."""

    @property
    def semi_axes(self) -> Array:
        """Semi-axes, ascending, shape (n,) [rad or m]."""
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.shape)))

    @property
    def extent(self) -> Array:
        """Half of the width along each coordinate, shape (n,) [rad or m]."""
        return np.asarray(np.sqrt(np.diag(self.shape)))

    def level(self, points: Array) -> Array:
        """Return eᵀ S⁻¹ e at points (..., n): at most 1 inside, of shape (...)."""
        error = points - self.centre
        return np.asarray(np.sum(error * (error @ np.linalg.inv(self.shape)), axis=-1))

    def inflated(self, by: float) -> "Ellipsoid":
        """Return the ellipsoid with every semi-axis longer by so much [rad or m].

        Besides room it gains roundness: the ratio of the semi-axes comes closer to one.
        """
        squares, axes = np.linalg.eigh(self.shape)
        longer = np.sqrt(squares) + non_negative("by", by)
        return Ellipsoid(self.centre, (axes * longer**2) @ axes.T)


def enclosing_ellipsoid(points: Array) -> Ellipsoid:
    """Return the ellipsoid of (nearly) least volume that contains points.

    Args:
        points: shape (M, n), not all in one hyperplane [rad or m].

    Returns:
        An ellipsoid that contains every point; only its volume is approximate.

    Source: L. G. Khachiyan, Rounding of polytopes in the real number model of computation,
        Mathematics of Operations Research 21(2), 1996.
    """
    count, n = points.shape
    lifted = np.column_stack([points, np.ones(count)])
    weight = np.full(count, 1.0 / count)
    for _ in range(_MOST_ITERATIONS):
        spread = np.linalg.inv((lifted.T * weight) @ lifted)
        level = np.sum((lifted @ spread) * lifted, axis=1)
        farthest = int(level.argmax())
        excess = level[farthest] - n - 1.0
        if excess < _TOLERANCE:
            break
        step = excess / ((n + 1.0) * (level[farthest] - 1.0))
        weight *= 1.0 - step
        weight[farthest] += step
    centre = weight @ points
    error = points - centre
    ellipsoid = Ellipsoid(centre, n * (error.T * weight) @ error)
    return Ellipsoid(centre, ellipsoid.shape * _ENCLOSING * ellipsoid.level(points).max())


_ENCLOSING = 1.0 + 1e-9  # so that rounding leaves no point outside
