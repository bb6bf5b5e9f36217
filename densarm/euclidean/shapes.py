"""Implicit functions of shapes about the origin; `Placed` moves, turns and stretches them.

Each is negative inside and positive outside, a polynomial (or nearly) of the degree that its
unit tells, and smooth wherever its docstring names no exception.
"""

from dataclasses import dataclass

import numpy as np

from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.checks import positive, positive_tuple


@dataclass(frozen=True)
class Ball:
    """‖x‖² − r² [m²]: the circle of the plane, the ball of Rⁿ. Source: [ZNV] section IV-A."""

    radius: float
    """r > 0 [m]."""

    def __post_init__(self) -> None:
        positive("radius", self.radius)

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return np.einsum("...i,...i", x, x) - self.radius**2  # type: ignore[no-any-return]

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        return 2.0 * x


@dataclass(frozen=True)
class Ellipsoid:
    """Σ (aᵢ xᵢ)² − r² [m²]: the scaled norm that bounds a sensing region in [ZNV] Fig. 2."""

    scaling: tuple[float, ...]
    """aᵢ > 0, dimensionless, shape (n,); the semi-axes are r/aᵢ."""
    radius: float
    """r > 0 [m]."""

    def __post_init__(self) -> None:
        scaling = positive_tuple("scaling", self.scaling, np.size(self.scaling))
        object.__setattr__(self, "scaling", scaling)
        positive("radius", self.radius)

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return np.square(x) @ np.square(self.scaling) - self.radius**2

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        return 2.0 * np.square(self.scaling) * x


@dataclass(frozen=True)
class PNormBall:
    """Σ |xᵢ|ᵖ − rᵖ [mᵖ]: a square with round corners for p = 4. Source: [ZNV] Fig. 2."""

    radius: float
    """r > 0 [m]: half the width."""
    p: float = 4.0
    """Exponent p ≥ 2, dimensionless; the higher, the sharper the corners."""

    def __post_init__(self) -> None:
        positive("radius", self.radius)
        if not self.p >= 2.0:
            raise InvalidValueError("p", self.p, "a number >= 2")

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return np.sum(np.abs(x) ** self.p, axis=-1) - self.radius**self.p  # type: ignore[no-any-return]

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        return self.p * np.sign(x) * np.abs(x) ** (self.p - 1.0)


@dataclass(frozen=True)
class Oval:
    """‖x − f‖² ‖x + f‖² − b⁴ [m⁴], f = (c, 0): Cassini's oval, convex for b ≥ c√2."""

    focus: float
    """c > 0 [m]: half the distance between the foci."""
    radius: float
    """b > c [m]: geometric mean of the distances from the foci."""

    def __post_init__(self) -> None:
        positive("focus", self.focus)
        if not self.radius > self.focus:
            raise InvalidValueError("radius", self.radius, f"above focus = {self.focus}")

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        left, right = self._squares(x)
        return left * right - self.radius**4

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        left, right = self._squares(x)
        offset = np.array([self.focus, 0.0])
        return 2.0 * (right[..., None] * (x - offset) + left[..., None] * (x + offset))  # type: ignore[no-any-return]

    def _squares(self, x: Array) -> tuple[Array, Array]:
        offset = np.array([self.focus, 0.0])
        return np.sum((x - offset) ** 2, axis=-1), np.sum((x + offset) ** 2, axis=-1)


@dataclass(frozen=True)
class Bowtie:
    """x₁⁴ − a²x₁² + a²x₂² − a²w² [m⁴]: the lemniscate of Gerono, its knot opened to a waist."""

    half_length: float
    """a > 0 [m]."""
    waist: float
    """w > 0 [m]: half the height at x₁ = 0."""

    def __post_init__(self) -> None:
        positive("half_length", self.half_length)
        positive("waist", self.waist)

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        a, square = self.half_length, x * x
        return square[..., 0] ** 2 + a**2 * (square[..., 1] - square[..., 0] - self.waist**2)

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        a, along, across = self.half_length, x[..., 0], x[..., 1]
        return np.stack([4.0 * along**3 - 2.0 * a**2 * along, 2.0 * a**2 * across], axis=-1)


