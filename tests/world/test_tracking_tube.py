"""Whatever keeps within the tube of a motion is clear, and so is stopping from it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.planning.motion import Motion
from densarm.planning.plan import plan_motion
from densarm.scenarios.scenario import Scenario
from densarm.scene.motion import ConstantVelocity
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.stopping import StoppingTrajectory
from densarm.world.tracking_tube import tracking_tube
from densarm.world.world import World

SEED = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def motion(swing_up: Scenario) -> Motion:
    return plan_motion(swing_up.world, swing_up.start, swing_up.goal)


def tube_of(motion: Motion, world: World) -> Array | None:
    return tracking_tube(world, motion.position, motion.velocity)


@settings(max_examples=60, deadline=None)
@given(seed=SEED)
def test_all_that_is_inside_is_clear(motion: Motion, seed: int) -> None:
    world, tube, rng = motion.world, motion.tube, np.random.default_rng(seed)
    assert world is not None
    assert tube is not None
    arm, k = world.arm, int(rng.integers(len(motion.position)))
    off = tube * rng.choice([-1.0, 1.0, rng.uniform(-1.0, 1.0)], tube.size)
    at, v = motion.position[k], motion.velocity[k]
    length = StoppingTrajectory(arm).duration(arm.configuration(at), v)
    for share in (0.0, rng.random(), 1.0):
        q = arm.configuration(at + 0.5 * share * length * v + off)
        assert (world.distances(q) > 0.0).all()


def test_it_is_as_wide_as_what_is_near_lets_it_be(motion: Motion, swing_up: Scenario) -> None:
    """A ball that leaves a millimetre or so at some sample leaves a tube of that size."""
    tube, arm = motion.tube, swing_up.arm
    assert tube is not None
    assert (tube > 2e-3).all()
    radius = 0.05
    far = World(arm, Scene([*swing_up.scene, ball := Sphere(name="ball", radius=radius)]))
    point = next(
        place
        for place in np.random.default_rng(0).uniform(-2.5, 2.5, (4000, 3)) * [1.0, 0.0, 1.0]
        if 0.001 < gap(motion, far, place, ball.name) < 0.003
    )
    near = Sphere(name="ball", radius=radius, position=tuple(point))
    narrow = tube_of(motion, World(arm, Scene([*swing_up.scene, near])))
    assert narrow is None or (narrow < tube).all()


def gap(motion: Motion, world: World, place: Array, name: str) -> float:
    world.move_obstacle(name, tuple(place))
    mine = [k for k, pair in enumerate(world.pairs) if name in pair]
    samples = world.arm.configurations(motion.position[::20])
    return float(min(world.distances(q, np.array(mine)).min() for q in samples))


def test_there_is_none_where_the_motion_is_not_clear(motion: Motion, swing_up: Scenario) -> None:
    at = swing_up.arm.configuration(motion.position[len(motion.position) // 2])
    assert (swing_up.world.distances(at) > 0.0).all()
    everywhere = Sphere(name="ball", radius=0.6, position=(0.0, 0.0, 2.0))
    assert tube_of(motion, World(swing_up.arm, Scene([everywhere]))) is None


def test_there_is_none_among_obstacles_that_move(motion: Motion, swing_up: Scenario) -> None:
    moves = ConstantVelocity(linear=(0.0, 0.1, 0.0))
    ball = Sphere(name="ball", radius=0.1, position=(9.0, 0.0, 0.0), motion=moves)
    assert tube_of(motion, World(swing_up.arm, Scene([ball]))) is None


def test_a_motion_that_nothing_is_known_about_has_none(motion: Motion) -> None:
    assert Motion(motion.period, motion.position, motion.velocity).tube is None
