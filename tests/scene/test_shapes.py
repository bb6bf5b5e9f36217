"""Hulls enclose what they stand for, closely; what has no hull is refused."""

from collections.abc import Callable

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from densarm.errors import RobotDescriptionError
from densarm.scene.shapes import box_hull, circumscribed_cylinder, convex_hull, extreme_points
from densarm.values.arrays import Array
from densarm.world.pair_queries import COAL_TOLERANCE
from densarm.world.world import DISTANCE_TOLERANCE

Excess = Callable[[coal.CollisionGeometry, Array], float]

COORDINATE = st.floats(-2.0, 2.0)
SIZE = st.floats(0.01, 2.0)


@given(points=arrays(np.float64, (12, 3), elements=COORDINATE, unique=True))
def test_hull_encloses_its_points(excess: Excess, points: Array) -> None:
    if np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2] < 1e-3:
        return
    hull = convex_hull(points)
    assert excess(hull, points) < 1e-9
    corners = {tuple(point) for point in points}
    assert all(tuple(corner) in corners for corner in hull.points())


def test_hull_too_fine_for_coal_encloses_closely(excess: Excess) -> None:
    """A cone's tip is next to every corner of its rim, and coal takes 255 of them."""
    angle = np.linspace(0.0, 2 * np.pi, 600, endpoint=False)
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(600)])
    points = np.vstack([rim, [[0.0, 0.0, 0.5]]])
    hull = convex_hull(points)
    assert excess(hull, points) < 1e-9
    assert np.linalg.norm(hull.points(), axis=1).max() < 1.05


@given(radius=SIZE, length=SIZE, turn=st.floats(0, 2 * np.pi), part=st.floats(-0.5, 0.5))
def test_prism_encloses_its_cylinder_closely(
    excess: Excess, radius: float, length: float, turn: float, part: float
) -> None:
    prism = circumscribed_cylinder(radius, length)
    rim = np.array([[radius * np.cos(turn), radius * np.sin(turn), part * length]])
    assert excess(prism, rim) < 1e-9
    corners = np.array(prism.points())
    assert np.linalg.norm(corners[:, :2], axis=1).max() < 1.0013 * radius
    np.testing.assert_allclose(np.abs(corners[:, 2]), length / 2, rtol=1e-12)


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.3, 0.2, 0.0]])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (CORNERS, "span no volume"),
        (CORNERS[:3] + np.eye(3), "span no volume"),
        (np.vstack([CORNERS, [[0.5, 0.5, 1e-8]]]), "span no volume"),
        (np.zeros((8, 3)), "span no volume"),
        (1e-320 * np.random.default_rng(0).normal(size=(20, 3)), "span no volume"),
        (np.where(CORNERS == 0.3, np.nan, CORNERS), "not finite"),
        (np.where(CORNERS == 0.3, np.inf, CORNERS), "not finite"),
        (np.random.default_rng(0).normal(size=(20, 3)) * 1e150, "beyond 1 km"),
    ],
)
def test_points_without_a_hull_are_refused(points: Array, message: str) -> None:
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
def test_extreme_points_enclose_the_shape(shape: coal.CollisionGeometry) -> None:
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


def test_distances_between_boxes_that_nearly_touch() -> None:
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


def separating_axes(turn: Array) -> Array:
    crossed = np.cross(np.eye(3)[:, None], turn.T[None]).reshape(9, 3)
    length = np.linalg.norm(crossed, axis=1)
    return np.vstack([np.eye(3), turn.T, crossed[length > 1e-14] / length[length > 1e-14, None]])


def test_the_same_points_give_the_same_hull() -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    assert convex_hull(points) is convex_hull(points.tolist())
    assert convex_hull(points) is not convex_hull(2 * points)
