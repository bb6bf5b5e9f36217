from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.errors import InvalidValueError
from densarm.euclidean.assumptions import (
    SceneAssumptions,
    boundary_points,
    check_assumptions,
    distance_from,
    smallest_gap,
)
from densarm.euclidean.density import EuclideanDensity
from densarm.euclidean.implicit import ImplicitFunction, Placed, UnsafeRegion
from densarm.euclidean.shapes import Ball, Cylinder, Ellipsoid
from densarm.values.arrays import Array

SQUARE = [[-5.0, 5.0], [-5.0, 5.0]]
GOAL = (4.0, 0.0)
EXTENT = np.array([[-6.0, 6.0], [-6.0, 6.0]])


def disc(radius: float, sensed: float, centre: tuple[float, float] = (0.0, 0.0)) -> UnsafeRegion:
    return UnsafeRegion(Placed(Ball(radius), centre), Placed(Ball(sensed), centre))


def check(
    *regions: UnsafeRegion,
    goal: tuple[float, float] = GOAL,
    extent: list[list[float]] = SQUARE,
) -> SceneAssumptions:
    density = EuclideanDensity(regions, goal)
    return check_assumptions(density, extent, side=200, samples=200)


def test_two_discs_have_their_closed_forms() -> None:
    found = check(disc(1.0, 1.6), disc(0.5, 1.0, (-2.5, 0.0)))
    assert found.unsafe_gap == pytest.approx(1.0, abs=1e-6)
    assert found.sensing_gap == 0.0
    assert found.sensing_overlaps == 1
    assert found.start_gap == pytest.approx(0.5, abs=1e-6)
    assert found.goal_gap == pytest.approx(3.0, abs=1e-6)
    assert found.zeta == pytest.approx(0.5, abs=1e-6)
    assert found.v_min == pytest.approx((9.0, 36.0), abs=1e-5)
    assert found.volume == pytest.approx((np.pi, np.pi / 4.0), rel=0.02)
    assert found.components == (1, 1)
    assert found.reaches_border == (False, False)
    assert not found.goal_is_sensed
    assert found.distances_hold
    # The unsafe set that comes first is nearer for its size, and binds.
    assert found.largest_theta(0.1) == pytest.approx(0.1 * 9.0 / np.pi, rel=0.02)
    assert found.largest_theta(0.1, alpha=2.0) == pytest.approx(0.1 * 81.0 / np.pi, rel=0.02)


def test_bounds_of_psi_are_those_along_a_radius() -> None:
    region = disc(1.0, 2.0)
    found = check(region)
    radius = np.linspace(1.001, 1.999, 4001)
    x = np.stack([radius, np.zeros_like(radius)], axis=1)
    psi = np.exp(EuclideanDensity([region], GOAL).log_psi(x))
    slope = np.gradient(psi, radius)
    assert found.psi_slope == pytest.approx(np.abs(slope).max(), rel=0.01)
    assert found.psi_curvature == pytest.approx(np.abs(np.gradient(slope, radius)).max(), rel=0.03)


def test_the_slope_of_v_along_an_axis_vanishes_unless_the_goal_is_off_the_workspace() -> None:
    assert check(disc(1.0, 1.5)).v_slope_per_axis == 0.0
    beyond = check(disc(1.0, 1.5), goal=(7.0, 9.0))
    assert beyond.v_slope_per_axis == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("region", "broken"),
    [
        (disc(1.0, 0.9), "start_gap"),
        (disc(1.0, 1.5, (4.2, 0.0)), "goal_gap"),
    ],
)
def test_a_broken_distance_is_zero(region: UnsafeRegion, broken: str) -> None:
    found = check(region)
    assert getattr(found, broken) == 0.0
    assert found.zeta == 0.0
    assert not found.distances_hold


def test_a_jump_of_psi_has_no_bounds() -> None:
    loose = UnsafeRegion(Ball(1.0), Ellipsoid((0.8, 2.0), 1.5))  # ends inside the disc
    found = check(loose)
    assert found.psi_slope == found.psi_curvature == np.inf