@dataclass(frozen=True)
class Egg:
    """a²x₁² + b²x₂²c^x₁ − r² [m²]: the sensing function of [ZNV] Figs. 2 and 5."""

    a: float
    """a > 0, dimensionless."""
    b: float
    """b > 0, dimensionless."""
    c: float
    """c > 0 [1 for x₁ in m]; above 1 the pointed end is towards +x₁."""
    radius: float
    """r > 0 [m]."""

    def __post_init__(self) -> None:
        for name in ("a", "b", "c", "radius"):
            positive(name, getattr(self, name))

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return (self.a * x[..., 0]) ** 2 + self._width_term(x) - self.radius**2

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        along = 2.0 * self.a**2 * x[..., 0] + np.log(self.c) * self._width_term(x)
        across = 2.0 * self.b**2 * x[..., 1] * self.c ** x[..., 0]
        return np.stack([along, across], axis=-1)

    def _width_term(self, x: Array) -> Array:
        return (self.b * x[..., 1]) ** 2 * self.c ** x[..., 0]


@dataclass(frozen=True)
class CShape:
    r"""A ring without its part beyond a line, with round ends: open towards +x₁.

    .. math:: \left(\frac{\|x\|^2 - R^2}{2 R w}\right)^2
        + \ln^2\!\left(1 + e^{k (x_1 - o)}\right) - 1
    """

    radius: float
    """R > 0 [m], of the ring's centre line."""
    half_width: float
    """w > 0 [m], of the ring."""
    opening: float
    """o in (−R, R) [m]: the x₁ at which the ring ends."""
    sharpness: float = 4.0
    """k > 0 [1/m]: the higher, the blunter the ends."""

    def __post_init__(self) -> None:
        for name in ("radius", "half_width", "sharpness"):
            positive(name, getattr(self, name))
        if not abs(self.opening) < self.radius:
            raise InvalidValueError("opening", self.opening, f"below {self.radius} in magnitude")

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return self._across(x) ** 2 + np.logaddexp(0.0, self._beyond(x)) ** 2 - 1.0  # type: ignore[no-any-return]

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        gradient = 2.0 * self._across(x)[..., None] * x / (self.radius * self.half_width)
        beyond = self._beyond(x)
        rise = np.logaddexp(0.0, beyond)
        gradient[..., 0] += 2.0 * self.sharpness * rise * np.exp(beyond - rise)
        return gradient

    def _across(self, x: Array) -> Array:
        scale = 2.0 * self.radius * self.half_width
        return (np.einsum("...i,...i", x, x) - self.radius**2) / scale  # type: ignore[no-any-return]

    def _beyond(self, x: Array) -> Array:
        return self.sharpness * (x[..., 0] - self.opening)


@dataclass(frozen=True)
class Torus:
    """(‖x‖² + R² − r²)² − 4R²(x₁² + x₂²) [m⁴]: a torus of R³ about the third axis."""

    major_radius: float
    """R > 0 [m], of the circle that the tube follows."""
    minor_radius: float
    """r in (0, R) [m], of the tube."""

    def __post_init__(self) -> None:
        positive("minor_radius", self.minor_radius)
        if not self.major_radius > self.minor_radius:
            allowed = f"above minor_radius = {self.minor_radius}"
            raise InvalidValueError("major_radius", self.major_radius, allowed)

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        in_plane = np.sum(x[..., :2] ** 2, axis=-1)
        return self._sum(x) ** 2 - 4.0 * self.major_radius**2 * in_plane  # type: ignore[no-any-return]

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        gradient: Array = 4.0 * self._sum(x)[..., None] * x
        gradient[..., :2] -= 8.0 * self.major_radius**2 * x[..., :2]
        return gradient

    def _sum(self, x: Array) -> Array:
        offset = self.major_radius**2 - self.minor_radius**2
        return np.einsum("...i,...i", x, x) + offset  # type: ignore[no-any-return]


class Cylinder(Ball):
    """The ball in all coordinates but the last [m²]: unbounded along the last axis."""

    def __call__(self, x: Array) -> Array:
        """Act as `ImplicitFunction.__call__`."""
        return super().__call__(x[..., :-1])

    def gradient(self, x: Array) -> Array:
        """Act as `ImplicitFunction.gradient`."""
        gradient = super().gradient(x)
        gradient[..., -1] = 0.0
        return gradient
