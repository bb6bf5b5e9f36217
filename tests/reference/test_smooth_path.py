"""The smooth path: the ends of its polyline, two derivatives, proved clear."""

import numpy as np
import pytest

from densarm.reference.smooth_path import smooth_path


@pytest.fixture(scope="module")
def path(bound, curve):
    return smooth_path(bound, curve)


def test_ends_are_those_of_the_polyline(bound, curve, path):
    ends = bound.arm.configurations(path(np.array([0.0, 1.0])))
    np.testing.assert_allclose(ends, curve[[0, -1]], rtol=0, atol=1e-14)


def test_angles_do_not_jump_over_the_back_of_a_circle(path):
    angles = path(np.linspace(0.0, 1.0, 1001))
    assert np.abs(np.diff(angles, axis=0)).max() < 0.02


@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_by_differences(path, order):
    h = 1e-6
    s = np.setdiff1d(np.linspace(0.01, 0.99, 97), path.knots)
    slope = (path(s + h, order - 1) - path(s - h, order - 1)) / (2 * h)
    np.testing.assert_allclose(path(s, order), slope, rtol=1e-4, atol=1e-3)


def test_second_derivative_is_continuous_at_the_knots(path):
    inner = np.unique(path.knots)[1:-1]
    assert len(inner) >= 1
    before, after = path(inner - 1e-9, 2), path(inner + 1e-9, 2)
    np.testing.assert_allclose(before, after, atol=1e-4 * np.abs(before).max())


def test_clear_by_samples(bound, path):
    for angles in path(np.linspace(0.0, 1.0, 2001)):
        assert (bound.slack(bound.arm.configuration(angles)) > 0.0).all()


def test_follows_the_polyline_where_there_is_no_room(bound):
    """A corner around an obstacle: wide splines cut it, narrow ones do not."""
    arm = bound.arm
    clear = [[0.6, 2.4], [1.25, 2.4], [2.4, 0.2]]
    curve = np.stack([arm.configuration(angles) for angles in clear])
    path = smooth_path(bound, curve)
    assert path is not None
    for angles in path(np.linspace(0.0, 1.0, 2001)):
        assert (bound.slack(arm.configuration(angles)) > 0.0).all()


def test_end_that_nothing_but_a_fine_proof_shows_to_be_clear(bound):
    """A curved path to a goal 10 µm from the margin."""
    back = 1.0 - np.linspace(0.0, 1.0, 30)[:, np.newaxis]
    angles = np.array([0.9, 0.3]) - back * [0.6, -0.5] + back**2 * [0.1, 0.4]
    curve = bound.arm.configurations(angles)
    slack = np.array([bound.slack(q).min() for q in curve])
    assert slack.argmin() == len(curve) - 1
    assert smooth_path(bound.with_margin(slack[-1] - 1e-5), curve) is not None


def test_none_where_the_polyline_touches(bound):
    through = np.stack([bound.arm.configuration(angles) for angles in ([0.4, 0.0], [2.0, 0.0])])
    assert smooth_path(bound, through) is None
