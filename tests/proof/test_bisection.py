"""Bisection proves functions with a known slope positive, and nothing else."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from densarm.proof.bisection import bisect

FLOOR = 1e-4
WAVE = st.tuples(st.floats(0.5, 20.0), st.floats(0.0, 7.0), st.floats(-0.2, 1.0))


def bisected(waves, asked=None):
    """Bisect h(t) = 1 + offset + cos(frequency t + phase) for every wave, over [0, 1]."""
    frequency, phase, offset = np.array(waves).reshape(-1, 3).T

    def slack(t, pairs):
        if asked is not None:
            asked.append((t, len(pairs)))
        return 1.0 + offset[pairs] + np.cos(frequency[pairs] * t + phase[pairs])

    return bisect(
        slack=slack,
        motion=lambda a, b, pairs: (b - a) * frequency[pairs],
        split=lambda a, b: 0.5 * (a + b) if b - a > FLOOR else None,
        ends=(0.0, 1.0),
        n_pairs=len(waves),
    )


@given(waves=st.lists(WAVE, max_size=6))
def test_clear_means_positive_everywhere(waves):
    result = bisected(waves)
    frequency, phase, offset = np.array(waves).reshape(-1, 3).T
    t = np.linspace(0.0, 1.0, 5001)[:, None]
    least = (1.0 + offset + np.cos(frequency * t + phase)).min(axis=0, initial=np.inf)
    if len(result.failing) == 0:
        assert (least > 0.0).all()
        assert np.isnan(result.failed_at)
    elif result.in_contact:
        at = result.failed_at
        here = 1.0 + offset + np.cos(frequency * at + phase)
        assert (here[result.failing] <= 0.0).all()
    else:
        assert (least[result.failing] < FLOOR * frequency[result.failing]).all()
    assert (np.diff(result.evaluated) > 0).all()


def test_proved_pairs_are_not_asked_again():
    asked = []
    far, near = (1.0, 0.0, 1.0), (20.0, 0.0, 0.1)
    assert not len(bisected([far, near, far], asked).failing)
    assert asked[:2] == [(0.0, 3), (1.0, 3)]
    assert {count for _, count in asked[2:]} == {1}


def test_what_cannot_be_proved_is_given_up_early():
    asked = []
    assert not bisected([(20.0, 1.0, 1e-6)], asked).in_contact
    assert len(asked) < 60


def test_failures():
    contact = bisected([(1.0, 0.0, 1.0), (3.0, 0.0, -0.9)])
    assert contact.in_contact
    assert contact.failing.tolist() == [1]
    assert contact.failed_at == 1.0
    touching = bisected([(1.0, np.pi - 1 / 3, 1e-9)])
    assert not touching.in_contact
    assert touching.failing.tolist() == [0]
    assert abs(touching.failed_at - 1 / 3) <= 0.01  # where h is below FLOOR


def test_no_pairs():
    assert bisected([]).evaluated.tolist() == [0.0, 1.0]
