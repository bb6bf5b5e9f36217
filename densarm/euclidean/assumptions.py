"""SceneAssumptions: what the convergence theorem of [ZNV] asks of a scene, measured."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.errors import InvalidValueError
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import Complement, ImplicitFunction, smallest_value
from densarm.values.arrays import Array
from densarm.values.checks import positive


@dataclass(frozen=True)
class SceneAssumptions:
    """Assumption 2 of [ZNV] in one scene and workspace, with what its proof uses besides."""

    unsafe_gap: float
    """Smallest distance between two unsafe sets [m]; 0 of overlapping ones, +inf of one set."""
    sensing_gap: float
    """Smallest distance between two sensing regions [m]; 0 and +inf likewise."""
    sensing_overlaps: int
    """Pairs of sensing regions that overlap."""
    start_gap: float
    """Smallest distance from an unsafe set to where its sensing region ends, beyond which the
    proof has its starts (Ψ = 1) [m]; 0 if some region does not enclose its set."""
    goal_gap: float
    """Distance of the goal from the nearest unsafe set [m]; 0 inside."""
    goal_is_sensed: bool
    """Whether the goal lies in a sensing region, where Ψ < 1."""
    components: tuple[int, ...]
    """Connected parts of each unsafe set in the workspace, on the grid."""
    reaches_border: tuple[bool, ...]
    """Whether each unsafe set meets the border of the workspace, on the grid."""
    volume: tuple[float, ...]
    """m(X_uk), by the grid [mⁿ]."""
    v_min: tuple[float, ...]
    """Smallest V in each unsafe set, V = ‖x − x_goal‖² [m²]."""
    v_slope_per_axis: float
    """Smallest |∂V/∂x_j| of any j in the workspace [m], which Assumption 2 wants above 0; it is 0
    in every workspace that meets a plane x_j = x_goal,j. The proof needs ‖∇V‖ = 2√V alone."""
    psi_slope: float
    """Largest |∂Ψ/∂x_j| at the grid's points in sensing regions [1/m]; +inf where Ψ jumps."""
    psi_curvature: float
    """Largest |∂²Ψ/∂x_j²| there, by differences [1/m²]; +inf where Ψ jumps."""

    @property
    def zeta(self) -> float:
        """ζ: the smallest of the distances that must be above zero [m]."""
        return min(self.unsafe_gap, self.start_gap, self.goal_gap)

    @property
    def distances_hold(self) -> bool:
        """Whether ζ > 0 and every unsafe set is one connected part."""
        return self.zeta > 0.0 and max(self.components, default=1) <= 1

    def largest_theta(self, epsilon: float, alpha: float = 1.0) -> float:
        """Return ε min V_min^α/m(X_uk), the largest θ of Assumption 2 for an occupancy ε > 0 [s].

        [ZNV] eq. 10 has no α; its proof bounds θ/V^α.
        """
        positive("epsilon", epsilon)
        bounds = [
            value**alpha / volume
            for value, volume in zip(self.v_min, self.volume, strict=True)
            if volume > 0.0
        ]
        return epsilon * min(bounds, default=float("inf"))


