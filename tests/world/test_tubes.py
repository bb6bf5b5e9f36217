"""A configuration tube holds its points, and what is proved of it holds everywhere in it."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import Arm
from densarm.scene.obstacles import Box, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes, Tube, configuration_tube
from densarm.world.swept_check import SweptCheck, SweptVerdict
from densarm.world.world import DISTANCE_TOLERANCE, World

NUMBERS = st.floats(-4.0, 4.0)
POINTS = st.integers(1, 9).flatmap(lambda n: arrays(float, (n, 3), elements=NUMBERS))
SEED = st.integers(0, 2**32 - 1)


def off(tube: Tube, points: Array) -> Array:
    """Return, for each point, by how much it is outside the tube at the best of many places."""
    share = np.linspace(0.0, 1.0, 2001)
    middle = tube.begin + share[:, np.newaxis] * tube.step
    outside = np.abs(points[:, np.newaxis] - middle) - tube.radius
    return np.asarray(outside.max(axis=2).min(axis=1))


@given(points=POINTS, step=arrays(float, 3, elements=NUMBERS))
def test_holds_every_point(points: Array, step: Array) -> None:
    tube = configuration_tube(points, step)
    assert (tube.radius >= 0.0).all()
    # Places are this far apart.
    assert (off(tube, points) <= np.abs(step).max() / 2000 + 1e-9).all()


@given(begin=arrays(float, 3, elements=NUMBERS), step=arrays(float, 3, elements=NUMBERS))
def test_points_on_the_segment_need_no_radius(begin: Array, step: Array) -> None:
    share = np.linspace(0.0, 1.0, 7)[:, np.newaxis]
    tube = configuration_tube(begin + share * step, step)
    np.testing.assert_allclose(tube.radius, 0.0, atol=1e-12)


def test_points_beside_it_need_half_their_spread() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.2], [2.0, 0.0], [3.0, 0.1]])
    tube = configuration_tube(points, np.array([3.0, 0.0]))
    assert tube.radius == pytest.approx([0.0, 0.1])
    assert tube.begin == pytest.approx([0.0, 0.1])


# What is proved of a tube


@settings(max_examples=40)
@given(seed=SEED)
@pytest.mark.parametrize("name", ["two_link", "branching", "gantry"])
def test_a_clear_tube_is_clear_everywhere_in_it(
    arm_named: Callable[[str], Arm],
    within_limits: Callable[[Arm, Array], Array],
    name: str,
    seed: int,
) -> None:
    """Obstacles are grown by what the radius can move the arm, and by no more."""
    arm, rng = arm_named(name), np.random.default_rng(seed)
    obstacles: list[Obstacle] = [
        Sphere(name="ball", radius=0.1, position=rng.uniform(-1.0, 1.0, 3)),
        Box(name="box", size=(0.2, 0.3, 0.1), position=rng.uniform(-1.0, 1.0, 3)),
    ]
    world = World(arm, Scene(obstacles))
    begin, end = within_limits(arm, rng.uniform(0.1, 0.9, (2, arm.nv)))
    step, radius = 0.2 * (end - begin), rng.uniform(0.0, 0.05, arm.nv)
    tube = Tube(begin, step, radius)
    inside = begin + rng.random((30, 1)) * step + radius * rng.choice([-1.0, 1.0], (30, arm.nv))
    inside = np.clip(inside, arm.limits.lower, arm.limits.upper)
    least = min(world.distances(q).min() for q in arm.configurations(inside))
    assert not SeparatingPlanes(world, max(least, 0.0)).tube_is_clear(tube)
    middle = world.distances(arm.configuration(begin + 0.5 * step))
    margins = middle - world.motion_bound(0.5 * np.abs(step) + radius)
    if margins.min() > 0.0:
        enough = 0.98 * float(margins.min()) - 3.0 * DISTANCE_TOLERANCE
        assert SeparatingPlanes(world, max(enough, 0.0)).tube_is_clear(tube)


def bent_motion(seed: int) -> tuple[Array, Array]:
    """A motion of 150 samples that turns all the time, and how far it leaves its chords."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 150)[:, np.newaxis]
    speed, phase = rng.uniform(-3.0, 3.0, 2), rng.uniform(0.0, 6.0, 2)
    angles = rng.uniform(-3.0, 3.0, 2) + speed * t + 0.3 * np.sin(6.0 * t + phase)
    return angles, np.full((149, 2), 0.3 * 36.0 / 8.0 / 149**2)


def tubes_are_clear(planes: SeparatingPlanes, angles: Array, departure: Array) -> bool:
    """Whether tubes around all chords are proved, those that fail in halves."""
    step = angles[-1] - angles[0]
    tube = configuration_tube(angles, step)
    if planes.tube_is_clear(tube._replace(radius=tube.radius + departure.max(axis=0))):
        return True
    middle = len(angles) // 2
    return len(angles) > 2 and all(
        tubes_are_clear(planes, *half)
        for half in (
            (angles[: middle + 1], departure[:middle]),
            (angles[middle:], departure[middle:]),
        )
    )


@settings(max_examples=30)
@given(seed=SEED)
def test_tubes_around_a_motion_agree_with_the_swept_check(two_link: Arm, seed: int) -> None:
    """Which asks for exact distances everywhere."""
    place = np.random.default_rng(seed).uniform([-2.0, -0.05, -2.0], [2.0, 0.05, 2.0])
    world = World(two_link, Scene([Sphere(name="ball", radius=0.1, position=place)]))
    angles, departure = bent_motion(seed)
    q = two_link.configurations(angles)
    exact, wider = (SweptCheck(world, margin).check(q, departure) for margin in (0.0, 2e-3))
    if tubes_are_clear(SeparatingPlanes(world), angles, departure):
        assert exact.verdict == SweptVerdict.CLEAR
    else:  # by as much as the departure moves the arm at most
        assert wider.verdict != SweptVerdict.CLEAR


def test_the_radius_counts(two_link: Arm) -> None:
    ball = Sphere(name="ball", radius=0.1, position=(0.0, 0.0, 2.2))
    planes = SeparatingPlanes(World(two_link, Scene([ball])))
    begin, step = np.array([2.6, 0.0]), np.array([0.2, 0.0])
    assert planes.tube_is_clear(Tube(begin, step, np.zeros(2)))
    assert not planes.tube_is_clear(Tube(begin, step, np.full(2, 0.5)))
