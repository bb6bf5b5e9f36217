"""The planning system: its curve climbs the density, reaches the goal or says why not."""

import numpy as np
import pytest

from densarm.clearance import Clearance
from densarm.density import DensityParameters, TorusDistance
from densarm.fields import GuidedDensity, PlanningSystem, SensingParameters, SubGoalChain
from densarm.guides import GuidePath
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Scene, Sphere


def log_density(guided, q):
    return guided.density.evaluate(q).log_value


def test_reaches_through_the_chain_without_touching(make_guided):
    bound, guided = make_guided()
    curve = PlanningSystem(guided, bound).integrate(guided.chain.q[0])
    assert curve.reached
    assert curve.detail == ""
    np.testing.assert_array_equal(curve.q[0], guided.chain.q[0])
    np.testing.assert_array_equal(curve.q[-1], guided.chain.q[-1])
    for a, b in zip(curve.q[:-1], curve.q[1:], strict=True):
        assert bound.segment_is_clear(a, b)


def test_density_grows_along_a_direct_curve(make_guided):
    bound, guided = make_guided("direct", start=(0.3, 0.4), goal=(0.9, -1.5))
    curve = PlanningSystem(guided, bound).integrate(guided.chain.q[0])
    assert curve.reached
    assert (np.diff([log_density(guided, q) for q in curve.q[:-1]]) > 0.0).all()
    for a, b in zip(curve.q[:-1], curve.q[1:], strict=True):
        assert bound.segment_is_clear(a, b)


def test_start_of_swing_up_is_a_critical_point(make_guided):
    bound, guided = make_guided("direct")
    curve = PlanningSystem(guided, bound).integrate(guided.chain.q[0])
    assert not curve.reached
    assert len(curve.q) == 1
    assert "saddle of the density at joint positions (0, 0)" in curve.detail
    assert "nothing sensed there" in curve.detail


def test_spurious_maximum_names_what_blocks(make_guided):
    bound, guided = make_guided("direct", start=(0.01, 0.01))
    curve = PlanningSystem(guided, bound).integrate(guided.chain.q[0])
    assert not curve.reached
    assert "lower_link_0 and right" in curve.detail
    assert (bound.clearance.distances(curve.q[-1]) > 0.0).all()


@pytest.mark.parametrize("radius", [0.002, 0.02, 0.2])
def test_never_jumps_through_an_obstacle(make_guided, radius):
    """However thin what stands in the way, the curve does not come out behind it."""
    pin = Sphere(name="pin", radius=radius, position=[1.5 * np.sin(0.8), 0.0, -1.5 * np.cos(0.8)])
    bound, guided = make_guided("direct", (0.2, 0.0), (1.4, 0.0), Scene([pin]))
    curve = PlanningSystem(guided, bound).integrate(guided.chain.q[0])
    for a, b in zip(curve.q[:-1], curve.q[1:], strict=True):
        assert bound.segment_is_clear(a, b)


def test_at_the_goal_already(make_guided):
    bound, guided = make_guided("direct", start=(0.5, 0.5), goal=(0.5, 0.5))
    curve = PlanningSystem(guided, bound).integrate(guided.chain.q[0])
    assert curve.reached
    np.testing.assert_array_equal(curve.q, guided.chain.q[:1])


def test_again_from_the_start(make_guided):
    bound, guided = make_guided()
    system = PlanningSystem(guided, bound)
    first, second = (system.integrate(guided.chain.q[0]) for _ in range(2))
    np.testing.assert_array_equal(first.q, second.q)


def test_at_a_sub_goal_without_sight_of_the_next_it_is_stuck(swing_up):
    angles = [(0.0, 0.0), (1.0, -1.5), (np.pi, 0.0)]
    path = GuidePath(swing_up.arm.configurations(np.array(angles)), is_clear=False)
    bound = SweptBound(Clearance(swing_up.arm, swing_up.scene))
    chain = SubGoalChain(bound, path, SensingParameters())
    distance = TorusDistance(swing_up.arm, swing_up.goal)
    guided = GuidedDensity(bound, chain, DensityParameters(), distance)
    curve = PlanningSystem(guided, bound).integrate(path.waypoints[0])
    assert not curve.reached
    np.testing.assert_array_equal(curve.q[-1], path.waypoints[1])
    assert len(np.unique(curve.q, axis=0)) == len(curve.q)
