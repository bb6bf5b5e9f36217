"""Every potential: its direction is its gradient, and its ascent leads to the goal."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import load_arm
from densarm.control.regulation import FieldRegulation
from densarm.control.speed_law import SpeedLaw
from densarm.density.goal_distance import TorusDistance
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.study.fields import Barriers, JointNavigationFunction, JointPotentialField
from densarm.values.arrays import Array
from densarm.world.world import World

Potential = JointPotentialField | JointNavigationFunction
Made = Callable[[str, str], Potential]
NAMES = ("potential_field", "navigation_function")
STEP = 1e-6
NEAREST = 2e-3  # central differences need the neighbourhood to be free
RATE = 10.0
INFLUENCE = 0.3, 0.5  # of pairs and limits
KAPPA = 100.0


@pytest.fixture(scope="module")
def potential_of(barriers_of: Callable[[str], tuple[Barriers, Array]]) -> Made:
    """Return a maker of a potential, by its name and its arm's."""

    def make(name: str, arm_name: str) -> Potential:
        barriers, goal = barriers_of(arm_name)
        distance = TorusDistance(barriers.world.arm)
        if name == "potential_field":
            return JointPotentialField(barriers, goal, distance, RATE, *INFLUENCE)
        return JointNavigationFunction(barriers, goal, distance, RATE, KAPPA)

    return make


@pytest.fixture(
    scope="module",
    params=[(name, arm) for name in NAMES for arm in ("panda", "two_link")],
    ids="-".join,
)
def potential(request: pytest.FixtureRequest, potential_of: Made) -> Potential:
    return potential_of(*request.param)


shares = st.lists(st.floats(0.02, 0.98), min_size=7, max_size=7)


def slope(potential: Potential, q: Array) -> tuple[float, Array]:
    """V and ∇V."""
    out = np.zeros(potential.barriers.world.arm.nv)
    return potential.goal_distance.evaluate(q, potential.goal, out), out


def height(potential: Potential, q: Array) -> float:
    """φ, by its definition."""
    potential.barriers.update(q)
    h, distance = potential.barriers.value, slope(potential, q)[0]
    if isinstance(potential, JointNavigationFunction):
        return float(np.log(h).sum() / potential.kappa - np.log(distance))
    excess = np.maximum(potential.barriers.spread(*INFLUENCE) / h - 1.0, 0.0)
    return float(-distance - 0.5 * 0.01 * (excess**2).sum())


def direction(potential: Potential, q: Array) -> Array:
    return potential.velocity(q, None)[0] / RATE


@pytest.mark.slow
@settings(max_examples=60)
@given(share=shares)
def test_direction_is_the_gradient(
    potential: Potential, within_limits: Callable[..., Array], share: list[float]
) -> None:
    arm = potential.barriers.world.arm
    q = within_limits(arm, share)
    potential.barriers.update(q)
    assume(potential.barriers.value.min() > NEAREST)
    differences = np.array(
        [
            (height(potential, arm.integrate(q, step)) - height(potential, arm.integrate(q, -step)))
            / (2.0 * STEP)
            for step in STEP * np.eye(arm.nv)
        ]
    )
    if isinstance(potential, JointNavigationFunction):
        differences *= slope(potential, q)[0]
    largest = np.abs(differences).max()
    np.testing.assert_allclose(
        direction(potential, q), differences, rtol=1e-4, atol=1e-4 * largest + 1e-9
    )


@pytest.mark.slow
@given(share=shares)
def test_ascent_keeps_to_the_direction_and_the_speed_law(
    potential: Potential, within_limits: Callable[..., Array], share: list[float]
) -> None:
    world = potential.barriers.world
    arm = world.arm
    q = within_limits(arm, share)
    law = SpeedLaw(world, 0.0)
    followed = FieldRegulation(arm, potential, law).velocity(0.0, q, np.zeros(arm.nv))
    velocity, way_left = potential.velocity(q, None)
    assert way_left == pytest.approx(np.linalg.norm(arm.difference(q, potential.goal)))
    assert np.isfinite(followed).all()
    norm, length = np.linalg.norm(followed), np.linalg.norm(velocity)
    assert followed @ velocity == pytest.approx(norm * length)
    assert norm <= length * (1.0 + 1e-9)
    assert (np.abs(followed) <= arm.limits.velocity * (1.0 + 1e-9)).all()


def test_ascent_in_a_metric(potential: Potential) -> None:
    arm, q = potential.barriers.world.arm, potential.goal
    q = arm.integrate(q, np.full(arm.nv, 0.1))
    metric = arm.mass_matrix(q)
    velocity, _ = potential.velocity(q, metric)
    np.testing.assert_allclose(metric @ velocity, potential.velocity(q, None)[0], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_no_pull_at_the_goal(potential_of: Made, name: str) -> None:
    potential = potential_of(name, "two_link")
    np.testing.assert_allclose(direction(potential, potential.goal), 0.0, atol=1e-12)


def test_repels_only_within_its_influence(potential_of: Made) -> None:
    potential = potential_of("potential_field", "two_link")
    arm = potential.barriers.world.arm
    far, near = arm.configuration([2.0, 0.5]), arm.configuration([0.9, 0.0])
    np.testing.assert_allclose(direction(potential, far), -slope(potential, far)[1], rtol=1e-15)
    assert direction(potential, near)[0] < -slope(potential, near)[1][0]


def test_navigation_function_spans_more_than_the_doubles_do() -> None:
    """The product of all h_k of Panda, which underflows with many obstacles, is not needed."""
    arm = load_arm("panda", shapes="capsule")
    balls = [Sphere(name=f"ball_{k}", radius=0.01, position=(0.4, 0.0, 3.0)) for k in range(100)]
    barriers, ready = Barriers(World(arm, Scene(balls)), 0.0), arm.postures["ready"]
    potential = JointNavigationFunction(barriers, ready, TorusDistance(arm), RATE, kappa=1e-3)
    assert abs(height(potential, ready + 0.1)) > 709.0
    assert np.isfinite(potential.velocity(ready + 0.1, None)[0]).all()


@pytest.mark.parametrize("name", NAMES)
def test_points_out_of_contact(potential_of: Made, name: str) -> None:
    potential = potential_of(name, "two_link")
    barriers = potential.barriers
    q = barriers.world.arm.configuration([1.2, 0.0])
    barriers.update(q)
    k = barriers.value.argmin()
    assert barriers.value[k] < 0.0
    assert barriers.gradient[k] @ potential.velocity(q, None)[0] > 0.0


def test_parameters_are_checked(potential_of: Made) -> None:
    potential = potential_of("potential_field", "two_link")
    given = potential.barriers, potential.goal, potential.goal_distance, RATE
    for name, arguments in {
        "pair_influence": (0.0, 0.1),
        "limit_influence": (0.1, -1.0),
    }.items():
        with pytest.raises(InvalidValueError, match=f"^{name} = "):
            JointPotentialField(*given, *arguments)
    with pytest.raises(InvalidValueError, match=r"^kappa = "):
        JointNavigationFunction(*given, 0.0)