def check_assumptions(
    density: EuclideanDensity, extent: ArrayLike, side: int, samples: int = 1000
) -> SceneAssumptions:
    """Measure what the theorem of [ZNV] asks of a scene.

    Distances are by local optimisation from samples of the boundaries, so upper bounds; volumes,
    parts and bounds on Ψ are of a grid, which misses what is finer than its step.

    Args:
        density: its unsafe sets, sensing regions, goal, α and θ.
        extent: bounds of the workspace X, shape (n, 2) [m].
        side: points of the grid along each axis.
        samples: random points that look for each boundary.

    Source: [ZNV] section III, Assumption 2, and appendix.
    """
    from scipy.ndimage import label

    box = np.asarray(extent, np.float64)
    n = density.goal.size
    if box.shape != (n, 2):
        raise InvalidValueError("extent", extent, f"of shape ({n}, 2)")
    h, s = density.obstacles, [region.s for region in density.unsafe]
    unsafe = [(function, boundary_points(function, box, samples)) for function in h]
    sensed = [(function, boundary_points(function, box, samples)) for function in s]
    beyond_sensed = [(Complement(function), rim) for function, rim in sensed]
    sensing_gap, sensing_overlaps = smallest_gap(combinations(sensed, 2))
    start_gap, _ = smallest_gap(zip(unsafe, beyond_sensed, strict=True))
    goal_gaps = [distance_from(density.goal, *each) for each in unsafe]
    middles = (np.arange(side) + 0.5) / side
    axes = [low + (high - low) * middles for low, high in box]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    cell = float(np.prod((box[:, 1] - box[:, 0]) / side))
    near = x[smallest_value(s, x) < 0.0]
    slope, curvature = _psi_bounds(density, near) if start_gap > 0.0 else (np.inf, np.inf)
    off_axis = np.maximum(np.maximum(box[:, 0] - density.goal, density.goal - box[:, 1]), 0.0)
    inside = [function(x) <= 0.0 for function in h]
    return SceneAssumptions(
        unsafe_gap=smallest_gap(combinations(unsafe, 2))[0],
        sensing_gap=sensing_gap,
        sensing_overlaps=sensing_overlaps,
        start_gap=start_gap,
        goal_gap=min(goal_gaps, default=float("inf")),
        goal_is_sensed=any(float(function(density.goal)) < 0.0 for function in s),
        components=tuple(int(label(mask)[1]) for mask in inside),
        reaches_border=tuple(_meets_border(mask) for mask in inside),
        volume=tuple(float(mask.sum()) * cell for mask in inside),
        v_min=tuple(gap**2 for gap in goal_gaps),
        v_slope_per_axis=float(2.0 * off_axis.min()),
        psi_slope=slope,
        psi_curvature=curvature,
    )


