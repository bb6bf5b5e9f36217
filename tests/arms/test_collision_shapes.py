"""What coal cannot differentiate becomes a shape around it, closely, or is refused by name."""

from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.arms.arm import load_arm
from densarm.arms.collision_shapes import (
    FittedCapsule,
    differentiable_geometry,
    fitted_capsule,
)
from densarm.errors import RobotDescriptionError
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.values.arrays import Array
from densarm.world.world import DISTANCE_TOLERANCE, World

BRANCHING = Path(__file__).parents[1] / "data" / "branching.urdf"
ARMS: dict[str, str | Path] = {"panda": "panda", "branching": BRANCHING}


def outside(points: Array, capsule: FittedCapsule) -> float:
    """How far the farthest point is outside the capsule [m]."""
    axis = capsule.end - capsule.start
    fraction = np.clip((points - capsule.start) @ axis / max(float(axis @ axis), 1e-300), 0, 1)
    nearest = capsule.start + np.outer(fraction, axis)
    return float(np.linalg.norm(points - nearest, axis=1).max()) - capsule.radius


def corners(shape: coal.ConvexBase, placement: pin.SE3) -> Array:
    return np.array([placement.act(point) for point in shape.points()])


clouds = arrays(np.float64, st.tuples(st.integers(4, 40), st.just(3)), elements=st.floats(-1, 1))


@settings(max_examples=25)
@given(cloud=clouds, size=st.sampled_from([1e-3, 1.0, 1e3]), away=st.floats(-10, 10))
def test_points_are_enclosed(cloud: Array, size: float, away: float) -> None:
    points = size * (cloud + away)
    assume(np.ptp(points, axis=0).max() > 1e-3 * size)
    assert outside(points, fitted_capsule(points)) <= 0.0


@settings(max_examples=10)
@given(
    radius=st.floats(0.02, 0.3),
    length=st.floats(0.01, 1.0),
    turn=arrays(float, 3, elements=st.floats(-3, 3)),
)
def test_capsules_are_found_again(radius: float, length: float, turn: Array) -> None:
    random = np.random.default_rng(0)
    ball = random.normal(size=(200, 3))
    ball *= radius / np.linalg.norm(ball, axis=1)[:, np.newaxis]
    ball[:, 2] += np.where(ball[:, 2] > 0, 0.5, -0.5) * length
    capsule = fitted_capsule(ball @ pin.exp3(turn))
    true = FittedCapsule(np.array([0, 0, -length / 2]), np.array([0, 0, length / 2]), radius)
    assert capsule.volume < (1 + 1e-4) * true.volume


@pytest.mark.parametrize("name", ARMS)
def test_bodies_lie_in_their_capsules(name: str) -> None:
    hulls, capsules = (load_arm(ARMS[name], shapes=shapes) for shapes in ("hull", "capsule"))
    assert capsules.joint_names == hulls.joint_names
    pairs = zip(
        hulls.collision_model.geometryObjects, capsules.collision_model.geometryObjects, strict=True
    )
    fitted = 0
    for hull, capsule in pairs:
        assert hull.name == capsule.name
        assert isinstance(capsule.geometry, coal.Capsule | coal.Sphere)
        if isinstance(hull.geometry, coal.ConvexBase):
            half = np.array([0, 0, capsule.geometry.halfLength])
            ends = capsule.placement.act(-half), capsule.placement.act(half)
            again = FittedCapsule(*ends, capsule.geometry.radius)
            assert outside(corners(hull.geometry, hull.placement), again) <= 0.0
            fitted += 1
    assert fitted > 2


@pytest.mark.parametrize("name", ARMS)
def test_capsules_are_never_farther_than_hulls(name: str) -> None:
    scene = Scene([Sphere(name="ball", radius=0.1, position=(0.4, 0.1, 0.5))])
    arms = [load_arm(ARMS[name], shapes=shapes) for shapes in ("hull", "capsule")]
    hulls, capsules = (World(arm, scene) for arm in arms)
    common = [pair for pair in hulls.pairs if pair in capsules.pairs]
    assert len(common) > 0.8 * hulls.n_pairs
    index = [[c.pairs.index(pair) for pair in common] for c in (hulls, capsules)]
    random = np.random.default_rng(0)
    limits = np.clip([arms[0].limits.lower, arms[0].limits.upper], -np.pi, np.pi)
    for _ in range(30):
        q = arms[0].configuration(random.uniform(*limits))
        true, smaller = (c.distances(q)[i] for c, i in zip((hulls, capsules), index, strict=True))
        # Where bodies overlap, depths follow other directions out.
        apart = smaller > 0.0
        assert (smaller[apart] <= true[apart] + DISTANCE_TOLERANCE).all()
        assert (smaller[true < 0.0] <= DISTANCE_TOLERANCE).all()


