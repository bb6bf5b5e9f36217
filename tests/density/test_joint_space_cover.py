"""The cover of a joint space: every unsafe configuration is in a cell, and sensed around it."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.density.joint_space_cover import (
    Ellipsoid,
    JointSpaceCover,
    UnsafeComponent,
    enclosing_ellipsoid,
    unsafe_components,
)
from densarm.errors import InvalidValueError
from densarm.scenarios.scenario import Scenario
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

MARGIN = 0.01  # [m]
angle = st.floats(-np.pi, np.pi)


# Ellipsoids


@settings(max_examples=25)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 3), count=st.integers(6, 60))
def test_ellipsoid_encloses_every_point(seed: int, n: int, count: int) -> None:
    points = np.random.default_rng(seed).normal(size=(count, n))
    assert (enclosing_ellipsoid(points).level(points) <= 1.0).all()


def test_ellipsoid_of_a_box_is_its_circumscribed_ellipse() -> None:
    ellipse = enclosing_ellipsoid(np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [0.0, 2.0]]))
    np.testing.assert_allclose(ellipse.centre, [3.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(ellipse.semi_axes, np.sqrt(2.0) * np.array([1.0, 3.0]))
    np.testing.assert_allclose(ellipse.extent, np.sqrt(2.0) * np.array([3.0, 1.0]))


@given(turn=st.floats(0.0, 3.0), by=st.floats(0.0, 2.0))
def test_inflation_lengthens_every_semi_axis(turn: float, by: float) -> None:
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    ellipse = Ellipsoid(np.array([1.0, -2.0]), (rotation * np.array([0.25, 4.0])) @ rotation.T)
    inflated = ellipse.inflated(by)
    np.testing.assert_allclose(inflated.semi_axes, np.array([0.5, 2.0]) + by)
    np.testing.assert_allclose(
        inflated.level(ellipse.centre + (2.0 + by) * rotation[:, 1]), 1.0, rtol=1e-9
    )


def test_ellipsoid_does_not_deflate() -> None:
    with pytest.raises(InvalidValueError, match=r"by = -0\.1"):
        Ellipsoid(np.zeros(2), np.eye(2)).inflated(-0.1)


# Cells


@pytest.fixture(scope="module")
def two_link() -> Arm:
    return load_arm("two_link")


@pytest.fixture(scope="module")
def check_among(two_link: Arm) -> Callable[..., SweptCheck]:
    """Return a maker of swept checks of the two-link arm among balls, by their x and z."""

    def make(*centres: tuple[float, float], margin: float = 0.0) -> SweptCheck:
        balls = [
            Sphere(name=f"ball {k}", radius=0.2, position=(x, 0.0, z))
            for k, (x, z) in enumerate(centres)
        ]
        return SweptCheck(World(two_link, Scene(balls)), margin)

    return make


def is_inside(angles: Array, components: Iterable[UnsafeComponent]) -> bool:
    for component in components:
        error = angles - component.centre
        error -= 2.0 * np.pi * np.round(error / (2.0 * np.pi))
        if (np.abs(error) <= component.half_width + 1e-12).all(axis=1).any():
            return True
    return False


@pytest.mark.parametrize("margin", [0.0, 0.05])
def test_every_unsafe_configuration_is_in_a_cell(
    check_among: Callable[..., SweptCheck], margin: float
) -> None:
    check = check_among((-1.5, -0.5), (1.5, -0.5), margin=margin)
    components = unsafe_components(check, depth=6)
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (4000, 2))
    unsafe = np.array(
        [not check.configuration_is_clear(q) for q in check.arm.configurations(angles)]
    )
    assert unsafe.sum() > 100
    assert all(is_inside(theta, components) for theta in angles[unsafe])
    share = sum(len(component.centre) for component in components) / 64**2
    assert share < 2.0 * np.mean(unsafe)


def test_swing_up_has_one_component_per_ball_and_only_the_outer_link_touches(
    check_among: Callable[..., SweptCheck],
) -> None:
    check = check_among((-1.5, -0.5), (1.5, -0.5))
    components = unsafe_components(check)
    pairs = check.world.pairs
    touching = [[pairs[k] for k in component.pairs] for component in components]
    assert sorted(touching) == [[("lower_link_0", "ball 0")], [("lower_link_0", "ball 1")]]


def test_component_across_the_half_turn_is_unwrapped(
    check_among: Callable[..., SweptCheck],
) -> None:
    (component,) = unsafe_components(check_among((0.0, 1.6)), depth=6)
    assert np.ptp(component.centre, axis=0).max() < 4.5
    assert np.abs(component.centre[:, 0]).max() > np.pi
    width = 2.0 * component.half_width
    assert len(component.corners) < 2 * len(component.centre)
    np.testing.assert_allclose(
        component.corners.min(axis=0), component.centre.min(axis=0) - 0.5 * width
    )


def test_no_obstacle_in_reach_has_no_component(check_among: Callable[..., SweptCheck]) -> None:
    assert unsafe_components(check_among((5.0, 0.0)), depth=5) == ()


def test_refuses_a_component_that_winds_around_a_joint(
    check_among: Callable[..., SweptCheck],
) -> None:
    with pytest.raises(InvalidValueError, match="around joint elbow"):
        unsafe_components(check_among((0.6, 0.0)), depth=6)


def test_refuses_arms_with_many_joints() -> None:
    check = SweptCheck(World(load_arm("panda"), Scene()))
    with pytest.raises(InvalidValueError, match="number of joints = 7"):
        unsafe_components(check)


# The cover


@pytest.fixture(scope="module")
def world(swing_up: Scenario) -> World:
    return World(swing_up.arm, swing_up.scene)


@pytest.fixture(scope="module")
def cover(world: World) -> JointSpaceCover:
    return JointSpaceCover(world, MARGIN, depth=7)


def log_bump(
    cover: JointSpaceCover, angles: Array | list[float], theta: float = 0.0
) -> tuple[float, Array]:
    gradient = np.zeros(2)
    q = cover.world.arm.configuration(angles)
    return cover.add_log_bump(q, theta, gradient), gradient


def test_every_unsafe_cell_lies_in_the_sensing_region_of_its_component(
    world: World, cover: JointSpaceCover
) -> None:
    components = unsafe_components(SweptCheck(world, MARGIN), 7)
    assert len(components) == len(cover.regions) == 2
    for component, region in zip(components, cover.regions, strict=True):
        # The region is convex, so that it contains a cell with the cell's corners.
        assert (region.level(component.corners) < 1.0).all()


def test_start_and_goal_are_outside_and_nothing_is_sensed_there(cover: JointSpaceCover) -> None:
    for angles in ([0.01, 0.01], [np.pi, 0.0]):
        q = cover.world.arm.configuration(angles)
        assert (cover.sensing_functions(q) > 0.0).all()
        value, gradient = log_bump(cover, angles)
        assert value == 0.0
        assert not gradient.any()


@given(angle, angle)
def test_vanishes_exactly_where_the_arm_is_unsafe(
    cover: JointSpaceCover, first: float, second: float
) -> None:
    q = cover.world.arm.configuration([first, second])
    distance = cover.world.distances(q).min() - MARGIN
    assume(abs(distance) > 1e-5)
    value, gradient = log_bump(cover, [first, second])
    assert (value == -np.inf) == (distance < 0.0)
    assert np.isfinite(gradient).all()


@given(angle, angle, st.sampled_from([0.0, 1e-3]))
def test_gradient_is_the_derivative(
    cover: JointSpaceCover, first: float, second: float, theta: float
) -> None:
    angles = np.array([first, second])
    assume(cover.world.distances(cover.world.arm.configuration(angles)).min() > 0.05)
    _, gradient = log_bump(cover, angles, theta)
    for i, axis in enumerate(1e-5 * np.eye(2)):
        ahead = log_bump(cover, angles + axis, theta)[0]
        behind = log_bump(cover, angles - axis, theta)[0]
        assert gradient[i] == pytest.approx((ahead - behind) / 2e-5, rel=1e-4, abs=1e-6)


@given(angle, angle, st.integers(-2, 2), st.integers(-2, 2))
def test_is_periodic(
    cover: JointSpaceCover, first: float, second: float, turns: int, more: int
) -> None:
    value, gradient = log_bump(cover, [first, second])
    assume(np.isfinite(value))
    image, image_gradient = log_bump(
        cover, [first + 2.0 * np.pi * turns, second + 2.0 * np.pi * more]
    )
    assert image == pytest.approx(value, rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(image_gradient, gradient, rtol=1e-6, atol=1e-9)


def test_shift_bounds_the_bump_from_below(cover: JointSpaceCover) -> None:
    inside = cover.regions[0].centre
    assert log_bump(cover, inside)[0] == -np.inf
    assert log_bump(cover, inside, 0.1)[0] == pytest.approx(np.log(0.1) + np.log(1.1), rel=1e-12)
    assert log_bump(cover, [np.pi, 0.0], 0.1)[0] == pytest.approx(2.0 * np.log(1.1), rel=1e-12)


def test_no_obstacle_in_reach_leaves_the_density_alone(two_link: Arm) -> None:
    ball = Sphere(name="ball", radius=0.2, position=(5.0, 0.0, 0.0))
    cover = JointSpaceCover(World(two_link, Scene([ball])))
    gradient = np.zeros(2)
    assert cover.regions == ()
    assert cover.add_log_bump(two_link.configuration([1.0, 2.0]), 0.0, gradient) == 0.0
    assert not gradient.any()


def test_refuses_a_sensing_region_wider_than_a_turn(world: World) -> None:
    with pytest.raises(InvalidValueError, match="width of a sensing region"):
        JointSpaceCover(world, MARGIN, depth=6, inflation=1.5)


def test_refuses_a_negative_margin(world: World) -> None:
    with pytest.raises(InvalidValueError, match="margin"):
        JointSpaceCover(world, -0.01)


@pytest.mark.parametrize("name", ["depth", "inflation", "sensing_distance"])
def test_refuses_parameters_that_are_not_positive(world: World, name: str) -> None:
    parameters: dict[str, Any] = {name: 0}
    with pytest.raises(InvalidValueError, match=name):
        JointSpaceCover(world, MARGIN, **parameters)