def test_overlapping_sets_and_a_set_of_two_parts_do_not_hold() -> None:
    assert not check(disc(1.0, 1.5), disc(1.0, 1.5, (1.5, 0.0))).distances_hold

    class TwoDiscs:
        parts = (Placed(Ball(0.5), (0.0, 2.0)), Placed(Ball(0.5), (0.0, -2.0)))

        def __call__(self, x: Array) -> Array:
            return np.minimum(*(part(x) for part in self.parts))

        def gradient(self, x: Array) -> Array:
            first, second = self.parts
            lower = (first(x) < second(x))[..., np.newaxis]
            return np.where(lower, first.gradient(x), second.gradient(x))

    found = check(UnsafeRegion(TwoDiscs(), Ball(4.0)), goal=(4.5, 0.0))
    assert found.components == (2,)
    assert found.zeta > 0.0
    assert not found.distances_hold


def test_a_set_without_end_meets_the_border() -> None:
    found = check(UnsafeRegion(Cylinder(1.0), Cylinder(2.0)))
    assert found.reaches_border == (True,)
    assert found.volume == pytest.approx((20.0,), rel=0.02)
    assert found.start_gap == pytest.approx(1.0, abs=1e-6)


def test_the_result_is_frozen_and_odd_arguments_are_refused() -> None:
    found = check(disc(1.0, 1.5))
    with pytest.raises(FrozenInstanceError):
        found.start_gap = 1.0  # type: ignore[misc]
    with pytest.raises(InvalidValueError, match="epsilon"):
        found.largest_theta(0.0)
    with pytest.raises(InvalidValueError, match="extent"):
        check(disc(1.0, 1.5), extent=[[-1.0, 1.0]])


def bounded(function: ImplicitFunction) -> tuple[ImplicitFunction, Array]:
    return function, boundary_points(function, EXTENT, 100)


@pytest.mark.parametrize("function", [Ball(2.0), Ellipsoid((0.5, 2.0), 1.5), Cylinder(1.0)])
def test_boundary_points_are_on_the_boundary_and_in_the_box(function: ImplicitFunction) -> None:
    x = boundary_points(function, EXTENT, 100)
    assert len(x) > 20
    slope = np.linalg.norm(function.gradient(x), axis=1)
    np.testing.assert_allclose(function(x) / slope, 0.0, atol=1e-9)
    assert (np.abs(x) <= 6.0).all()


@settings(max_examples=8)
@given(st.floats(0.0, 2.0 * np.pi), st.floats(1.0, 4.0), st.floats(0.3, 1.0), st.floats(0.3, 1.0))
def test_distance_of_two_discs(bearing: float, apart: float, first: float, second: float) -> None:
    centre = apart * np.array([np.cos(bearing), np.sin(bearing)])
    gap, overlaps = smallest_gap([(bounded(Ball(first)), bounded(Placed(Ball(second), centre)))])
    expected = apart - first - second
    if expected > 0.0:
        assert gap == pytest.approx(expected, abs=1e-6)
        assert overlaps == 0
    elif expected < -0.1:
        assert gap == 0.0
        assert overlaps == 1


def test_the_nearest_of_many_pairs_counts() -> None:
    discs = [Placed(Ball(0.5), (x, 0.0)) for x in (-4.0, -1.0, 1.0, 5.0)]
    pairs = [(bounded(discs[i]), bounded(discs[j])) for i in range(4) for j in range(i)]
    assert smallest_gap(pairs)[0] == pytest.approx(1.0, abs=1e-6)
    assert smallest_gap([]) == (np.inf, 0)


def test_distance_of_a_point() -> None:
    ellipse = Placed(Ellipsoid((0.5, 1.0), 1.0), (1.0, 0.0))
    rim = boundary_points(ellipse, EXTENT, 200)
    assert distance_from(np.array([5.0, 0.0]), ellipse, rim) == pytest.approx(2.0, abs=1e-6)
    assert distance_from(np.array([1.0, 3.0]), ellipse, rim) == pytest.approx(2.0, abs=1e-6)
    assert distance_from(np.array([1.5, 0.2]), ellipse, rim) == 0.0
    assert distance_from(np.zeros(2), ellipse, rim[:0]) == 0.0


def test_refuses_a_weighted_density() -> None:
    density = EuclideanDensity([disc(1.0, 1.6)], GOAL, weights=[2.0, 1.0])
    with pytest.raises(InvalidValueError, match="weights of V"):
        check_assumptions(density, SQUARE, side=10)
