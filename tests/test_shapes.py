"""What coal cannot differentiate becomes a shape around it, or is refused by name."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.clearance import COAL_TOLERANCE, DISTANCE_TOLERANCE
from densarm.errors import RobotDescriptionError
from densarm.shapes import (
    box_hull,
    circumscribed_cylinder,
    convex_hull,
    differentiable_geometry,
    extreme_points,
)

COORDINATE = st.floats(-2.0, 2.0)
SIZE = st.floats(0.01, 2.0)


@pytest.fixture(scope="module")
def model() -> pin.Model:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "joint")
    model.addFrame(pin.Frame("arm", 1, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    return model


def geometry_of(model, *shapes: tuple[coal.CollisionGeometry, pin.SE3]) -> pin.GeometryModel:
    geometry = pin.GeometryModel()
    for k, (shape, placement) in enumerate(shapes):
        frame = model.getFrameId("arm")
        geometry.addGeometryObject(pin.GeometryObject(f"arm_{k}", 1, frame, placement, shape))
    return geometry


def at(*position: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array(position))


def mesh_of(points: np.ndarray) -> coal.BVHModelOBBRSS:
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(0, len(points))
    mesh.addVertices(points)
    mesh.endModel()
    return mesh


def excess(shape: coal.CollisionGeometry, points: np.ndarray) -> float:
    """How far the farthest point is outside a shape [m]."""
    pose, ball = coal.Transform3s(), coal.Sphere(1e-3)
    request = coal.DistanceRequest(True)
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    distances = []
    for point in points:
        ball_pose = coal.Transform3s(np.eye(3), point)
        result = coal.DistanceResult()
        distances.append(coal.distance(shape, pose, ball, ball_pose, request, result) + 1e-3)
    return max(distances)


@given(points=arrays(np.float64, (12, 3), elements=COORDINATE, unique=True))
def test_hull_encloses_its_points(points):
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2] < 1e-3:
        return
    hull = convex_hull(points)
    assert excess(hull, points) < 1e-9
    corners = {tuple(point) for point in points}
    assert all(tuple(corner) in corners for corner in hull.points())


def test_hull_too_fine_for_coal_encloses_closely():
    """A cone's tip is next to every corner of its rim, and coal takes 255 of them."""
    angle = np.linspace(0.0, 2 * np.pi, 600, endpoint=False)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(600)])
    points = np.vstack([rim, [[0.0, 0.0, 0.5]]])
    hull = convex_hull(points)
    assert excess(hull, points) < 1e-9
    assert np.linalg.norm(hull.points(), axis=1).max() < 1.05


def test_mesh_becomes_its_hull(model):
    points = np.random.default_rng(0).normal(size=(60, 3))
    result = differentiable_geometry(model, geometry_of(model, (mesh_of(points), at(1, 2, 3))))
    (item,) = result.geometryObjects
    assert isinstance(item.geometry, coal.ConvexBase)
    assert item.placement.isApprox(at(1, 2, 3))
    assert excess(item.geometry, points) < 1e-9


@given(radius=SIZE, length=SIZE, turn=st.floats(0, 2 * np.pi), part=st.floats(-0.5, 0.5))
def test_prism_encloses_its_cylinder_closely(radius, length, turn, part):
    prism = circumscribed_cylinder(radius, length)
    rim = np.array([[radius * np.cos(turn), radius * np.sin(turn), part * length]])
    assert excess(prism, rim) < 1e-9
    corners = np.array(prism.points())
    assert np.linalg.norm(corners[:, :2], axis=1).max() < 1.0013 * radius
    np.testing.assert_allclose(np.abs(corners[:, 2]), length / 2, rtol=1e-12)


def test_lone_cylinder_becomes_a_prism(model):
    geometry = geometry_of(
        model, (coal.Cylinder(0.1, 0.5), at(0, 0, 0)), (coal.Sphere(0.1), at(0, 0, 0.25))
    )
    prism, ball = differentiable_geometry(model, geometry).geometryObjects
    assert prism.geometry.num_points == 128
    assert isinstance(ball.geometry, coal.Sphere)


