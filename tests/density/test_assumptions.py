from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from densarm.density.assumptions import check_assumptions
from densarm.density.euclidean_density import EuclideanDensity
from densarm.density.implicit_function import Placed, UnsafeRegion
from densarm.density.implicit_shapes import Ball, Ellipsoid, HalfSpace
from densarm.density.navigation_density import DensityParameters
from densarm.errors import InvalidValueError

SQUARE = [[-5.0, 5.0], [-5.0, 5.0]]
GOAL = (4.0, 0.0)


def disc(radius, sensed, centre=(0.0, 0.0)):
    return UnsafeRegion(Placed(Ball(radius), centre), Placed(Ball(sensed), centre))


def check(*regions, goal=GOAL, extent=SQUARE, theta=0.0):
    density = EuclideanDensity(regions, goal, DensityParameters(theta=theta))
    return check_assumptions(density, extent, side=200, samples=200)


def test_two_discs_have_their_closed_forms():
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


def test_bounds_of_psi_are_those_along_a_radius():
    region = disc(1.0, 2.0)
    found = check(region)
    radius = np.linspace(1.001, 1.999, 4001)
    x = np.stack([radius, np.zeros_like(radius)], axis=1)
    psi = np.exp(EuclideanDensity([region], GOAL).log_psi(x))
    slope = np.gradient(psi, radius)
    assert found.psi_slope == pytest.approx(np.abs(slope).max(), rel=0.01)
    assert found.psi_curvature == pytest.approx(np.abs(np.gradient(slope, radius)).max(), rel=0.03)


def test_the_slope_of_v_along_an_axis_vanishes_unless_the_goal_is_off_the_workspace():
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
def test_a_broken_distance_is_zero(region, broken):
    found = check(region)
    assert getattr(found, broken) == 0.0
    assert found.zeta == 0.0
    assert not found.distances_hold


def test_a_jump_of_psi_has_no_bounds():
    loose = UnsafeRegion(Ball(1.0), Ellipsoid((0.8, 2.0), 1.5))  # ends inside the disc
    found = check(loose)
    assert found.psi_slope == found.psi_curvature == np.inf


def test_overlapping_sets_and_a_set_of_two_parts_do_not_hold():
    assert not check(disc(1.0, 1.5), disc(1.0, 1.5, (1.5, 0.0))).distances_hold

    class TwoDiscs:
        parts = (Placed(Ball(0.5), (0.0, 2.0)), Placed(Ball(0.5), (0.0, -2.0)))

        def __call__(self, x):
            return np.minimum(*(part(x) for part in self.parts))

        def gradient(self, x):
            first, second = self.parts
            lower = (first(x) < second(x))[..., np.newaxis]
            return np.where(lower, first.gradient(x), second.gradient(x))

    found = check(UnsafeRegion(TwoDiscs(), Ball(4.0)), goal=(4.5, 0.0))
    assert found.components == (2,)
    assert found.zeta > 0.0
    assert not found.distances_hold


def test_a_set_without_end_meets_the_border():
    wall = UnsafeRegion(
        Placed(HalfSpace((1.0, 0.0)), (-3.0, 0.0)), Placed(HalfSpace((1.0, 0.0)), (-2.0, 0.0))
    )
    found = check(wall)
    assert found.reaches_border == (True,)
    assert found.volume == pytest.approx((20.0,), rel=0.02)
    assert found.start_gap == pytest.approx(1.0, abs=1e-6)


def test_the_result_is_frozen_and_odd_arguments_are_refused():
    found = check(disc(1.0, 1.5))
    with pytest.raises(FrozenInstanceError):
        found.zeta_m = 1.0
    with pytest.raises(InvalidValueError, match="epsilon"):
        found.largest_theta(0.0)
    with pytest.raises(InvalidValueError, match="extent"):
        check(disc(1.0, 1.5), extent=[[-1.0, 1.0]])
