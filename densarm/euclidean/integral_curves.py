"""Integral curves of a navigation field on Rⁿ, from many starts at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from densarm.euclidean.fields import NavigationField
from densarm.values.arrays import Array
from densarm.values.checks import positive
from densarm.values.outcome import Outcome


@dataclass(frozen=True)
class CurveParameters:
    """Parameters of `integral_curves`."""

    tolerance: float = 1e-4
    """Largest estimated error of a step [m]."""
    reach_radius: float = 1e-3
    """Distance from the goal at which a curve has reached it [m]."""
    longest_curve: float = 1e3
    """Length at which a curve is given up [m]."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            positive(name, value)


@dataclass(frozen=True)
class IntegralCurves:
    """How the curves from N starts ended."""

    outcome: NDArray[np.str_]
    """The word of an `Outcome` (N,): reached, stuck, collided, timed_out or infeasible."""
    end: Array
    """Last points (N, n) [m]."""
    length: Array
    """Lengths (N,) [m]."""
    smallest_h: Array
    """Smallest value of any obstacle's h on each curve (N,), in its unit; +inf of none."""
    paths: list[Array]
    """Points of each curve (M_i, n) [m], start and end included; empty unless recorded."""

    def count(self, outcome: Outcome) -> int:
        """Return the number of curves with an outcome."""
        return int(np.count_nonzero(self.outcome == outcome))


def integral_curves(
    field: NavigationField,
    starts: Array,
    parameters: CurveParameters = CurveParameters(),
    record: bool = False,
) -> IntegralCurves:
    """Follow dx/ds = k(x)/‖k(x)‖ from starts (N, n) [m], and record the points if asked to.

    Along the rim of a sensing region the field is stiff, so the integrator is a Rosenbrock method
    of order 2, with a step of its own for each start. A step is shortened where its error exceeds
    the tolerance or where it does not climb, as it cannot from a maximum; it is no longer than
    half the distance to the goal, or half of h/‖∇h‖, an obstacle's distance to first order, plus
    the tolerance. A step into an obstacle counts if it is accurate: the field does enter.

    A curve has *reached* within the reach radius; has *collided* at h ≤ 0; is *stuck* where k
    vanishes or no longer climbs; is *infeasible* if it starts in an obstacle.

    Source: L. F. Shampine, M. W. Reichelt, SIAM J. Sci. Comput. 18(1), 1997, section 3.
    """
    front = _Front(field, np.array(starts, np.float64), parameters)
    history = [(np.arange(len(starts)), front.x.copy())] if record else []
    for _ in range(_MOST_STEPS):
        moved = front.advance()
        if record:
            history.append((moved, front.x[moved]))
        if front.active.size == 0:
            break
    return IntegralCurves(
        front.outcome,
        front.x,
        front.length,
        front.smallest_h,
        _assemble(history, len(starts)) if record else [],
    )


