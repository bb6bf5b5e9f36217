import numpy as np
import pytest

import densarm
from densarm.density.unsafe_cells import unsafe_components
from densarm.errors import InvalidValueError
from densarm.proof.swept_bound import SweptBound


def bound_among(*centres: tuple[float, float], margin: float = 0.0) -> SweptBound:
    balls = [
        densarm.Sphere(name=f"ball {k}", radius=0.2, position=[x, 0.0, z])
        for k, (x, z) in enumerate(centres)
    ]
    arm = densarm.load_arm("two_link")
    return SweptBound(densarm.Clearance(arm, densarm.Scene(balls)), margin)


def is_inside(angles: np.ndarray, components) -> bool:
    for component in components:
        error = angles - component.centre
        error -= 2.0 * np.pi * np.round(error / (2.0 * np.pi))
        if (np.abs(error) <= component.half_width + 1e-12).all(axis=1).any():
            return True
    return False


@pytest.mark.parametrize("margin", [0.0, 0.05])
def test_every_unsafe_configuration_is_in_a_cell(margin):
    bound = bound_among((-1.5, -0.5), (1.5, -0.5), margin=margin)
    components = unsafe_components(bound, depth=6)
    angles = np.random.default_rng(0).uniform(-np.pi, np.pi, (4000, 2))
    unsafe = [not bound.configuration_is_clear(q) for q in bound.arm.configurations(angles)]
    assert sum(unsafe) > 100
    assert all(is_inside(theta, components) for theta in angles[unsafe])
    share = sum(len(component.centre) for component in components) / 64**2
    assert share < 2.0 * np.mean(unsafe)


def test_swing_up_has_one_component_per_ball_and_only_the_outer_link_touches():
    bound = bound_among((-1.5, -0.5), (1.5, -0.5))
    components = unsafe_components(bound)
    pairs = bound.clearance.pairs
    touching = [[pairs[k] for k in component.pairs] for component in components]
    assert sorted(touching) == [[("lower_link_0", "ball 0")], [("lower_link_0", "ball 1")]]


def test_component_across_the_half_turn_is_unwrapped():
    (component,) = unsafe_components(bound_among((0.0, 1.6)), depth=6)
    assert np.ptp(component.centre, axis=0).max() < 4.5
    assert np.abs(component.centre[:, 0]).max() > np.pi
    width = 2.0 * component.half_width
    assert len(component.corners) < 2 * len(component.centre)
    np.testing.assert_allclose(
        component.corners.min(axis=0), component.centre.min(axis=0) - 0.5 * width
    )


def test_no_obstacle_in_reach_has_no_component():
    assert unsafe_components(bound_among((5.0, 0.0)), depth=5) == ()


def test_refuses_a_component_that_winds_around_a_joint():
    with pytest.raises(InvalidValueError, match="around joint elbow"):
        unsafe_components(bound_among((0.6, 0.0)), depth=6)


def test_refuses_arms_with_many_joints():
    arm = densarm.load_arm("panda")
    bound = SweptBound(densarm.Clearance(arm, densarm.Scene([])))
    with pytest.raises(InvalidValueError, match="number of joints = 7"):
        unsafe_components(bound)
