"""Worlds of so many pairs that not all have room in Pinocchio's data, against small ones."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.scene.obstacles import Box, Capsule, HalfSpace, Obstacle, Sphere
from densarm.scene.point_cloud import PointCloud
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.configurations import infeasibility
from densarm.world.near_pairs import NearPairs
from densarm.world.pair_slots import N_SLOTS
from densarm.world.separating_planes import SeparatingPlanes, Tube
from densarm.world.swept_check import SweptCheck
from densarm.world.world import World

COUNT = 1200
DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="module")
def arm(arm_named: Callable[[str], Arm]) -> Arm:
    return arm_named("two_link")


@pytest.fixture(scope="module")
def bodies() -> list[Obstacle]:
    """Bodies up to 5 m away, some of them near, one without end, one as a cloud."""
    random, found = np.random.default_rng(0), list[Obstacle]()
    for k in range(COUNT):
        position = random.uniform(-5.0, 5.0, 3)
        quaternion = random.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        placed: dict[str, Any] = {
            "name": f"body {k}",
            "position": position,
            "orientation_xyzw": quaternion,
        }
        size = random.uniform(0.02, 0.5, 3)
        if k % 3 == 0:
            found.append(Box(size=size, **placed))
        elif k % 3 == 1:
            found.append(Sphere(radius=size[0], **placed))
        else:
            found.append(Capsule(radius=0.2 * size[0], length=size[1], **placed))
    points = random.uniform((1.2, 0.7, 1.7), (1.8, 1.3, 2.3), (50, 3))
    found.append(HalfSpace(name="floor", offset=-3.0))
    found.append(PointCloud(name="cloud", points=points, radius=0.01))
    return found


@pytest.fixture
def world(arm: Arm, bodies: list[Obstacle]) -> World:
    return World(arm, Scene(bodies))


def parts(arm: Arm, scene: Scene) -> list[World]:
    """The same in small worlds, whose pairs follow each other, but for those of the arm alone."""
    bodies = list(scene)
    return [World(arm, Scene(bodies[k : k + 200])) for k in range(0, len(bodies), 200)]


def joined(world: World, smaller: list[World], values: Iterator[Array]) -> Array:
    """What small worlds have of each pair, in the order of the whole world's pairs."""
    known = {
        pair: value
        for part, found in zip(smaller, values, strict=True)
        for pair, value in zip(part.pairs, found, strict=True)
    }
    return np.array([known[pair] for pair in world.pairs])


def configurations(arm: Arm, count: int, step: float = 1.0) -> Array:
    random = np.random.default_rng(1)
    steps = step * random.uniform(-1.0, 1.0, (count, arm.nv))
    return arm.configurations(np.cumsum(steps, axis=0) if step < 1.0 else 3.0 * steps)


def test_distances(arm: Arm, world: World) -> None:
    """All of them, and their gradients, in turns; of far ones bounds where these suffice."""
    assert world.n_pairs > N_SLOTS
    smaller = parts(arm, world.scene)
    for q in configurations(arm, 3):
        sample, expected = world.clearance(q), [part.clearance(q) for part in smaller]
        distance = joined(world, smaller, (x.distance for x in expected))
        np.testing.assert_allclose(sample.distance, distance, rtol=0, atol=1e-8)
        gradient = joined(world, smaller, (x.gradient for x in expected))
        np.testing.assert_allclose(sample.gradient, gradient, rtol=0, atol=1e-5)
        near = world.distances_within(q, 0.5)
        np.testing.assert_allclose(near[distance < 0.5], distance[distance < 0.5], atol=1e-8)
        assert (near <= distance + 1e-8).all()
        assert (near[distance > 0.5] > 0.4).all()


