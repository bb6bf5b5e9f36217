"""Distances where coal, asked as tightly as it is, may find none."""

from collections.abc import Callable
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from densarm.arms.arm import Arm, load_arm
from densarm.scene.obstacles import Box
from densarm.scene.scene import Scene
from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array
from densarm.world.active_pairs import ActivePairs
from densarm.world.world import DISTANCE_TOLERANCE, World

ROBOTS = Path(
    str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data"))
)


def awake(world: World) -> ActivePairs:
    pairs = ActivePairs(world)
    pairs.set_reach(np.inf)
    return pairs


@pytest.mark.slow
def test_bodies_far_apart_of_which_coal_knows_no_distance() -> None:
    """At a tolerance of 1e-10 m it tells -1.8e308 m here, and no normal."""
    urdf = ROBOTS / "robots/anymal_b_simple_description/robots/anymal-kinova.urdf"
    arm = load_arm(urdf, joints=[f"j2s6s200_joint_{k}" for k in range(1, 7)])
    q = arm.configuration(
        [
            0.47858752367384355,
            1.330438359427921,
            1.798021635282867,
            -1.8898891010935277,
            3.1924939791897295,
            0.554110486200902,
        ]
    )
    world = World(arm, Scene())
    pair = world.pairs.index(("RH_ADAPTER_0", "j2s6s200_link_6_0"))
    sample = world.clearance(q)
    assert sample.distance[pair] == pytest.approx(1.5171871, abs=1e-7)
    assert np.isfinite(sample.gradient).all()
    for only in (None, np.array([pair])):
        assert world.distances(q, only).min() > 0.0
    nearest = world.nearest(q)
    assert nearest is not None
    assert nearest.distance > 0.0


@pytest.mark.parametrize("size", [1e1, 1e2, 1e3])
def test_large_boxes(arm_named: Callable[[str], Arm], size: float) -> None:
    """Where only a face is near, the distance is that of the nearest corner from its plane."""
    arm, random = arm_named("panda"), np.random.default_rng(0)
    model, data = arm.model, arm.model.createData()
    for _ in range(4):
        sides = size * random.uniform((0.5, 0.5, 1e-3), (1.0, 1.0, 1.0))
        quaternion = pin.Quaternion(pin.exp3(random.normal(size=3)))
        turn, gap = quaternion.matrix(), random.uniform(0.9, 1.6)
        position = turn @ (0.0, 0.0, -0.5 * sides[2] - gap)
        box = Box(name="box", size=sides, position=position, orientation_xyzw=quaternion.coeffs())
        world = World(arm, Scene([box]))
        active, geometry = awake(world), world.geometry_model.createData()
        of_box = [k for k, pair in enumerate(world.pairs) if "box" in pair]
        for angles in random.uniform(arm.limits.lower, arm.limits.upper, (5, arm.nv)):
            q = arm.configuration(angles)
            pin.updateGeometryPlacements(model, data, world.geometry_model, geometry, q)
            heights = [
                height(world, geometry, int(world.pair_shapes[k, 0]), turn[:, 2]) + gap
                for k in of_box
            ]
            apart = np.array(heights) > 0.0
            active.update(q)
            sample = world.clearance(q)
            for distance in (sample.distance, world.distances(q), active.distance):
                error = (distance[of_box] - heights)[apart]
                assert np.abs(error).max() < DISTANCE_TOLERANCE
            assert np.isfinite(sample.gradient).all()


def height(world: World, data: pin.GeometryData, shape: int, normal: Array) -> float:
    """Least coordinate of a shape along a normal [m]."""
    points, radius = extreme_points(world.geometry_model.geometryObjects[shape].geometry)
    pose = data.oMg[shape]
    return float((points @ pose.rotation.T @ normal).min() + pose.translation @ normal - radius)
