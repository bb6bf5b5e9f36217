"""The tube check agrees with the swept check, which asks for exact distances everywhere."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.proof.swept_bound import SweptBound
from densarm.proof.swept_check import SweptCheck, SweptVerdict
from densarm.proof.tube_check import TubeCheck
from densarm.scene import Scene, Sphere

ARM = load_arm("two_link")


def bound_around(place, margin=0.0):
    ball = Sphere(name="ball", radius=0.1, position=place)
    return SweptBound(Clearance(ARM, Scene([ball])), margin)


def curve(seed):
    """A motion of 150 samples that turns all the time, and how far it leaves its chords."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 150)[:, np.newaxis]
    speed, phase = rng.uniform(-3.0, 3.0, 2), rng.uniform(0.0, 6.0, 2)
    angles = rng.uniform(-3.0, 3.0, 2) + speed * t + 0.3 * np.sin(6.0 * t + phase)
    return angles, np.full((149, 2), 0.3 * 36.0 / 8.0 / 149**2)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_agrees_with_the_swept_check(seed):
    place = np.random.default_rng(seed).uniform([-2.0, -0.05, -2.0], [2.0, 0.05, 2.0])
    angles, departure = curve(seed)
    exact, wider = (
        SweptCheck(bound_around(place, margin)).check(ARM.configurations(angles), departure)
        for margin in (0.0, 1e-3)
    )
    verdict = TubeCheck(bound_around(place)).check(angles, departure)
    if verdict == SweptVerdict.CLEAR:
        assert exact.verdict == SweptVerdict.CLEAR
    else:
        assert wider.verdict != SweptVerdict.CLEAR


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_pair_a_hair_from_the_margin_is_left_to_exact_distances(sign):
    bound = bound_around((1.2, 0.0, -1.2))
    q = ARM.configuration([0.4, 0.0])
    distance = float(bound.clearance.distances(q).min())
    angles = np.linspace([-0.4, 0.0], [0.4, 0.0], 80)
    check = TubeCheck(bound.with_margin(distance + sign * 2e-5))
    verdict = check.check(angles, np.zeros((79, 2)))
    assert verdict == (SweptVerdict.CLEAR if sign < 0.0 else SweptVerdict.CONTACT)


def test_departure_counts():
    bound = bound_around((0.0, 0.0, 2.2))
    angles = np.linspace([2.6, 0.0], [2.8, 0.0], 30)
    check = TubeCheck(bound)
    assert check.check(angles, np.zeros((29, 2))) == SweptVerdict.CLEAR
    assert check.check(angles, np.full((29, 2), 0.5)) == SweptVerdict.UNDECIDED
