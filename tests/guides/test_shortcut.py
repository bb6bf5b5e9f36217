"""Shortcuts."""

import numpy as np
import pytest

from densarm.guides.shortcut import shortcut


def length(arm, waypoints):
    return np.linalg.norm(arm.difference(waypoints[:-1], waypoints[1:]), axis=1).sum()


def test_nothing_in_the_way_leaves_the_straight_segment(arm, make_discs):
    path = np.stack([arm.configuration(a) for a in [(-1, -1), (-1, 1), (0, 1.5), (1, 1)]])
    short = shortcut(arm, make_discs(arm), path, 50, np.random.default_rng(0))
    np.testing.assert_array_equal(short, path[[0, -1]])


@pytest.mark.parametrize("seed", range(5))
def test_a_detour_shrinks_onto_the_disc(seed, arm, make_discs, samples_of):
    discs = make_discs(arm, (0.0, 0.0, 0.8))
    corners = [(-1, 0), (-1, 1.5), (1, 1.5), (1, 0)]
    path = np.stack([arm.configuration(corner) for corner in corners])
    short = shortcut(arm, discs, path, 200, np.random.default_rng(seed))
    np.testing.assert_array_equal(short[[0, -1]], path[[0, -1]])
    assert discs.gap(samples_of(arm, short)).min() > -1e-9
    # Two tangents of length 0.6 and the arc between them.
    geodesic = 2 * 0.6 + 0.8 * (np.pi - 2 * np.arccos(0.8))
    assert geodesic < length(arm, short) < 1.05 * geodesic


def test_no_worthwhile_gain_asks_for_no_proof(arm, make_discs):
    discs = make_discs(arm)
    path = np.stack([arm.configuration(a) for a in [(-1, 0), (1, 0)]])
    shortcut(arm, discs, path, 50, np.random.default_rng(0))
    assert discs.segments == 0
