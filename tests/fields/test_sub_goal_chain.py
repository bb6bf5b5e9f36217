"""The chain: from each sub-goal the next is in sight, and all that is followed has Ψ = 1."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.density.distance_bounds import ExactDistances
from densarm.errors import InvalidValueError
from densarm.fields import SensingParameters, SubGoalChain
from densarm.guides import GuidePath
from densarm.scene import Scene

OFFSETS = st.tuples(*[st.floats(-0.1, 0.1)] * 2).map(np.array)


@pytest.fixture(scope="module")
def bound_and_chain(make_guided):
    bound, guided = make_guided()
    return bound, guided.chain


def exact(bound, q):
    return ExactDistances(bound.clearance.distances(q))


def test_path_runs_from_start_to_goal(swing_up, bound_and_chain):
    bound, chain = bound_and_chain
    np.testing.assert_array_equal(chain.q[0], swing_up.start)
    np.testing.assert_allclose(chain.q[-1], swing_up.goal, atol=1e-15)
    steps = bound.arm.difference(chain.q[:-1], chain.q[1:])
    assert np.abs(steps).max() <= chain.SPACING + 1e-12
    assert chain.remaining[0] == pytest.approx(np.linalg.norm(steps, axis=1).sum())
    assert chain.remaining[-1] == 0.0


def test_neighbours_see_each_other(bound_and_chain):
    bound, chain = bound_and_chain
    for k in range(1, len(chain.q)):
        chain.current = k - 1
        chain.advance(chain.q[k - 1], exact(bound, chain.q[k - 1]))
        assert chain.current >= k
    assert chain.is_last


def test_psi_is_one_on_every_followed_segment(bound_and_chain):
    bound, chain = bound_and_chain
    chain.current = 1
    for q in chain.q:
        chain.advance(q, exact(bound, q))
        step = bound.arm.difference(q, chain.q[chain.current])
        for share in np.linspace(0.0, 1.0, 5):
            h = bound.clearance.distances(bound.arm.integrate(q, share * step)) - bound.margin
            assert (h > chain.sensing_distance[chain.current]).all()


@given(index=st.integers(0, 10_000), offset=OFFSETS)
def test_a_sub_goal_in_sight_is_proved_in_sight(bound_and_chain, index, offset):
    bound, chain = bound_and_chain
    before = index % (len(chain.q) - 1)
    q = bound.arm.integrate(chain.q[before], offset)
    chain.current = before
    if chain.advance(q, exact(bound, q)):
        target = chain.q[chain.current]
        assert bound.segment_is_clear(q, target)
        assert np.abs(bound.arm.difference(q, target)).max() <= chain.SIGHT


def test_never_back_and_never_past_an_obstacle(bound_and_chain):
    bound, chain = bound_and_chain
    chain.current = 3
    far = bound.arm.integrate(chain.q[-1], np.array([0.3, 0.3]))
    chain.advance(far, exact(bound, far))
    assert chain.current == 3


def test_direct_way_has_one_sub_goal_and_full_sensing(make_guided):
    _, guided = make_guided("direct")
    chain = guided.chain
    assert len(chain.q) == 2
    assert chain.is_last
    assert (chain.sensing_distance == 0.05).all()
    assert (chain.joint_sensing_distance == 0.1).all()


def test_in_an_empty_scene_sight_ends_at_a_quarter_turn(make_guided):
    bound, guided = make_guided(scene=Scene())
    chain = guided.chain
    chain.advance(chain.q[0], exact(bound, chain.q[0]))
    seen = bound.arm.difference(chain.q[0], chain.q[chain.current])
    assert 1.5 < np.abs(seen).max() <= np.pi / 2


def test_a_path_that_is_not_clear_is_refused(bound_and_chain):
    bound, _ = bound_and_chain
    # The stretched arm sweeps over the right obstacle.
    through = np.stack([bound.arm.configuration(angles) for angles in ([0.4, 0.0], [2.0, 0.0])])
    with pytest.raises(InvalidValueError, match=r"^path = "):
        SubGoalChain(bound, GuidePath(through, is_clear=True), SensingParameters())


@pytest.mark.parametrize(
    ("key", "value"),
    [("distance", 0.0), ("joint", -1.0), ("path_share", 0.0), ("path_share", 0.6)],
)
def test_parameters_are_checked(key, value):
    with pytest.raises(InvalidValueError, match=f"^{key} = "):
        SensingParameters(**{key: value})
