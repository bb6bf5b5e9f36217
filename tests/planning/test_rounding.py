"""Rounding: the same ends, never slower, and nothing that is not proved clear."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.planning.guide import WayPoints
from densarm.planning.rounding import rounded, rounded_through, way_time

Discs = Callable[..., Any]

DETOUR = (-1, 0), (-1, 1.5), (1, 1.5), (1, 0)
coordinate = st.floats(-2.0, 2.0)


@pytest.mark.parametrize("seed", range(3))
def test_a_detour_gets_quicker_and_stays_clear(seed: int, arm: Arm, make_discs: Discs) -> None:
    discs = make_discs(arm, (0.0, 0.0, 0.8))
    path = np.stack([arm.configuration(corner) for corner in DETOUR])
    way = rounded(arm, discs, path, 500, np.random.default_rng(seed))
    np.testing.assert_allclose(way[[0, -1]], path[[0, -1]], rtol=0, atol=1e-14)
    assert all(discs.segment_is_clear(a, b) for a, b in pairwise(way))
    assert way_time(arm, way) < 0.8 * way_time(arm, path)
    again = rounded(arm, discs, path, 500, np.random.default_rng(seed))
    np.testing.assert_array_equal(again, way)


@pytest.mark.parametrize("within", [0.0, 0.1])
def test_what_is_passed_stays_where_it_may(within: float, arm: Arm, make_discs: Discs) -> None:
    discs, rng = make_discs(arm, (0.0, 0.0, 0.8)), np.random.default_rng(0)
    path = np.stack([arm.configuration(corner) for corner in DETOUR])
    asked = WayPoints(path[[1, 2]], within / 0.8, np.array([1, 2]))
    way, passed = rounded_through(arm, discs, path, asked, 500, rng)
    off = np.abs(arm.difference(path[[1, 2]], way[passed.rows])).max(axis=1)
    assert (off <= within + 1e-12).all()
    assert (passed.rows < 0).all()
    assert all(discs.segment_is_clear(a, b) for a, b in pairwise(way))
    assert way_time(arm, way) <= way_time(arm, path) + 1e-9


def test_what_is_blocked_all_around_stays(arm: Arm) -> None:
    class Nowhere:
        def polyline_is_clear(self, angles: Any) -> bool:  # noqa: ARG002
            return False

    path = np.stack([arm.configuration(corner) for corner in DETOUR])
    space: Any = Nowhere()
    way = rounded(arm, space, path, 200, np.random.default_rng(0))
    assert way_time(arm, way) == pytest.approx(way_time(arm, path), rel=1e-9)


@settings(max_examples=50)
@given(st.tuples(coordinate, coordinate), st.tuples(coordinate, coordinate))
def test_a_straight_way_takes_what_its_slowest_joint_does(
    a: tuple[float, float], b: tuple[float, float]
) -> None:
    arm = load_arm("two_link")
    path, limits = np.stack([arm.configuration(a), arm.configuration(b)]), arm.limits
    travel = np.abs(arm.difference(*path))
    speed = np.minimum(limits.velocity, np.sqrt(limits.acceleration * travel)) + 1e-12
    about = (travel / speed + speed / limits.acceleration).max() + 0.05 * np.linalg.norm(travel)
    assert way_time(arm, path) == pytest.approx(about, rel=0.1, abs=0.1)
