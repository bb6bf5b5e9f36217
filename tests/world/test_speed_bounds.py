"""What is slower than the bounds does not touch an arm that stops, or one that flees."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from densarm.arms.arm import load_arm
from densarm.errors import InvalidValueError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.speed_bounds import evasion_speeds, passive_speeds
from densarm.world.stopping import HELD_SHARE, StoppingTrajectory
from densarm.world.world import World

REACTION = 0.05


@pytest.fixture(scope="module")
def with_ball() -> World:
    panda = load_arm("panda", shapes="capsule")
    ball = Sphere(name="ball", radius=0.08, position=(0.0, 0.0, 5.0))
    return World(panda, Scene([ball]), [Sphere(name="spare", radius=0.1, position=(0.0, 0.0, 9.0))])


@settings(max_examples=40, deadline=None)
@given(
    at=st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    share=st.tuples(*[st.floats(-1.0, 1.0)] * 7),
    aside=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
)
def test_nothing_slower_reaches_an_arm_before_it_rests(
    with_ball: World, at: Array, share: Array, aside: Array
) -> None:
    world, arm = with_ball, with_ball.arm
    q, v = arm.postures["ready"], np.array(share) * arm.limits.velocity
    world.move_obstacle("ball", at)
    speeds = passive_speeds(world, q, v, 0.01, REACTION)
    k = int(speeds.argmin())
    assume(0.0 < speeds[k] < 50.0)
    assert "ball" in world.pairs[k]
    row = world.query(q)[k].copy()
    toward = -row[1:4] + np.array(aside)
    toward *= speeds[k] / np.linalg.norm(toward)
    stop = StoppingTrajectory(arm, HELD_SHARE).duration(q, v)
    for t in np.linspace(0.0, REACTION + stop, 12):
        braked = max(t - REACTION, 0.0)
        way = min(t, REACTION) + (braked - 0.5 * braked**2 / stop if stop else 0.0)
        world.move_obstacle("ball", np.array(at) + t * toward)
        distance = world.distances(arm.configurations(arm.angles(q) + way * v))
        assert distance[["ball" in names for names in world.pairs]].min() >= 0.01 - 1e-7


def test_a_body_that_flees_keeps_what_is_slower_away(with_ball: World) -> None:
    world, arm = with_ball, with_ball.arm
    q, begin = arm.postures["ready"], np.array((0.7, 0.1, 0.7))
    world.move_obstacle("ball", begin)
    speeds, sample = evasion_speeds(world, q, 0.0, REACTION), world.clearance(q)
    k = int(np.where(["ball" in names for names in world.pairs], sample.distance, np.inf).argmin())
    assert 0.2 < speeds[k] < np.abs(sample.gradient[k]) @ arm.limits.velocity + 1e-9
    normal = world.query(q)[k, 1:4].copy()
    ramp, flee = (arm.limits.velocity / arm.limits.acceleration).max(), np.sign(sample.gradient[k])

    def least(speed: float) -> float:
        found = np.inf
        for t in np.arange(0.0, REACTION + ramp, 0.005):
            way = 0.5 * max(t - REACTION, 0.0) ** 2 / ramp * arm.limits.velocity * flee
            world.move_obstacle("ball", begin - speed * t * normal)
            found = min(found, world.distances(arm.configurations(arm.angles(q) + way))[k])
        return float(found)

    assert least(0.9 * speeds[k]) > 0.0
    assert least(1.5 * speeds[k]) < 0.0


def test_own_pairs_spare_ones_and_still_bodies_have_their_bounds(with_ball: World) -> None:
    world, q = with_ball, with_ball.arm.postures["ready"]
    world.move_obstacle("ball", (0.5, 0.5, 0.3))
    at_rest = passive_speeds(world, q, np.zeros(7), 0.0, REACTION)
    distance = world.distances(q)
    for k, names in enumerate(world.pairs):
        if "ball" in names:
            assert at_rest[k] == pytest.approx(distance[k] / REACTION, rel=1e-5)
        else:
            assert at_rest[k] == evasion_speeds(world, q)[k] == np.inf
    first = world.pairs.index(("panda_link1_0", "ball"))
    assert evasion_speeds(world, q)[first] == pytest.approx(0.0, abs=1e-3)


def test_bad_numbers_are_refused(with_ball: World) -> None:
    q = with_ball.arm.postures["ready"]
    with pytest.raises(InvalidValueError, match="reaction"):
        passive_speeds(with_ball, q, np.zeros(7), reaction=0.0)
    with pytest.raises(InvalidValueError, match="margin"):
        evasion_speeds(with_ball, q, margin=-0.1)
