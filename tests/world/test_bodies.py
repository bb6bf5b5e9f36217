"""Bodies: kept as long as they are those of the world, placed and bounded by compiled code."""

import gc
from collections.abc import Callable
from typing import Any
from weakref import ref

import numba
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.arms.arm import Arm
from densarm.scene.obstacles import Box, Capsule, HalfSpace, Sphere
from densarm.scene.scene import Scene
from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array
from densarm.world.bodies import BALL, BOX, RADIUS, bodies_of, place, write_motion_bounds
from densarm.world.separating_planes import SeparatingPlanes
from densarm.world.world import World

PARTS = 8
POSITIONS = st.tuples(*[st.floats(-4.0, 4.0)] * 7).map(np.array)
RATES = st.tuples(*[st.floats(-1.5, 1.5)] * 7).map(np.array)
SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.2, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.5, -0.3, 0.2)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.4, 0.6)),
    ]
)


@pytest.fixture(scope="module", params=["two_link", "panda", "branching, placed", "gantry"])
def world(request: pytest.FixtureRequest, arm_named: Callable[[str], Arm]) -> World:
    return World(arm_named(request.param), SCENE)


# What is kept


def test_bodies_are_kept_until_an_obstacle_changes(two_link: Arm) -> None:
    world = World(two_link, SCENE)
    bodies, corners = bodies_of(world)
    assert bodies_of(world)[0] is bodies
    assert bodies_of(world)[1] is corners
    moved = world.geometry_model.getGeometryId("ball")
    before = bodies.shapes[moved].copy()
    world.move_obstacle("ball", (0.5, 0.2, 0.75))
    new, _ = bodies_of(world)
    np.testing.assert_array_equal(bodies.shapes[moved], before)
    np.testing.assert_allclose((new.shapes - bodies.shapes)[moved, 9:12], [0.0, 0.0, 0.25])
    others = np.arange(len(new.shapes)) != moved
    np.testing.assert_array_equal(new.shapes[others], bodies.shapes[others])
    assert bodies_of(world)[0] is new


def test_bodies_of_one_world_are_not_those_of_another(two_link: Arm) -> None:
    one, other = World(two_link, SCENE), World(two_link, SCENE)
    assert bodies_of(one)[0] is not bodies_of(other)[0]
    one.move_obstacle("ball", (0.5, 0.2, 0.75))
    assert (bodies_of(one)[0].shapes != bodies_of(other)[0].shapes).any()


def test_what_is_kept_does_not_keep_a_world_alive(two_link: Arm) -> None:
    world = World(two_link, SCENE)
    bodies_of(world)
    SeparatingPlanes(world).configuration_is_clear(two_link.configuration([0.0, 0.0]))
    alive = ref(world)
    del world
    gc.collect()
    assert alive() is None


# What they are


def test_every_shape_lies_in_its_box_and_ball(world: World) -> None:
    bodies, _ = bodies_of(world)
    for row, item in zip(bodies.shapes, world.geometry_model.geometryObjects, strict=True):
        points, radius = extreme_points(item.geometry)
        in_joint = points @ item.placement.rotation.T + item.placement.translation
        in_body = (in_joint - row[9:12]) @ row[:9].reshape(3, 3)
        assert row[RADIUS] == radius
        box = row[BOX : BOX + 3]
        np.testing.assert_allclose(np.abs(in_body).max(axis=0), box - radius, atol=1e-12)
        farthest = np.linalg.norm(in_body, axis=1).max()
        assert farthest == pytest.approx(row[BALL] - radius, abs=1e-12)


def test_a_half_space_reaches_as_far_as_its_surface(two_link: Arm) -> None:
    wall = HalfSpace(name="wall", normal=(1.0, 0.2, -0.1), offset=-0.7)
    world = World(two_link, Scene([wall]))
    bodies, _ = bodies_of(world)
    row = bodies.shapes[-1]
    corners = bodies.points[-8:] @ row[:9].reshape(3, 3).T + row[9:12]
    normal = np.array(wall.normal) / np.linalg.norm(wall.normal)
    assert (corners @ normal).max() == pytest.approx(-0.7, abs=1e-9)
    assert (corners @ normal).min() < -100.0


def test_the_last_joint_that_moves_both_bodies_of_a_pair(world: World) -> None:
    """It moves both, and no joint after it does; a body that is fixed to it is the second."""
    model, (bodies, _) = world.arm.model, bodies_of(world)
    for i, j, last in bodies.pairs.tolist():
        above = [set(model.supports[int(bodies.joint[body])]) for body in (i, j)]
        assert max(above[0] & above[1]) == last
        if last in bodies.joint[[i, j]]:
            assert bodies.joint[j] == last
    unordered = np.sort(bodies.pairs[:, :2], axis=1)
    np.testing.assert_array_equal(unordered, np.sort(world.pair_shapes, axis=1))


# Where they are, and how far they move