def test_the_same_body_gives_the_same_capsule() -> None:
    points = np.random.default_rng(0).normal(size=(200, 3))
    first, second = fitted_capsule(points), fitted_capsule(points)
    np.testing.assert_array_equal(np.hstack(first), np.hstack(second))


@pytest.fixture(scope="module")
def model() -> pin.Model:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    model.addFrame(pin.Frame("arm", 1, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    return model


def geometry_of(
    model: pin.Model, *shapes: tuple[coal.CollisionGeometry, pin.SE3]
) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    for k, (shape, placement) in enumerate(shapes):
        frame = model.getFrameId("arm")
        geometry.addGeometryObject(pin.GeometryObject(f"arm_{k}", 1, frame, placement, shape))
    return geometry


def at(*position: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(position))


def mesh_of(points: Array) -> coal.BVHModelOBBRSS:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(0, len(points))
    mesh.addVertices(points)
    mesh.endModel()
    return mesh


def test_mesh_becomes_its_hull(
    model: pin.Model, excess: Callable[[coal.CollisionGeometry, Array], float]
) -> None:
    points = np.random.default_rng(0).normal(size=(60, 3))
    result = differentiable_geometry(model, geometry_of(model, (mesh_of(points), at(1, 2, 3))))
    (item,) = result.geometryObjects
    assert isinstance(item.geometry, coal.ConvexBase)
    assert item.placement.isApprox(at(1, 2, 3))
    assert excess(item.geometry, points) < 1e-9


def test_lone_cylinder_becomes_a_prism(model: pin.Model) -> None:
    geometry = geometry_of(
        model, (coal.Cylinder(0.1, 0.5), at(0, 0, 0)), (coal.Sphere(0.1), at(0, 0, 0.25))
    )
    prism, ball = differentiable_geometry(model, geometry).geometryObjects
    assert prism.geometry.num_points == 128
    assert isinstance(ball.geometry, coal.Sphere)


# 1.57 for a right angle moves the ends of a cylinder of 0.1 m by 4e-5 m.
@pytest.mark.parametrize("mismatch", [0.0, 4e-5])
def test_cylinder_between_two_spheres_becomes_a_capsule(model: pin.Model, mismatch: float) -> None:
    turned = pin.SE3(pin.rpy.rpyToMatrix(0.4, 0.3, 0.0), np.array([0.1, 0.2, 0.3]))
    ends = [turned * at(mismatch, 0, z) for z in (0.25, -0.25)]
    geometry = geometry_of(
        model,
        (coal.Sphere(0.1), ends[0]),
        (coal.Box(1, 1, 1), at(0, 0, 0)),
        (coal.Cylinder(0.1, 0.5), turned),
        (coal.Sphere(0.1), ends[1]),
        (coal.Sphere(0.1), at(1, 1, 1)),
    )
    box, capsule, ball = differentiable_geometry(model, geometry).geometryObjects
    assert [box.name, capsule.name, ball.name] == ["arm_1", "arm_2", "arm_4"]
    assert isinstance(capsule.geometry, coal.Capsule)
    assert box.geometry.num_points == 8
    assert capsule.placement.isApprox(turned)
    assert capsule.geometry.halfLength == 0.25
    np.testing.assert_allclose(capsule.geometry.radius, 0.1 + mismatch, rtol=1e-9)


@pytest.mark.parametrize(
    "shape", [coal.Ellipsoid(0.1, 0.2, 0.3), coal.Cone(0.1, 0.2), coal.Halfspace(), coal.Plane()]
)
def test_other_shapes_are_refused_by_name(model: pin.Model, shape: coal.CollisionGeometry) -> None:
    geometry = geometry_of(model, (coal.Sphere(0.1), at(0, 0, 0)), (shape, at(0, 0, 0)))
    message = f"'arm_1' of link 'arm' is a {type(shape).__name__}"
    with pytest.raises(RobotDescriptionError, match=message):
        differentiable_geometry(model, geometry)
