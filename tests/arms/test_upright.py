"""Upright: what points up, how far it tilts, and how fast joints tilt it at most."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.arms.upright import Upright
from densarm.errors import InvalidValueError, UnknownNameError

angle = st.floats(-1.5, 1.5)
steps = st.lists(st.floats(-0.5, 0.5), min_size=7, max_size=7)
HAND = "panda_hand_tcp"


@pytest.fixture(scope="module")
def panda() -> Arm:
    return load_arm("panda")


def test_what_points_up_at_the_start_is_kept(panda: Arm) -> None:
    ready = panda.postures["ready"]
    upright = Upright.from_start(panda, ready, HAND, 0.1)
    assert upright.up == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    assert upright.tilts(panda, ready[np.newaxis])[0] < 1e-7
    wrist = ready + np.array([0.7, 0.0, 0.0, 0.0, 0.0, 0.3, 0.5])
    assert upright.tilts(panda, wrist[np.newaxis])[0] == pytest.approx(0.3)
    again = Upright.from_json(upright.to_json())
    assert (again.frame, again.within) == (HAND, 0.1)
    np.testing.assert_array_equal(again.up, upright.up)


@settings(max_examples=100)
@given(st.lists(angle, min_size=7, max_size=7), steps)
def test_no_step_tilts_it_by_more_than_its_rates(
    panda: Arm, at: list[float], step: list[float]
) -> None:
    upright = Upright.from_start(panda, panda.postures["ready"], HAND, 0.1)
    q = np.linspace(np.array(at), np.add(at, step), 9)
    tilts, rates = upright.tilts(panda, q), upright.rates(panda)
    assert np.ptp(tilts) <= rates @ np.abs(step) + 1e-9
    largest = upright.largest_tilts(panda, q[[0, -1]], np.zeros((1, 7)))
    assert tilts.max() <= largest[0] + 1e-9


def test_what_cannot_tilt_it_does_not_count(panda: Arm) -> None:
    """Panda's first joint is vertical, and its elbow carried by no later joint."""
    ready = panda.postures["ready"]
    assert Upright.from_start(panda, ready, HAND, 0.1).rates(panda).tolist() == [0] + 6 * [1]
    link = Upright.from_start(panda, ready, "panda_link4", 0.1)
    assert link.rates(panda).tolist() == [0, 1, 1, 1, 0, 0, 0]


@pytest.mark.parametrize("tilt", [0.0, 0.009, 1.6, np.nan])
def test_an_angle_that_is_none(panda: Arm, tilt: float) -> None:
    with pytest.raises(InvalidValueError, match="tilt"):
        Upright.from_start(panda, panda.postures["ready"], HAND, tilt)
    with pytest.raises(UnknownNameError, match="hand_tcp"):
        Upright.from_start(panda, panda.postures["ready"], "hand_tcp", 0.1)