def _psi_bounds(density: EuclideanDensity, x: Array) -> tuple[float, float]:
    """Return the largest |∂Ψ/∂x_j| and |∂²Ψ/∂x_j²| over (some of) the points (N, n)."""

    def slope(points: Array) -> Array:
        psi = np.exp(density.log_psi(points))
        return psi[:, np.newaxis] * density.log_psi_gradient(points)

    x = x[:: max(1, len(x) // _BOUND_POINTS)]
    curvature, step = 0.0, 1e-5
    for i, axis in enumerate(step * np.eye(x.shape[-1])):
        change = slope(x + axis)[:, i] - slope(x - axis)[:, i]
        curvature = max(curvature, float(np.abs(change).max(initial=0.0)) / (2.0 * step))
    return float(np.abs(slope(x)).max(initial=0.0)), curvature


def _meets_border(mask: NDArray[np.bool_]) -> bool:
    return any(bool(np.take(mask, (0, -1), axis=axis).any()) for axis in range(mask.ndim))


def boundary_points(function: ImplicitFunction, extent: Array, count: int) -> Array:
    """Return the points (M, n) of {f = 0} in a box (n, 2) [m] that `count` random points find.

    They move by Newton's method along ∇f; some find no boundary, or find it out of the box.
    """
    x = np.random.default_rng(0).uniform(extent[:, 0], extent[:, 1], (count, len(extent)))
    longest = 0.1 * float(np.ptp(extent, axis=1).max())
    for _ in range(_ITERATIONS):
        gradient = function.gradient(x)
        square = np.maximum(np.sum(gradient**2, axis=-1, keepdims=True), 1e-300)
        move = -function(x)[:, np.newaxis] * gradient / square
        length = np.linalg.norm(move, axis=-1, keepdims=True)
        x = x + move * np.minimum(1.0, longest / np.maximum(length, 1e-300))
    inside = ((x >= extent[:, 0]) & (x <= extent[:, 1])).all(axis=1)
    # The next move tells how far off the boundary a point still is.
    found: Array = x[inside & (length[:, 0] < _TOLERANCE)]
    return found


def smallest_gap(
    pairs: Iterable[tuple[tuple[ImplicitFunction, Array], tuple[ImplicitFunction, Array]]],
) -> tuple[float, int]:
    """Return min ‖x − y‖ over f(x) = 0 and g(y) = 0 of any pair of sets [m], and the overlaps.

    Each set is its function and points (M, n) of its boundary [m]. The distance is found by SLSQP
    from the nearest samples of the five nearest pairs: an upper bound; 0 if any pair overlaps,
    +inf of no pair. Two sets overlap if a sample of either lies in the other.
    """
    from scipy.spatial import KDTree

    candidates, overlaps = [], 0
    for (first, x), (second, y) in pairs:
        if min(len(x), len(y)) == 0:
            continue
        if (first(y) <= 0.0).any() or (second(x) <= 0.0).any():
            overlaps += 1
            continue
        distance, nearest = KDTree(y).query(x)
        start = int(np.argmin(distance))
        guess = np.concatenate([x[start], y[nearest[start]]])
        candidates.append((float(distance[start]), (first, second), guess))
    if overlaps:
        return 0.0, overlaps
    candidates.sort(key=lambda candidate: candidate[0])
    polished = [_polished(sets, guess, d) for d, sets, guess in candidates[:_POLISHED]]
    return min(polished, default=float("inf")), 0


def distance_from(point: Array, function: ImplicitFunction, boundary: Array) -> float:
    """Return the distance of a point (n,) from a set with a sampled boundary [m]; 0 inside."""
    if function(point) <= 0.0:
        return 0.0
    if len(boundary) == 0:
        return float("inf")
    distance = np.linalg.norm(boundary - point, axis=1)
    guess = np.concatenate([point, boundary[np.argmin(distance)]])
    return _polished((None, function), guess, float(distance.min()))


def _polished(
    functions: tuple[ImplicitFunction | None, ImplicitFunction], guess: Array, sampled: float
) -> float:
    """Return the least ‖x − y‖ near a guess (x, y); without a first function x is fixed."""
    from scipy.optimize import minimize

    n = guess.size // 2
    fixed, free = np.split(guess, [n if functions[0] is None else 0])

    def pair(z: Array) -> Array:
        return np.concatenate([fixed, z]).reshape(2, n)

    def square(z: Array) -> tuple[float, Array]:
        difference = np.subtract(*pair(z))
        slope = 2.0 * np.concatenate([difference, -difference])
        return float(difference @ difference), slope[fixed.size :]

    def on_boundary(function: ImplicitFunction, k: int) -> dict[str, Any]:
        scale = 1.0 / max(float(np.linalg.norm(function.gradient(pair(free)[k]))), 1e-12)

        def slope(z: Array) -> Array:
            gradient = np.zeros((2, n))
            gradient[k] = scale * function.gradient(pair(z)[k])
            return gradient.ravel()[fixed.size :]

        return {"type": "eq", "fun": lambda z: scale * float(function(pair(z)[k])), "jac": slope}

    constraints = [on_boundary(f, k) for k, f in enumerate(functions) if f is not None]
    precise = {"ftol": _TOLERANCE**2, "maxiter": 1000}  # of a square
    found = minimize(
        square, free, jac=True, method="SLSQP", constraints=constraints, options=precise
    )
    violation = max(abs(each["fun"](found.x)) for each in constraints)
    polished = float(np.linalg.norm(np.subtract(*pair(found.x))))
    return polished if violation < 1e-6 and polished <= sampled else sampled


_BOUND_POINTS = 50_000  # at which Ψ is bounded
_ITERATIONS = 60
_TOLERANCE = 1e-9  # of points of a boundary [m]
_POLISHED = 5  # pairs whose distance is made exact
