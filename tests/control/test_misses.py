"""Rows of misses ahead: those of a world in which arm and obstacles have gone on as they do."""

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm
from densarm.control.misses import MissesAhead
from densarm.scene.obstacles import Box, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.world import World

MARGIN, MISS, SOON = 0.01, 0.03, 0.21


@pytest.mark.parametrize("turning", [(0.0, 0.0, 0.0), (0.5, -1.0, 2.0)])
@pytest.mark.parametrize("seed", range(4))
def test_rows_are_those_of_where_everything_goes(panda: Arm, turning: Array, seed: int) -> None:
    random = np.random.default_rng(seed)
    scene = Scene(
        [
            Box(name="box", size=(0.1, 0.2, 0.3), position=(0.7, 0.1, 0.4)),
            Sphere(name="ball", radius=0.08, position=(0.4, -0.6, 0.7)),
            Sphere(name="far", radius=0.08, position=(0.0, 3.0, 0.7)),
        ]
    )
    world = World(panda, scene)
    pairs = ActivePairs(world)
    linear = random.uniform(-0.6, 0.2, 3)
    velocity = np.concatenate([linear, turning])
    world.move_obstacle("box", (0.7, 0.1, 0.4), velocity=velocity)
    world.move_obstacle("ball", (0.4, -0.6, 0.7), velocity=(0.0, 1.2, 0.0))
    angles = panda.angles(panda.postures["ready"])
    v, ahead = random.uniform(-0.4, 0.4, panda.nv), 0.25
    pairs.update(panda.configuration(angles))
    limits, moving = panda.limits, np.array(["panda" not in names[1] for names in world.pairs])
    bounds = np.array([limits.lower, limits.upper])
    table = np.zeros((world.n_pairs, panda.nv + 1))
    misses = MissesAhead(world, pairs, moving, bounds, MARGIN, MISS)
    count = misses.write(angles, v, ahead, table)
    turn = pin.Quaternion(pin.exp3(ahead * np.array(turning))).coeffs()
    world.move_obstacle("box", np.array((0.7, 0.1, 0.4)) + ahead * linear, turn)
    world.move_obstacle("ball", (0.4, -0.6 + ahead * 1.2, 0.7))
    there = world.clearance(panda.configuration(angles + ahead * v))
    clear = there.distance - np.where(moving, MISS, MARGIN)
    near = np.flatnonzero(clear <= 0.12)
    if not moving[near].any():
        near = near[:0]
    assert count == len(near)
    np.testing.assert_allclose(table[:count, :-1], there.gradient[near], atol=1e-6)
    least = there.gradient[near] @ v - clear[near] / SOON
    np.testing.assert_allclose(table[:count, -1], least, atol=1e-6)
    world.move_obstacle("box", (5.0, 0.0, 0.4))
    world.move_obstacle("ball", (0.0, 5.0, 0.7))
    pairs.update(panda.configuration(angles))
    assert not misses.write(angles, v, ahead, table)  # nothing is to be missed
