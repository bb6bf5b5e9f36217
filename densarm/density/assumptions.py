"""SceneAssumptions: what the convergence theorem of [ZNV] asks of a scene, measured."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from densarm.arrays import Array
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.implicit_function import Complement, ImplicitFunction
from densarm.density.set_distance import boundary_points, distance_from, smallest_gap
from densarm.errors import InvalidValueError
from densarm.validation import positive


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
        r"""Return the largest θ that Assumption 2 allows for an occupancy ε.

        .. math:: \theta \le \epsilon \min_k \frac{(V_{min}^k)^\alpha}{m(X_{u_k})}

        [ZNV] eq. 10 has no α; its proof bounds θ/V^α.

        Args:
            epsilon: ε > 0 [s], time over the starts' measure.
            alpha: α > 0.
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

    Raises:
        InvalidValueError: an extent of another shape.

    Source: [ZNV] section III, Assumption 2, and appendix.
    """
    box = np.asarray(extent, np.float64)
    n = density.goal.size
    if box.shape != (n, 2):
        raise InvalidValueError("extent", extent, f"of shape ({n}, 2)")
    h = [region.h for region in density.unsafe]
    s = [region.s for region in density.unsafe]
    h_rims = [boundary_points(function, box, samples) for function in h]
    s_rims = [boundary_points(function, box, samples) for function in s]
    sensing = smallest_gap(_pairs(s, s_rims))
    goal_gaps = [distance_from(density.goal, *each) for each in zip(h, h_rims, strict=True)]
    beyond_sensing = [Complement(function) for function in s]
    start_gap = smallest_gap(zip(h, beyond_sensing, h_rims, s_rims, strict=True)).distance
    grid = _Grid(box, side)
    slope, curvature = grid.psi_bounds(density) if start_gap > 0.0 else (np.inf, np.inf)
    off_axis = np.maximum(np.maximum(box[:, 0] - density.goal, density.goal - box[:, 1]), 0.0)
    inside = [grid.values(function) <= 0.0 for function in h]
    return SceneAssumptions(
        unsafe_gap=smallest_gap(_pairs(h, h_rims)).distance,
        sensing_gap=sensing.distance,
        sensing_overlaps=sensing.overlaps,
        start_gap=start_gap,
        goal_gap=min(goal_gaps, default=float("inf")),
        goal_is_sensed=any(float(function(density.goal)) < 0.0 for function in s),
        components=tuple(_parts(mask) for mask in inside),
        reaches_border=tuple(_meets_border(mask) for mask in inside),
        volume=tuple(float(mask.sum()) * grid.cell for mask in inside),
        v_min=tuple(gap**2 for gap in goal_gaps),
        v_slope_per_axis=float(2.0 * off_axis.min()),
        psi_slope=slope,
        psi_curvature=curvature,
    )


class _Grid:
    """Middles of equal cells of a box."""

    def __init__(self, box: Array, side: int) -> None:
        middles = (np.arange(side) + 0.5) / side
        axes = [low + (high - low) * middles for low, high in box]
        self.x: Array = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        self.cell = float(np.prod((box[:, 1] - box[:, 0]) / side))

    def values(self, function: ImplicitFunction) -> Array:
        return function(self.x)

    def psi_bounds(self, density: EuclideanDensity, step: float = 1e-5) -> tuple[float, float]:
        """Return the largest |∂Ψ/∂x_j| and |∂²Ψ/∂x_j²| over (some of) the sensed points."""
        sensed = np.zeros(self.x.shape[:-1], dtype=bool)
        for region in density.unsafe:
            sensed |= self.values(region.s) < 0.0
        x = self.x[sensed]
        x = x[:: max(1, len(x) // _BOUND_POINTS)]

        def slope(points: Array) -> Array:
            psi = np.exp(density.log_psi(points))
            return psi[:, np.newaxis] * density.log_psi_gradient(points)

        curvature = 0.0
        for i, axis in enumerate(step * np.eye(x.shape[-1])):
            change = slope(x + axis)[:, i] - slope(x - axis)[:, i]
            curvature = max(curvature, float(np.abs(change).max(initial=0.0)) / (2.0 * step))
        return float(np.abs(slope(x)).max(initial=0.0)), curvature


_BOUND_POINTS = 50_000


def _pairs(
    functions: Sequence[ImplicitFunction], rims: Sequence[Array]
) -> Iterator[tuple[ImplicitFunction, ImplicitFunction, Array, Array]]:
    for i, j in combinations(range(len(functions)), 2):
        yield functions[i], functions[j], rims[i], rims[j]


def _parts(mask: NDArray[np.bool_]) -> int:
    from scipy.ndimage import label

    return int(label(mask)[1])


def _meets_border(mask: NDArray[np.bool_]) -> bool:
    return any(bool(np.take(mask, (0, -1), axis=axis).any()) for axis in range(mask.ndim))