class _Front:
    """The points that the curves have come to."""

    def __init__(self, field: NavigationField, x: Array, parameters: CurveParameters) -> None:
        self.field, self.x, self.parameters = field, x, parameters
        count = len(x)
        self.smallest_h, self.longest = self._surroundings(x)
        self.length = np.zeros(count)
        self.step = np.full(count, _LONGEST_STEP)
        self.slope = self._unit_at(self.x)
        self.height = self.field.height(self.x)
        self.outcome = np.full(count, Outcome.TIMED_OUT, dtype="U10")
        self.outcome[self.smallest_h <= 0.0] = Outcome.INFEASIBLE
        self.active = np.flatnonzero(self.smallest_h > 0.0)
        self._retire()

    def advance(self) -> NDArray[np.intp]:
        """Try one step of each active curve; return the indices of those that moved."""
        i, p = self.active, self.parameters
        x, f0 = self.x[i], self.slope[i]
        step = np.minimum(self.step[i], self.longest[i])
        ahead, f2, error = self._rosenbrock(x, f0, step)
        height = self.field.height(ahead)
        smallest, longest = self._surroundings(ahead)
        climbed = (height > self.height[i]) | (smallest <= 0.0)
        accepted = (error <= p.tolerance) & climbed
        factor = 0.9 * np.cbrt(p.tolerance / np.maximum(error, 1e-300))
        factor = np.where(climbed, np.clip(factor, 0.2, 5.0), np.clip(factor, 0.2, 0.5))
        self.step[i] = np.minimum(step * factor, _LONGEST_STEP)
        moved = i[accepted]
        self.x[moved], self.slope[moved] = ahead[accepted], f2[accepted]
        self.height[moved] = height[accepted]
        self.length[moved] += np.linalg.norm(ahead - x, axis=-1)[accepted]
        self.smallest_h[moved] = np.minimum(self.smallest_h[moved], smallest[accepted])
        self.longest[moved] = longest[accepted]
        self._retire()
        return moved

    def _rosenbrock(self, x: Array, f0: Array, step: Array) -> tuple[Array, Array, Array]:
        """Return the points (N, n) a step ahead, the field there, and error estimates (N,)."""
        size = step[:, np.newaxis]
        system = np.eye(x.shape[-1]) - _DAMPING * size[..., np.newaxis] * self._jacobian(x, f0)

        def solve(right: Array) -> Array:
            k = np.linalg.solve(system, right[..., np.newaxis])[..., 0]
            # The field has length one: a longer k is of a singular system, far off the curve.
            return k / np.maximum(np.linalg.norm(k, axis=-1, keepdims=True) / _LONGEST_K, 1.0)  # type: ignore[no-any-return]

        k1 = solve(f0)
        f1 = self._unit_at(x + 0.5 * size * k1)
        k2 = solve(f1 - k1) + k1
        ahead = x + size * k2
        f2 = self._unit_at(ahead)
        k3 = solve(f2 - _ERROR_WEIGHT * (k2 - f1) - 2.0 * (k1 - f0))
        return ahead, f2, step / 6.0 * np.linalg.norm(k1 - 2.0 * k2 + k3, axis=-1)

    def _jacobian(self, x: Array, f0: Array) -> Array:
        """Return ∂f/∂x (N, n, n) at points (N, n) with values `f0` (N, n), by differences."""
        axes = _DIFFERENCE * np.eye(x.shape[-1])
        ahead = self._unit_at(x[:, np.newaxis, :] + axes)
        return np.swapaxes(ahead - f0[:, np.newaxis, :], 1, 2) / _DIFFERENCE

    def _surroundings(self, x: Array) -> tuple[Array, Array]:
        """Return the smallest h (N,) and the longest step [m] at points (N, n)."""
        p, smallest = self.parameters, np.full(len(x), np.inf)
        longest = 0.5 * np.linalg.norm(x - self.field.goal, axis=-1)
        for obstacle in self.field.obstacles:
            h, slope = obstacle(x), np.linalg.norm(obstacle.gradient(x), axis=-1)
            smallest = np.minimum(smallest, h)
            distance = np.abs(h) / np.maximum(slope, 1e-300)
            longest = np.minimum(longest, 0.5 * distance + p.tolerance)
        return smallest, longest

    def _retire(self) -> None:
        """Give every active curve that has ended its outcome."""
        i, p = self.active, self.parameters
        distance = np.linalg.norm(self.x[i] - self.field.goal, axis=-1)
        still = np.linalg.norm(self.slope[i], axis=-1) == 0.0
        ends = (
            (self.length[i] > p.longest_curve, Outcome.TIMED_OUT),
            (still | (self.step[i] < _SHORTEST_STEP), Outcome.STUCK),
            (distance <= p.reach_radius, Outcome.REACHED),
            (self.smallest_h[i] <= 0.0, Outcome.COLLIDED),
        )
        for ended, outcome in ends:
            self.outcome[i[ended]] = outcome
        self.active = i[~np.any([ended for ended, _ in ends], axis=0)]

    def _unit_at(self, x: Array) -> Array:
        k = self.field.direction(x)
        norm = np.linalg.norm(k, axis=-1, keepdims=True)
        return np.asarray(k / np.where(norm > 0.0, norm, 1.0))


_LONGEST_STEP = 0.25  # [m]
_SHORTEST_STEP = 1e-6  # a curve that can climb in shorter steps alone is at a critical point [m]
_MOST_STEPS = 20_000  # after which all curves are given up
_DIFFERENCE = 1e-8  # of points for the Jacobian [m]
_DAMPING = 1.0 / (2.0 + np.sqrt(2.0))  # makes the method L-stable
_LONGEST_K = 4.0
_ERROR_WEIGHT = 6.0 + np.sqrt(2.0)


def _assemble(history: list[tuple[NDArray[np.intp], Array]], count: int) -> list[Array]:
    index, points = (np.concatenate(column) for column in zip(*history, strict=True))
    order = np.argsort(index, kind="stable")
    return np.split(points[order], np.searchsorted(index[order], np.arange(1, count)))
