"""The bounds on how far bodies move, and distances change with them, are never exceeded."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.arms.arm import Arm, load_arm
from densarm.scene.obstacles import Box, Capsule, Cylinder, Sphere
from densarm.scene.scene import Scene
from densarm.scene.shapes import extreme_points
from densarm.values.arrays import Array
from densarm.world.world import World

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
SCENE = Scene(
    [
        Sphere(name="ball", radius=0.1, position=(0.5, 0.2, 0.5)),
        Box(name="table", size=(0.4, 0.6, 0.1), position=(0.5, -0.3, 0.2)),
        Capsule(name="bar", radius=0.05, length=0.5, position=(-0.4, 0.4, 0.6)),
        Cylinder(name="post", radius=0.05, length=0.6, position=(-0.3, -0.5, 0.4)),
    ]
)
ARMS = [
    "two_link",
    "panda",
    "branching, placed",
    "gantry",
    *(
        pytest.param(name, marks=pytest.mark.slow)
        for name in ("panda capsules", "panda with a stick", "branching")
    ),
]
PARTS = st.tuples(*[st.floats(0.0, 1.0)] * 7).map(np.array)


@pytest.fixture(scope="module", params=ARMS)
def world(request: pytest.FixtureRequest, arm_named: Callable[[str], Arm]) -> World:
    return World(arm_named(request.param), SCENE)


def points_in_world(world: World, q: Array) -> list[Array]:
    """Points of every shape, and one on its surface for each of them."""
    model = world.arm.model
    data = world.geometry_model.createData()
    pin.updateGeometryPlacements(model, model.createData(), world.geometry_model, data, q)
    random = np.random.default_rng(0)
    result = []
    for item, pose in zip(world.geometry_model.geometryObjects, data.oMg, strict=True):
        points, radius = extreme_points(item.geometry)
        outward = random.normal(size=points.shape)
        outward *= radius / np.linalg.norm(outward, axis=1, keepdims=True)
        result.append((points + outward) @ pose.rotation.T + pose.translation)
    return result


@settings(max_examples=30)
@given(parts=PARTS, others=PARTS)
def test_no_point_moves_farther_than_the_bound(
    world: World, within_limits: Callable[[Arm, Array], Array], parts: Array, others: Array
) -> None:
    arm = world.arm
    angles, target = within_limits(arm, parts), within_limits(arm, others)
    q, q_target = arm.configuration(angles), arm.configuration(target)
    motion = world.motion_bound(target - angles)
    moved = [
        np.linalg.norm(b - a, axis=1).max()
        for a, b in zip(points_in_world(world, q), points_in_world(world, q_target), strict=True)
    ]
    names = [item.name for item in world.geometry_model.geometryObjects]
    obstacles = {obstacle.name for obstacle in SCENE}
    for k, (name, other) in enumerate(world.pairs):
        if other in obstacles:
            assert moved[names.index(name)] <= motion[k] + 1e-12
    change = np.abs(world.distances(q_target) - world.distances(q))
    assert (change <= motion + 1e-9).all()


@settings(max_examples=30)
@given(parts=PARTS, seed=st.integers(0, 2**32 - 1), length=st.sampled_from([1e-4, 1e-2, 0.3]))
def test_distances_change_no_more_than_the_bound_in_any_step(
    world: World,
    within_limits: Callable[[Arm, Array], Array],
    parts: Array,
    seed: int,
    length: float,
) -> None:
    """From anywhere, by short steps and long ones."""
    arm, random = world.arm, np.random.default_rng(seed)
    angles = within_limits(arm, parts)
    steps = length * random.normal(size=(3, arm.nv))
    steps = np.clip(angles + steps, arm.limits.lower, arm.limits.upper) - angles
    before = world.distances(arm.configuration(angles))
    motions = world.motion_bound(steps)
    for step, motion in zip(steps, motions, strict=True):
        change = world.distances(arm.configuration(angles + step)) - before
        assert (np.abs(change) <= motion + 1e-9).all()


def test_motion_bounds_of_some_pairs_and_many_steps(world: World) -> None:
    random = np.random.default_rng(0)
    steps, some = random.normal(size=(2, 3, world.arm.nv)), random.permutation(world.n_pairs)[:2]
    motion = world.motion_bound(steps)
    assert motion.shape == (2, 3, world.n_pairs)
    np.testing.assert_allclose(motion, np.abs(steps) @ world.lipschitz.T, rtol=1e-12)
    np.testing.assert_allclose(world.motion_bound(steps, some), motion[..., some], rtol=1e-12)


@settings(max_examples=30)
@given(parts=PARTS)
def test_gradients_stay_below_the_lipschitz_constants(
    world: World, within_limits: Callable[[Arm, Array], Array], parts: Array
) -> None:
    """For self-collision pairs too."""
    arm = world.arm
    sample = world.clearance(arm.configuration(within_limits(arm, parts)))
    assert (np.abs(sample.gradient) <= world.lipschitz + 1e-9).all()


def test_lipschitz_constants_of_the_two_link_arm(two_link: Arm) -> None:
    world = World(two_link, Scene([Sphere(name="ball", radius=0.1)]))
    np.testing.assert_allclose(world.lipschitz, [[1.05, 0.0], [2.05, 1.05]], rtol=1e-12)
    np.testing.assert_allclose(
        world.motion_bound(np.array([-0.1, 0.2])), [0.105, 0.415], rtol=1e-12
    )


def test_slides_move_a_body_as_far_as_they_go(arm_named: Callable[[str], Arm]) -> None:
    gantry = World(arm_named("gantry"), SCENE)
    assert set(gantry.lipschitz.ravel()) == {0.0, 1.0}


def test_slides_lengthen_the_lipschitz_constants_above_them(
    arm_named: Callable[[str], Arm], tmp_path: Path
) -> None:
    longer = tmp_path / "longer.urdf"
    text = BRANCHING.read_text().replace('upper="0.3"', 'upper="1.3"')
    longer.write_text(text.replace("meshes/", f"{BRANCHING.parent}/meshes/"))
    worlds = [World(arm, SCENE) for arm in (arm_named("branching"), load_arm(longer))]
    short, long = (world.lipschitz for world in worlds)
    slide = worlds[0].arm.joint_names.index("slide")
    against_ball = [k for k, pair in enumerate(worlds[0].pairs) if pair == ("blade_0", "ball")]
    np.testing.assert_allclose((long - short)[against_ball], [[1.0, 0, 0, 0, 0]], atol=1e-12)
    assert set(short[:, slide]) == {0.0, 1.0}
