"""The smooth path: the ends of its polyline, two derivatives, proved clear."""

import numpy as np
import pytest

from densarm.arms.arm import load_arm
from densarm.planning.smoothing import SmoothPath, blended_path, smooth_path
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import World


def smoothed(check: SweptCheck, curve: Array, margin: float = 0.0) -> SmoothPath:
    path = smooth_path(check.world, margin, curve)
    assert path is not None
    return path


@pytest.fixture(scope="module")
def path(check: SweptCheck, curve: Array) -> SmoothPath:
    return smoothed(check, curve)


def test_ends_are_those_of_the_polyline(check: SweptCheck, curve: Array, path: SmoothPath) -> None:
    ends = check.arm.configurations(path(np.array([0.0, 1.0])))
    np.testing.assert_allclose(ends, curve[[0, -1]], rtol=0, atol=1e-14)


def test_angles_do_not_jump_over_the_back_of_a_continuous_joint(path: SmoothPath) -> None:
    angles = path(np.linspace(0.0, 1.0, 1001))
    assert np.abs(np.diff(angles, axis=0)).max() < 0.02


@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_by_differences(path: SmoothPath, order: int) -> None:
    h = 1e-6
    s = np.setdiff1d(np.linspace(0.01, 0.99, 97), path.knots)
    slope = (path(s + h, order - 1) - path(s - h, order - 1)) / (2 * h)
    np.testing.assert_allclose(path(s, order), slope, rtol=1e-4, atol=1e-3)


def test_second_derivative_is_continuous_at_the_knots(path: SmoothPath) -> None:
    inner = np.unique(path.knots)[1:-1]
    assert len(inner) >= 1
    before, after = path(inner - 1e-9, 2), path(inner + 1e-9, 2)
    np.testing.assert_allclose(before, after, atol=1e-4 * np.abs(before).max())


def is_clear_by_samples(check: SweptCheck, path: SmoothPath, margin: float = 0.0) -> bool:
    configurations = check.arm.configurations(path(np.linspace(0.0, 1.0, 2001)))
    return check.least_distance_margin(configurations) > margin


def test_clear_by_samples(check: SweptCheck, path: SmoothPath) -> None:
    assert is_clear_by_samples(check, path)


def test_follows_the_polyline_where_there_is_little_space(check: SweptCheck) -> None:
    """A corner around an obstacle: wide splines cut it, narrow ones do not."""
    corner = check.arm.configurations(np.array([[0.6, 2.4], [1.25, 2.4], [2.4, 0.2]]))
    assert is_clear_by_samples(check, smoothed(check, corner))


@pytest.mark.parametrize("margin", [0.02, 0.1])
def test_margin_is_kept(check: SweptCheck, margin: float) -> None:
    """The corner again; with more to keep, the path keeps closer to its polyline."""
    corner = check.arm.configurations(np.array([[0.6, 2.4], [1.25, 2.4], [2.4, 0.2]]))
    assert SweptCheck(check.world, margin).segment_is_clear(corner[0], corner[1])
    assert SweptCheck(check.world, margin).segment_is_clear(corner[1], corner[2])
    assert is_clear_by_samples(check, smoothed(check, corner, margin), margin)


@pytest.mark.parametrize("margin", [0.0, 0.1])
def test_a_blended_corner_keeps_the_margin(check: SweptCheck, margin: float) -> None:
    corner = check.arm.configurations(np.array([[0.6, 2.4], [1.25, 2.4], [2.4, 0.2]]))
    path = blended_path(check.world, margin, corner)
    assert path is not None
    ends = check.arm.configurations(path(np.array([0.0, 1.0])))
    np.testing.assert_allclose(ends, corner[[0, -1]], rtol=0, atol=1e-14)
    assert is_clear_by_samples(check, path, margin)


def test_a_straight_way_is_blended_at_an_even_rate(check: SweptCheck) -> None:
    ends = check.arm.configurations(np.array([[0.6, 2.4], [0.6, -0.4]]))
    path = blended_path(World(check.arm, Scene()), 0.0, ends)
    assert path is not None
    slope = path(np.linspace(0.0, 1.0, 101), 1)
    np.testing.assert_allclose(slope, np.tile([0.0, -2.8], (101, 1)), atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_there_is_a_clear_path_where_the_polyline_is_clear(seed: int) -> None:
    random, arm = np.random.default_rng(seed), load_arm("two_link")
    place = random.uniform([-2.0, -0.05, -2.0], [2.0, 0.05, 2.0])
    check = SweptCheck(World(arm, Scene([Sphere(name="ball", radius=0.1, position=place)])))
    t = np.linspace(0.0, 1.0, 150)[:, np.newaxis]
    speed, phase = random.uniform(-3.0, 3.0, 2), random.uniform(0.0, 6.0, 2)
    angles = random.uniform(-3.0, 3.0, 2) + speed * t + 0.3 * np.sin(6.0 * t + phase)
    polyline = arm.configurations(angles)
    path = smooth_path(check.world, 0.0, polyline)
    if path is None:
        assert seed in (1, 6)
        assert check.check(polyline).verdict == SweptVerdict.CONTACT
    else:
        samples = arm.configurations(path(np.linspace(0.0, 1.0, 2001)))
        assert check.check(samples).verdict == SweptVerdict.CLEAR


@pytest.mark.parametrize(("short_of_it", "is_found"), [(1e-5, True), (-1e-5, False)])
def test_end_that_nothing_but_a_fine_proof_shows_to_be_clear(
    check: SweptCheck, short_of_it: float, is_found: bool
) -> None:
    """A curved path to a goal 10 µm from the margin, on either side of it."""
    back = 1.0 - np.linspace(0.0, 1.0, 30)[:, np.newaxis]
    angles = np.array([0.9, 0.3]) - back * [0.6, -0.5] + back**2 * [0.1, 0.4]
    curve = check.arm.configurations(angles)
    margins = np.array([check.distance_margin(q).min() for q in curve])
    assert margins.argmin() == len(curve) - 1
    path = smooth_path(check.world, float(margins[-1]) - short_of_it, curve)
    assert (path is not None) == is_found


def test_none_where_the_polyline_touches(check: SweptCheck) -> None:
    through = check.arm.configurations(np.array([[0.4, 0.0], [2.0, 0.0]]))
    assert smooth_path(check.world, 0.0, through) is None
    assert blended_path(check.world, 0.0, through) is None