@numba.njit(error_model="numpy")  # type: ignore[misc, unused-ignore]
def _place_and_bound(
    bodies: Any, angles: Any, step: Any, share: float, joint_pose: Any, pose: Any, bounds: Any
) -> None:
    asked = np.ones(bodies.joint.size, np.bool_)
    place(bodies, angles, step, share, asked, joint_pose, pose)
    write_motion_bounds(bodies, step, 1.0, asked, joint_pose, pose, bounds)


def placed_and_bounded(
    world: World, angles: Array, step: Array, share: float
) -> tuple[Array, Array, Array]:
    """Poses of joints and bodies after a share of a step, and bounds on the motion by all of it."""
    bodies, _ = bodies_of(world)
    joints, shapes = len(bodies.parent), len(bodies.joint)
    joint_pose, pose = np.empty((joints, 12)), np.empty((shapes, 12))
    bounds = np.full((2, shapes, joints), np.nan)
    _place_and_bound(bodies, angles, step, share, joint_pose, pose, bounds)
    return joint_pose, pose, bounds


def pose_row(pose: pin.SE3) -> Array:
    return np.concatenate([pose.rotation.ravel(), pose.translation])


@pytest.mark.slow
@given(angles=POSITIONS, step=POSITIONS, share=st.floats(0.0, 1.0))
def test_placements_agree_with_pinocchio(
    world: World, angles: Array, step: Array, share: float
) -> None:
    """On revolute, continuous and prismatic joints, about any axis, in a chain and in a tree."""
    arm, geometry = world.arm, world.geometry_model.createData()
    angles, step = angles[: arm.nv], step[: arm.nv]
    q = arm.configuration(angles + share * step)
    pin.updateGeometryPlacements(arm.model, arm.data, world.geometry_model, geometry, q)
    joint_pose, pose, _ = placed_and_bounded(world, angles, step, share)
    expected = [pose_row(placement) for placement in arm.data.oMi]
    np.testing.assert_allclose(joint_pose, expected, atol=1e-13)
    for row, own, placement, item in zip(
        pose,
        bodies_of(world)[0].shapes,
        geometry.oMg,
        world.geometry_model.geometryObjects,
        strict=True,
    ):
        np.testing.assert_allclose(row[:9].reshape(3, 3), placement.rotation, atol=1e-12)
        middle = item.placement.actInv(own[9:12])  # of the box around it, in the shape's frame
        np.testing.assert_allclose(row[9:], placement.act(middle), atol=1e-12)


def corners_seen_from(
    world: World, joint: int, shape: pin.GeometryObject, angles: Array, step: Array
) -> Array:
    """Corners of a shape on the way, as the frame of a joint sees them (PARTS + 1, P, 3)."""
    arm, (points, _) = world.arm, extreme_points(shape.geometry)
    seen = []
    for share in np.linspace(0.0, 1.0, PARTS + 1):
        pin.forwardKinematics(arm.model, arm.data, arm.configuration(angles + share * step))
        pose = arm.data.oMi[joint].actInv(arm.data.oMi[shape.parentJoint]) * shape.placement
        seen.append(points @ pose.rotation.T + pose.translation)
    return np.array(seen)


@pytest.mark.slow
@given(angles=RATES, step=RATES)
def test_points_move_and_bend_no_more(world: World, angles: Array, step: Array) -> None:
    arm, limits = world.arm, world.arm.limits  # a slide moves no farther than its limits
    angles = np.clip(angles[: arm.nv], limits.lower, limits.upper)
    step = np.clip(angles + step[: arm.nv], limits.lower, limits.upper) - angles
    _, _, (motion, bend) = placed_and_bounded(world, angles, step, 0.5)
    for index, shape in enumerate(world.geometry_model.geometryObjects):
        if shape.parentJoint == 0:
            continue
        for joint in np.flatnonzero(np.isfinite(motion[index]))[:3]:
            seen = corners_seen_from(world, int(joint), shape, angles, step)
            moved = np.linalg.norm(np.diff(seen, axis=0), axis=2).max()
            bent = np.linalg.norm(np.diff(seen, n=2, axis=0), axis=2).max()
            assert moved <= motion[index, joint] / PARTS + 1e-12
            assert bent <= bend[index, joint] / PARTS**2 + 1e-12


@pytest.mark.slow
def test_one_joint_that_turns_a_stretched_arm(two_link: Arm) -> None:
    """The tip of two links of one metre moves on a circle of two metres."""
    world = World(two_link, Scene())
    _, _, (motion, bend) = placed_and_bounded(world, np.zeros(2), np.array([0.3, 0.0]), 0.5)
    assert 0.3 * 2.0 <= motion[:, 0].max() <= 0.3 * 2.2
    assert 0.3**2 * 2.0 <= bend[:, 0].max() <= 0.3**2 * 2.2
    assert np.nanmax(motion[:, 1]) == np.nanmax(bend[:, 1]) == 0.0