# 1.57 for a right angle moves the ends of a cylinder of 0.1 m by 4e-5 m.
@pytest.mark.parametrize("mismatch", [0.0, 4e-5])
def test_cylinder_between_two_spheres_becomes_a_capsule(model, mismatch):
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
def test_other_shapes_are_refused_by_name(model, shape):
    geometry = geometry_of(model, (coal.Sphere(0.1), at(0, 0, 0)), (shape, at(0, 0, 0)))
    message = f"'arm_1' of link 'arm' is a {type(shape).__name__}"
    with pytest.raises(RobotDescriptionError, match=message):
        differentiable_geometry(model, geometry)


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.3, 0.2, 0.0]])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (CORNERS, "span no volume"),
        (CORNERS[:3] + np.eye(3), "span no volume"),
        (np.vstack([CORNERS, [[0.5, 0.5, 1e-8]]]), "span no volume"),
        (np.zeros((8, 3)), "span no volume"),
        (np.where(CORNERS == 0.3, np.nan, CORNERS), "not finite"),
        (np.where(CORNERS == 0.3, np.inf, CORNERS), "not finite"),
        (np.random.default_rng(0).normal(size=(20, 3)) * 1e150, "beyond 1000 km"),
    ],
)
def test_points_without_a_hull_are_refused(points, message):
    with pytest.raises(RobotDescriptionError, match=message):
        convex_hull(points)


@pytest.mark.parametrize(
    "shape",
    [
        coal.Sphere(0.2),
        coal.Capsule(0.1, 0.6),
        box_hull((0.2, 0.4, 0.6)),
        convex_hull(np.eye(4)[:, :3]),
    ],
)
def test_extreme_points_enclose_the_shape(shape):
    """The support of the shape in any direction is that of the balls around the points."""
    points, radius = extreme_points(shape)
    far = 100.0
    for vector in np.random.default_rng(0).normal(size=(50, 3)):
        direction = vector / np.linalg.norm(vector)
        plane = coal.Halfspace(-direction, -far)
        result = coal.DistanceResult()
        identity = coal.Transform3s()
        d = coal.distance(shape, identity, plane, identity, coal.DistanceRequest(True), result)
        assert far - d == pytest.approx((points @ direction).max() + radius, abs=1e-9)


def test_distances_between_boxes_that_nearly_touch():
    """coal's boxes err here by 1e-6 m and more; the largest gap over all axes is exact."""
    random = np.random.default_rng(0)
    for _ in range(300):
        a, b = random.uniform(0.02, 1.0, (2, 3))
        turn = pin.exp3(random.normal(size=3) * 10.0 ** random.uniform(-9, 0))
        axes = separating_axes(turn)
        reach = np.abs(axes) @ (a / 2) + np.abs(axes @ turn) @ (b / 2)
        direction = random.normal(size=3)
        gap = random.choice([-1, 1]) * 10.0 ** random.uniform(-9, -3)
        centre = direction * ((reach + gap) / np.abs(axes @ direction)).min()
        expected = (np.abs(axes @ centre) - reach).max()
        request = coal.DistanceRequest(True)
        request.gjk_tolerance = request.epa_tolerance = COAL_TOLERANCE
        d = coal.distance(
            box_hull(a),
            coal.Transform3s(),
            box_hull(b),
            coal.Transform3s(turn, centre),
            request,
            coal.DistanceResult(),
        )
        # Where edges and corners are nearest, the axes give less than the distance apart.
        assert d > expected - DISTANCE_TOLERANCE
        assert expected > 0 or d < expected + DISTANCE_TOLERANCE


def separating_axes(turn: np.ndarray) -> np.ndarray:
    crossed = np.cross(np.eye(3)[:, None], turn.T[None]).reshape(9, 3)
    length = np.linalg.norm(crossed, axis=1)
    return np.vstack([np.eye(3), turn.T, crossed[length > 1e-14] / length[length > 1e-14, None]])
