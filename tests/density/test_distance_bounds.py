"""What bounds decide is what distances decide, and few are queried."""

from dataclasses import dataclass, field

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from densarm.density.distance_bounds import ExactDistances, all_exceed, least_room

NUMBERS = st.floats(-2.0, 2.0)
PAIRS = st.lists(
    st.tuples(NUMBERS, st.floats(0.0, 1.0), NUMBERS, st.sampled_from([0.0, 0.3, 1.0])), max_size=8
)


@dataclass
class Hidden:
    """Distances behind bounds."""

    truth: np.ndarray
    distance: np.ndarray
    queried: list[int] = field(default_factory=list)

    def query(self, pair):
        if pair in self.queried:
            return False
        self.queried.append(pair)
        self.distance[pair] = self.truth[pair]
        return True


def split(pairs):
    """Distances, bounds, needs and rates of pairs."""
    truth, below, need, rate = np.array(pairs, float).reshape(-1, 4).T
    return truth, Hidden(truth, truth - below), need, np.ascontiguousarray(rate)


@given(pairs=PAIRS)
def test_least_room_is_that_of_the_distances_to_the_last_bit(pairs):
    truth, hidden, need, rate = split(pairs)
    bounds, moves = hidden.distance.copy(), rate > 0.0
    expected = ((truth - need)[moves] / rate[moves]).min(initial=np.inf)
    assert least_room(hidden, need, rate) == expected
    assert least_room(ExactDistances(truth), need, rate) == expected
    queried = np.array(hidden.queried, int)
    assert moves[queried].all()
    assert ((bounds - need)[queried] / rate[queried] <= expected).all()


@given(pairs=PAIRS, enough=NUMBERS)
def test_enough_room_is_never_too_little(pairs, enough):
    truth, hidden, need, rate = split(pairs)
    exact = least_room(ExactDistances(truth), need, rate)
    room = least_room(hidden, need, rate, enough)
    assert room == exact or enough < room <= exact


@given(pairs=PAIRS)
def test_all_exceed_is_decided_as_by_the_distances(pairs):
    truth, hidden, need, _ = split(pairs)
    bounds = hidden.distance.copy()
    assert all_exceed(hidden, need) == bool((truth > need).all())
    assert not (bounds > need)[hidden.queried].any()