def test_near_pairs(arm: Arm, world: World) -> None:
    near = NearPairs(world)
    for q in configurations(arm, 12, 0.2):
        distance = world.distances(q)
        smallest, pair = near.smallest(q)
        assert smallest == pytest.approx(distance.min(), abs=1e-9)
        assert distance[pair] == pytest.approx(smallest, abs=1e-9)
        pairs, found = near.below(q, 0.4)
        assert set(np.flatnonzero(distance < 0.4)) <= set(pairs.tolist())
        np.testing.assert_allclose(found, distance[pairs], atol=1e-9)


def test_active_pairs_while_obstacles_change(arm: Arm, bodies: list[Obstacle]) -> None:
    """Those within reach are asked for, also of what moves, comes and goes; others are bounded."""
    world = World(arm, Scene(bodies), spare=[Sphere(name="spare", radius=0.1)])
    pairs, reach = ActivePairs(world), 0.3
    pairs.set_reach(reach)
    for n, q in enumerate(configurations(arm, 24, 0.1)):
        if n % 3 == 0:
            world.move_obstacle("body 7", (0.1 * n - 1.2, 0.2, 1.0))
        if n == 8:
            world.add_obstacle(Sphere(name="new", radius=0.4, position=(0.5, 0.3, 0.6)))
        if n == 16:
            world.remove_obstacle("new")
        pairs.update(q)
        distance = world.distances(q)
        asked = np.sort(pairs.listed[: pairs.n_awake])
        assert set(np.flatnonzero(distance < reach)) <= set(asked.tolist())
        np.testing.assert_allclose(pairs.distance[asked], distance[asked], atol=1e-8)
        assert (pairs.distance <= distance + 1e-7).all()
        assert pairs.n_awake < 200
        far = int(np.flatnonzero(distance > 2.0)[n])
        assert pairs.query(far) or far in asked
        assert pairs.distance[far] == pytest.approx(distance[far], abs=1e-8)


def test_a_slide_beyond_its_limits(bodies: list[Obstacle]) -> None:
    """Where Lipschitz constants do not hold, balls still tell what is far."""
    arm = load_arm(DATA / "gantry.urdf")
    world = World(arm, Scene(bodies))
    pairs, reach = ActivePairs(world), 0.2
    assert world.n_pairs > N_SLOTS
    pairs.set_reach(reach)
    for share in (0.9, 1.1, 1.2):
        q = arm.configuration(share * np.clip(arm.limits.upper, -1.0, 1.0))
        pairs.update(q)
        near = np.flatnonzero(world.distances(q) < reach)
        assert set(near) <= set(pairs.listed[: pairs.n_awake].tolist())
        assert pairs.n_awake < 200


def test_proofs(arm: Arm, world: World) -> None:
    """Planes and distances prove what they prove of small worlds, in tubes and by margins too."""
    smaller, verdicts = parts(arm, world.scene), set()
    for margin in (0.0, 0.05):
        planes = SeparatingPlanes(world, margin)
        others = [SeparatingPlanes(part, margin) for part in smaller]
        swept = SweptCheck(world, margin)
        for q, target in zip(configurations(arm, 30), configurations(arm, 31)[1:], strict=True):
            angles, step = arm.angles(q), 0.3 * arm.difference(q, target)
            line = np.array([angles, angles + 0.5 * step, angles + step])
            is_clear = planes.polyline_is_clear(line)
            assert is_clear == all(x.polyline_is_clear(line) for x in others)
            ends = arm.configurations(line[[0, 2]])
            assert is_clear == swept.check(ends).verdict.startswith("clear")
            tube = Tube(angles, step, np.full(arm.nv, 0.02))
            assert planes.tube_is_clear(tube) == all(x.tube_is_clear(tube) for x in others)
            verdicts.add(is_clear)
    assert verdicts == {True, False}


def test_what_makes_a_configuration_infeasible(arm: Arm, world: World) -> None:
    told = [infeasibility(SweptCheck(world), {"q": q}) for q in configurations(arm, 30)]
    clear = [bool((world.distances(q) > 0.0).all()) for q in configurations(arm, 30)]
    assert [not fault for fault in told] == clear
    assert {True, False} == set(clear)
