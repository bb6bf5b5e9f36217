"""Shortening: the same ends, never longer, and nothing that is not proved clear."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.arms.free_body import free_body
from densarm.planning.shortening import shortened
from densarm.scene.obstacles import Sphere
from densarm.values.arrays import Array

Discs = Callable[..., Any]

coordinate = st.floats(-2.9, 2.9)


def length(arm: Arm, waypoints: Array) -> float:
    return float(np.linalg.norm(arm.difference(waypoints[:-1], waypoints[1:]), axis=1).sum())


def test_nothing_in_the_way_leaves_the_straight_segment(arm: Arm, make_discs: Discs) -> None:
    path = np.stack([arm.configuration(a) for a in [(-1, -1), (-1, 1), (0, 1.5), (1, 1)]])
    short = shortened(arm, make_discs(arm), path, 50, np.random.default_rng(0))
    np.testing.assert_array_equal(short, path[[0, -1]])


@pytest.mark.parametrize("seed", range(5))
def test_a_detour_shrinks_onto_the_disc(
    seed: int, arm: Arm, make_discs: Discs, samples_of: Callable[[Arm, Array], Array]
) -> None:
    discs = make_discs(arm, (0.0, 0.0, 0.8))
    corners = [(-1, 0), (-1, 1.5), (1, 1.5), (1, 0)]
    path = np.stack([arm.configuration(corner) for corner in corners])
    short = shortened(arm, discs, path, 600, np.random.default_rng(seed))
    np.testing.assert_array_equal(short[[0, -1]], path[[0, -1]])
    assert discs.gap(samples_of(arm, short)).min() > -1e-9
    # Two tangents of length 0.6 and the arc between them.
    geodesic = 2 * 0.6 + 0.8 * (np.pi - 2 * np.arccos(0.8))
    assert geodesic < length(arm, short) < 1.05 * geodesic


def test_a_joint_that_moves_in_vain_rests_while_the_others_go_round() -> None:
    """Where no straight segment is clear over any distance, because of the first two joints."""
    arm = free_body(Sphere(name="ball", radius=0.1), "space", [(-3.0, 3.0)] * 3)
    on_circle = np.linspace(0.0, np.pi, 40)

    class Ring:
        """The inside of a ring of radius 1 and width 0.1; the third joint is free."""

        def configuration_is_clear(self, q: Array) -> bool:
            return self.segment_is_clear(q, q)

        def segment_is_clear(self, q_a: Array, q_b: Array) -> bool:
            points = q_a[:2] + np.linspace(0.0, 1.0, 20)[:, np.newaxis] * (q_b - q_a)[:2]
            return bool((np.abs(np.linalg.norm(points, axis=1) - 1.0) < 0.05).all())

        def polyline_is_clear(self, angles: Array) -> bool:
            return all(self.segment_is_clear(a, b) for a, b in pairwise(angles))

    height = 0.5 * np.sin(5.0 * on_circle)
    path = np.stack([np.cos(on_circle), np.sin(on_circle), height], axis=1)
    short = shortened(arm, Ring(), path, 600, np.random.default_rng(0))
    assert length(arm, path) > 5.0
    assert np.pi * 0.95 < length(arm, short) < np.pi * 1.02
    assert np.abs(short[:, 2]).max() < 0.05


@settings(max_examples=30, deadline=None)
@given(
    path=st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=6),
    seed=st.integers(0, 2**32),
)
def test_a_path_keeps_its_ends_and_never_gets_longer(
    make_arm: Any, make_discs: Discs, path: list[tuple[float, float]], seed: int
) -> None:
    arm = make_arm("continuous", "prismatic")
    discs = make_discs(arm, (0.5, 0.5, 0.4), (-1.0, 0.0, 0.5))
    before = np.stack([arm.configuration(angles) for angles in path])
    after = shortened(arm, discs, before, 50, np.random.default_rng(seed))
    np.testing.assert_array_equal(after[[0, -1]], before[[0, -1]])
    assert length(arm, after) <= length(arm, before) + 1e-9


def test_no_worthwhile_gain_asks_for_no_proof(arm: Arm, make_discs: Discs) -> None:
    discs = make_discs(arm)
    path = np.stack([arm.configuration(a) for a in [(-0.05, 0), (0.05, 0)]])
    shortened(arm, discs, path, 50, np.random.default_rng(0))
    assert discs.segments == 0
