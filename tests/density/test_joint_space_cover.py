import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import densarm
from densarm.density.joint_space_cover import CoverParameters, JointSpaceCover
from densarm.density.unsafe_cells import unsafe_components
from densarm.errors import InvalidValueError
from densarm.proof.swept_bound import SweptBound

SCENARIO = densarm.load_scenario("swing_up")
ARM = SCENARIO.arm
CLEARANCE = densarm.Clearance(ARM, SCENARIO.scene)
BOUND = SweptBound(CLEARANCE, margin=0.01)
COVER = JointSpaceCover(BOUND, CoverParameters(depth=7))

angle = st.floats(-np.pi, np.pi)


def log_bump(angles, theta=0.0):
    gradient = np.zeros(2)
    return COVER.add_log_bump(ARM.configuration(angles), theta, gradient), gradient


def test_every_unsafe_cell_lies_in_the_sensing_region_of_its_component():
    for component, region in zip(unsafe_components(BOUND, 7), COVER.regions, strict=True):
        # The region is convex, so that it contains a cell with the cell's corners.
        assert (region.ellipsoid.level(component.corners) < 1.0).all()
        assert set(component.pairs) == set(region.pairs)


def test_start_and_goal_are_outside_and_nothing_is_sensed_there():
    for angles in ([0.01, 0.01], [np.pi, 0.0]):
        assert (COVER.sensing_functions(ARM.configuration(angles)) > 0.0).all()
        value, gradient = log_bump(angles)
        assert value == 0.0
        assert not gradient.any()


@given(angle, angle)
def test_vanishes_exactly_where_the_arm_is_unsafe(first, second):
    distance = CLEARANCE.distances(ARM.configuration([first, second])).min() - 0.01
    assume(abs(distance) > 1e-5)
    value, gradient = log_bump([first, second])
    assert (value == -np.inf) == (distance < 0.0)
    assert np.isfinite(gradient).all()


@given(angle, angle, st.sampled_from([0.0, 1e-3]))
def test_gradient_is_the_derivative(first, second, theta):
    angles = np.array([first, second])
    assume(CLEARANCE.distances(ARM.configuration(angles)).min() > 0.05)
    _, gradient = log_bump(angles, theta)
    for i, axis in enumerate(1e-5 * np.eye(2)):
        ahead, behind = log_bump(angles + axis, theta)[0], log_bump(angles - axis, theta)[0]
        assert gradient[i] == pytest.approx((ahead - behind) / 2e-5, rel=1e-4, abs=1e-6)


@given(angle, angle, st.integers(-2, 2), st.integers(-2, 2))
def test_is_periodic(first, second, turns, more):
    value, gradient = log_bump([first, second])
    assume(np.isfinite(value))
    image, image_gradient = log_bump([first + 2.0 * np.pi * turns, second + 2.0 * np.pi * more])
    assert image == pytest.approx(value, rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(image_gradient, gradient, rtol=1e-6, atol=1e-9)


def test_shift_bounds_the_bump_from_below():
    inside = COVER.regions[0].ellipsoid.centre
    assert log_bump(inside)[0] == -np.inf
    assert log_bump(inside, 0.1)[0] == pytest.approx(np.log(0.1) + np.log(1.1), rel=1e-12)
    assert log_bump([np.pi, 0.0], 0.1)[0] == pytest.approx(2.0 * np.log(1.1), rel=1e-12)


def test_no_obstacle_in_reach_leaves_the_density_alone():
    ball = densarm.Sphere(name="ball", radius=0.2, position=[5.0, 0.0, 0.0])
    cover = JointSpaceCover(SweptBound(densarm.Clearance(ARM, densarm.Scene([ball]))))
    gradient = np.zeros(2)
    assert cover.regions == ()
    assert cover.add_log_bump(ARM.configuration([1.0, 2.0]), 0.0, gradient) == 0.0
    assert not gradient.any()


def test_refuses_a_sensing_region_wider_than_a_turn():
    with pytest.raises(InvalidValueError, match="width of a sensing region"):
        JointSpaceCover(BOUND, CoverParameters(depth=6, inflation=1.5))


@pytest.mark.parametrize("name", ["depth", "inflation", "sensing_distance"])
def test_refuses_parameters_that_are_not_positive(name):
    with pytest.raises(InvalidValueError, match=name):
        CoverParameters(**{name: 0})
