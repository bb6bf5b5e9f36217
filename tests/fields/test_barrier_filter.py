"""The filter: every barrier's row holds, and it leaves the goal's pull alone in the open."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.density import TorusDistance
from densarm.errors import InvalidValueError
from densarm.fields import SpeedLaw, SpeedParameters
from densarm.fields.barrier_filter import BarrierFilter, BarrierParameters
from densarm.fields.barriers import Barriers
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Scene, Sphere

ARMS = {
    "panda": ("ready", Sphere(name="ball", radius=0.1, position=[0.5, 0.1, 0.4])),
    "two_link": ("upright", Sphere(name="ball", radius=0.2, position=[1.5, 0.0, -0.5])),
}


def make_field(name):
    posture, ball = ARMS[name]
    arm = load_arm(name, shapes="capsule" if name == "panda" else "hull")
    bound = SweptBound(Clearance(arm, Scene([ball])))
    goal_distance = TorusDistance(arm, arm.postures[posture])
    law = SpeedLaw(bound, SpeedParameters())
    return BarrierFilter(Barriers(bound.clearance, 0.0), goal_distance, law, 10.0)


@pytest.fixture(scope="module", params=ARMS)
def field(request):
    return make_field(request.param)


def configuration(arm, share):
    lower = np.where(arm.is_circle, -np.pi, arm.limits.lower)
    upper = np.where(arm.is_circle, np.pi, arm.limits.upper)
    return arm.configuration(lower + np.resize(share, arm.nv) * (upper - lower))


@settings(max_examples=300)
@given(share=st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7))
def test_keeps_every_barrier_and_the_velocity_limits(field, share):
    arm, barriers = field.barriers.clearance.arm, field.barriers
    velocity = field.update(configuration(arm, share))
    assume(barriers.value.min() >= 0.0)
    parameters = BarrierParameters()
    kept = barriers.value < barriers.spread(parameters.detection_distance, np.inf)
    floor = -parameters.barrier_rate * barriers.value[kept]
    assert (barriers.gradient[kept] @ velocity >= floor - 1e-6).all()
    assert (np.abs(velocity) <= arm.limits.velocity * (1.0 + 1e-9)).all()


def test_in_the_open_it_is_the_pull_of_the_goal(field):
    arm = field.barriers.clearance.arm
    q = arm.integrate(field.goal_distance.goal, np.full(arm.nv, 1e-3))
    slope = np.zeros(arm.nv)
    field.goal_distance.evaluate(q, slope)
    np.testing.assert_allclose(field.update(q), -10.0 * slope, rtol=1e-6)


def test_rests_at_the_goal(field):
    np.testing.assert_array_equal(field.update(field.goal_distance.goal), 0.0)


def test_rests_where_no_velocity_keeps_every_row():
    field = make_field("panda")
    beyond = field.barriers.clearance.arm.limits.upper + 10.0
    np.testing.assert_array_equal(field.update(beyond), 0.0)


def test_changes_a_pull_that_leads_into_an_obstacle():
    field = make_field("two_link")
    q = field.barriers.clearance.arm.configuration([1.08, 0.0])
    slope = np.zeros(2)
    field.goal_distance.evaluate(q, slope)
    velocity, k = field.update(q), field.barriers.value.argmin()
    towards = field.barriers.gradient[k] / np.linalg.norm(field.barriers.gradient[k])
    assert field.barriers.value[k] < 0.1
    assert towards @ slope > 0.5 * np.linalg.norm(slope)
    assert towards @ velocity > -0.5 * np.linalg.norm(velocity)


@pytest.mark.parametrize(
    "name", ["barrier_rate", "detection_distance", "lyapunov_rate", "relaxation"]
)
def test_parameters_are_checked(name):
    with pytest.raises(InvalidValueError, match=f"^{name} = "):
        BarrierParameters(**{name: 0.0})
