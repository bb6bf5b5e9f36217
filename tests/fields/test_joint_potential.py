"""Every potential: its direction is its gradient, and its ascent leads to the goal."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.density import TorusDistance
from densarm.errors import InvalidValueError
from densarm.fields import SpeedLaw, SpeedParameters
from densarm.fields.barriers import Barriers
from densarm.fields.joint_navigation_function import JointNavigationFunction
from densarm.fields.joint_potential import PotentialAscent
from densarm.fields.joint_potential_field import JointPotentialField
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Scene, Sphere

POTENTIALS = {
    "potential_field": lambda barriers, distance: JointPotentialField(barriers, distance, 0.3, 0.5),
    "navigation_function": JointNavigationFunction,
}
ARMS = {
    "panda": ("ready", Sphere(name="ball", radius=0.1, position=[0.5, 0.1, 0.4])),
    "two_link": ("upright", Sphere(name="ball", radius=0.2, position=[1.5, 0.0, -0.5])),
}
STEP = 1e-6
NEAREST = 2e-3  # central differences need the neighbourhood to be free


def parts(name, arm_name):
    posture, ball = ARMS[arm_name]
    arm = load_arm(arm_name, shapes="capsule" if arm_name == "panda" else "hull")
    barriers = Barriers(Clearance(arm, Scene([ball])), 0.0)
    return arm, POTENTIALS[name](barriers, TorusDistance(arm, arm.postures[posture]))


@pytest.fixture(
    scope="module", params=[(name, arm) for name in POTENTIALS for arm in ARMS], ids="-".join
)
def setting(request):
    return parts(*request.param)


def configuration(arm, share):
    lower = np.where(arm.is_circle, -np.pi, arm.limits.lower)
    upper = np.where(arm.is_circle, np.pi, arm.limits.upper)
    return arm.configuration(lower + np.resize(share, arm.nv) * (upper - lower))


shares = st.lists(st.floats(0.02, 0.98), min_size=7, max_size=7)


@settings(max_examples=60)
@given(share=shares)
def test_direction_is_the_gradient(setting, share):
    arm, potential = setting
    q = configuration(arm, share)
    potential.barriers.update(q)
    assume(potential.barriers.value.min() > NEAREST)
    slope = [
        (potential.height(arm.integrate(q, step)) - potential.height(arm.integrate(q, -step)))
        / (2.0 * STEP)
        for step in STEP * np.eye(arm.nv)
    ]
    direction = potential.direction(q)
    if isinstance(potential, JointNavigationFunction):
        slope = np.array(slope) * potential.goal_distance.evaluate(q, np.zeros(arm.nv))
    np.testing.assert_allclose(direction, slope, rtol=1e-4, atol=1e-4 * np.abs(slope).max() + 1e-9)


@given(share=shares)
def test_ascent_keeps_to_the_direction_and_the_speed_law(setting, share):
    arm, potential = setting
    q = configuration(arm, share)
    law = SpeedLaw(SweptBound(potential.barriers.clearance), SpeedParameters())
    field = PotentialAscent(potential, law, rate=10.0)
    velocity, direction = field.update(q), potential.direction(q)
    norm, length = np.linalg.norm(velocity), np.linalg.norm(direction)
    assert np.isfinite(velocity).all()
    assert velocity @ direction == pytest.approx(norm * length)
    assert norm <= 10.0 * length * (1.0 + 1e-9)
    assert (np.abs(velocity) <= arm.limits.velocity * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("name", POTENTIALS)
def test_no_pull_at_the_goal(name):
    arm, potential = parts(name, "two_link")
    np.testing.assert_allclose(potential.direction(arm.postures["upright"]), 0.0, atol=1e-12)


def test_repels_only_within_its_influence():
    arm, potential = parts("potential_field", "two_link")
    far, near = arm.configuration([2.0, 0.5]), arm.configuration([0.9, 0.0])
    slope = np.zeros(2)
    potential.goal_distance.evaluate(far, slope)
    np.testing.assert_array_equal(potential.direction(far), -slope)
    potential.goal_distance.evaluate(near, slope)
    assert potential.direction(near)[0] < -slope[0]


def test_navigation_function_spans_more_than_the_doubles_do():
    """The product of all h_k of Panda underflows no logarithm, even with many obstacles."""
    arm = load_arm("panda", shapes="capsule")
    balls = [Sphere(name=f"ball_{k}", radius=0.01, position=[0.4, 0.0, 3.0]) for k in range(100)]
    barriers = Barriers(Clearance(arm, Scene(balls)), 0.0)
    potential = JointNavigationFunction(
        barriers, TorusDistance(arm, arm.postures["ready"]), kappa=1e-3
    )
    height = potential.height(arm.postures["ready"] + 0.1)
    assert np.isfinite(height)
    assert abs(height) > 709.0
    assert np.isfinite(potential.direction(arm.postures["ready"] + 0.1)).all()


@pytest.mark.parametrize("name", POTENTIALS)
def test_points_out_of_contact(name):
    arm, potential = parts(name, "two_link")
    q = arm.configuration([1.2, 0.0])
    potential.barriers.update(q)
    k = potential.barriers.value.argmin()
    assert potential.barriers.value[k] < 0.0
    assert potential.barriers.gradient[k] @ potential.direction(q) > 0.0


def test_parameters_are_checked():
    _, potential = parts("potential_field", "two_link")
    given = potential.barriers, potential.goal_distance
    for name, call in {
        "pair_influence": lambda: JointPotentialField(*given, 0.0, 0.1),
        "limit_influence": lambda: JointPotentialField(*given, 0.1, -1.0),
        "repulsion": lambda: JointPotentialField(*given, 0.1, 0.1, np.nan),
        "kappa": lambda: JointNavigationFunction(*given, 0.0),
    }.items():
        with pytest.raises(InvalidValueError, match=f"^{name} = "):
            call()
