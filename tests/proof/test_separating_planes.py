"""Segments proved by separating planes are those that the swept bound proves by distances."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arm import load_arm
from densarm.clearance import Clearance
from densarm.errors import SceneChangedError
from densarm.proof.separating_planes import SeparatingPlanes
from densarm.proof.swept_bound import SweptBound
from densarm.scene import Box, Capsule, Cylinder, HalfSpace, Scene, Sphere

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.2, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.5, -0.3, 0.2)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.4, 0.6)),
        Cylinder(name="post", radius=0.05, length=0.6, position=(-0.3, -0.5, 0.4)),
        HalfSpace(name="wall", normal=(1.0, 0.2, -0.1), offset=-0.7),
    ]
)
ARMS = {
    "two_link": lambda: load_arm("two_link"),
    "panda": lambda: load_arm("panda"),
    "panda capsules": lambda: load_arm("panda", shapes="capsule"),
    "branching": lambda: load_arm(BRANCHING),
}
BIT = 1.01  # by which a margin is wider, so that bounds within 1 % of a distance decide alike


@pytest.fixture(scope="module", params=ARMS)
def bound(request) -> SweptBound:
    return SweptBound(Clearance(ARMS[request.param](), SCENE), 0.005)


def random_q(arm, rng: np.random.Generator) -> np.ndarray:
    low = np.where(arm.is_circle, -np.pi, arm.limits.lower)
    high = np.where(arm.is_circle, np.pi, arm.limits.upper)
    return arm.configuration(rng.uniform(low, high))


@given(seed=st.integers(0, 2**32 - 1), length=st.floats(0.01, 3.0))
def test_decides_as_the_swept_bound_does(bound, seed, length):
    """What it proves, distances prove; what distances prove with a bit to spare, it proves."""
    arm, rng = bound.arm, np.random.default_rng(seed)
    q = random_q(arm, rng)
    step = arm.difference(q, random_q(arm, rng))
    q_to = arm.integrate(q, min(1.0, length / np.linalg.norm(step)) * step)
    planes = SeparatingPlanes(bound)
    planes.configuration_is_clear(random_q(arm, rng))  # what it remembers decides nothing
    proved = planes.segment_is_clear(q, q_to)
    if proved:
        assert bound.with_margin(bound.margin - 1e-4).segment_is_clear(q, q_to)
    else:
        assert not bound.with_margin(BIT * bound.margin + 1e-3).segment_is_clear(q, q_to)


def test_an_obstacle_between_clear_ends():
    arm = load_arm("two_link")
    ball = Scene([Sphere(name="ball", radius=0.02, position=[1.5, 0.0, 0.0])])
    planes = SeparatingPlanes(SweptBound(Clearance(arm, ball)))
    start, goal = arm.configuration([0.0, 0.0]), arm.configuration([3.0, 0.0])
    assert planes.configuration_is_clear(start)
    assert planes.configuration_is_clear(goal)
    assert not planes.segment_is_clear(start, goal)
    assert planes.segment_is_clear(start, arm.configuration([1.4, 0.0]))
    assert not planes.configuration_is_clear(arm.configuration([np.pi / 2, 0.0]))


def test_everything_is_clear_without_pairs():
    arm = load_arm("two_link")
    planes = SeparatingPlanes(SweptBound(Clearance(arm, Scene())))
    assert planes.segment_is_clear(arm.configuration([0.0, 0.0]), arm.configuration([3.0, 1.0]))


def test_obstacles_that_change():
    """What was proved before a change is no proof; a spare obstacle is in nobody's way."""
    arm = load_arm("two_link")
    ball = Sphere(name="ball", radius=0.02, position=[5.0, 0.0, 0.0])
    spare = Sphere(name="spare", radius=0.02, position=[1.5, 0.0, 0.0])
    bound = SweptBound(Clearance(arm, Scene([ball]), spare=[spare]))
    start, goal = arm.configuration([0.0, 0.0]), arm.configuration([3.0, 0.0])
    planes = SeparatingPlanes(bound)
    assert planes.segment_is_clear(start, goal)
    bound.clearance.move_obstacle("ball", [1.5, 0.0, 0.0])
    with pytest.raises(SceneChangedError):
        planes.segment_is_clear(start, goal)
    assert not SeparatingPlanes(bound).segment_is_clear(start, goal)
