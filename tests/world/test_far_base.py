"""Bases in coordinates of a map: what happens there is what happens at the world's origin."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.arms.description import RobotDescription
from densarm.errors import DensarmError
from densarm.scenarios.run import run
from densarm.scenarios.scenario import load_scenario
from densarm.scene.obstacles import Box, HalfSpace, Obstacle, Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.world import World

TURN = pin.rpy.rpyToMatrix(0.1, -0.2, 0.3)
FAR = [9.0, 1e3, 5e5]


def obstacles(there: Array) -> list[Obstacle]:
    return [
        Box(name="box", size=(0.3, 0.2, 0.4), position=there + np.array([0.5, 0.4, 0.3])),
        Sphere(name="ball", radius=0.1, position=there + np.array([-0.4, 0.4, 0.5])),
        HalfSpace(name="floor", normal=(0.1, 0.2, 1.0), position=there - np.array([0.0, 0.0, 0.2])),
    ]


def world_at(there: Array) -> World:
    arm = load_arm("panda", base_placement=pin.SE3(TURN, there))
    return World(arm, Scene(obstacles(there)))


@pytest.mark.slow
@pytest.mark.parametrize("far", FAR)
def test_distances_in_map_coordinates(far: float) -> None:
    random, there = np.random.default_rng(0), np.array([far, -0.7 * far, 0.001 * far])
    world, near = world_at(there), world_at(np.zeros(3))
    world.move_obstacle("ball", there + np.array([0.3, -0.5, 0.6]))
    near.move_obstacle("ball", (0.3, -0.5, 0.6))
    limits = near.arm.limits
    for angles in random.uniform(limits.lower, limits.upper, (20, near.arm.nv)):
        q = near.arm.configuration(angles)
        sample, expected = world.clearance(q), near.clearance(q)
        np.testing.assert_allclose(sample.distance, expected.distance, rtol=0, atol=1e-9)
        here, nearest = world.nearest(q), near.nearest(q)
        assert here is not None
        assert nearest is not None
        np.testing.assert_allclose(here.points - there, nearest.points, rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("far", FAR)
def test_runs_in_map_coordinates_are_certified(far: float) -> None:
    """Replayed about a point 1 km off, states would differ by 2e-9.

    Roundings there differ from those at the origin, and may lead the plan by a way of its own.
    """
    scenario, there = load_scenario("panda_table"), np.array([far, far, 0.0])
    description = replace(
        scenario.arm.description, base_placement=(far, far, 0.0, 0.0, 0.0, 0.0, 1.0)
    )
    moved = [replace(item, position=there + item.position) for item in scenario.scene]
    result = run(replace(scenario, arm=Arm(description), scene=Scene(moved)))
    assert result.certified
    for k in np.linspace(0, len(result.time) - 1, 50).astype(int):
        here = scenario.world.distances(result.q[k]).min()
        assert result.clearance[k] == pytest.approx(here, abs=1e-9)


def test_a_urdf_that_begins_far_away(single_link: Callable[..., Arm]) -> None:
    text = single_link('<sphere radius="0.1"/>', origin="0.5 0 0").description.urdf
    axis = '<axis xyz="0 1 0"/>'
    for far, places in ((5e5, True), (2e6, False)):
        moved = text.replace(axis, f'<origin xyz="{far} 0 0"/>{axis}')
        description = RobotDescription(name="single", urdf=moved)
        if not places:
            with pytest.raises(DensarmError, match="beyond 1000 km"):
                Arm(description)
            continue
        ball = Sphere(name="ball", radius=0.1, position=(far, 0.0, 1.0))
        distance = World(Arm(description), Scene([ball])).distances(np.zeros(1))
        assert distance[0] == pytest.approx(np.hypot(0.5, 1.0) - 0.2, abs=1e-9)


@pytest.mark.parametrize("offset", [-0.05, 0.0, 3.0])
@pytest.mark.parametrize("place", [(0.0, 0.0), (900.0, -900.0), (1e5, 0.0)])
def test_planes_know_half_spaces_wherever_their_frame_is(
    two_link: Arm, place: tuple[float, float], offset: float
) -> None:
    """The cube that stands for one is where the arm is, not where the frame is."""
    hanging, raised = (two_link.configuration([angle, 0.0]) for angle in (0.0, np.pi))
    for height, clear in ((-2.2, True), (-1.9, False)):
        floor = HalfSpace(name="floor", offset=offset, position=(*place, height - offset))
        planes = SeparatingPlanes(World(two_link, Scene([floor])))
        assert planes.configuration_is_clear(hanging) == clear
        assert planes.configuration_is_clear(raised)
