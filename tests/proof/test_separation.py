"""Lower bounds on distances are never above them, and close below."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from densarm.proof.link_placements import pose_row
from densarm.proof.rounded_hulls import rounded_hulls
from densarm.proof.separation import ACCURACY, plane_gap, separation
from densarm.shapes import box_hull, convex_hull

SEED = st.integers(0, 2**32 - 1)
ANY = np.inf


def random_hull(rng: np.random.Generator) -> coal.ConvexBase:
    """From fat to thin as a sheet of paper."""
    return convex_hull(rng.normal(size=(rng.integers(4, 60), 3)) * 10.0 ** rng.uniform(-3, 0, 3))


def random_pose(rng: np.random.Generator, reach: float) -> pin.SE3:
    quaternion = rng.normal(size=4)
    return pin.SE3(
        pin.Quaternion(quaternion / np.linalg.norm(quaternion)).matrix(),
        rng.normal(size=3) * reach,
    )


def any_corners(hulls) -> np.ndarray:
    corners = np.full((1, 4, 2), -1)
    corners[0, 0] = hulls.first[:2]
    return corners


def bound(hulls, pose: pin.SE3, enough=ANY, corners=None, needed=0.0, normal=None) -> float:
    corners = any_corners(hulls) if corners is None else corners
    normal = np.empty((1, 3)) if normal is None else normal
    poses = np.array([pose_row(pose), pose_row(pin.SE3.Identity())])
    space = np.empty((4, 4)), np.empty((4, 4))
    return separation(
        *hulls[:1], *hulls[2:4], poses, 0, 1, needed, enough, corners, 0, *space, normal, 0
    )


def distance(one, other, pose: pin.SE3) -> float:
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    at, origin = (coal.Transform3s(p.rotation, p.translation) for p in (pose, pin.SE3.Identity()))
    return coal.distance(one, at, other, origin, request, result)


@given(seed=SEED)
def test_bounds_the_distance_from_close_below(seed):
    """From any guess: here the corners that were nearest at the pose before."""
    rng = np.random.default_rng(seed)
    one, other = random_hull(rng), random_hull(rng)
    hulls, pose = rounded_hulls([one, other]), random_pose(rng, 1.0)
    corners = any_corners(hulls)
    for _ in range(4):
        exact = distance(one, other, pose)
        found = bound(hulls, pose, corners=corners)
        assert found <= max(exact, 0.0) + 1e-8
        assert found >= (1.0 - ACCURACY) * exact - 1e-7
        pose = pose * random_pose(rng, 0.02)


@given(seed=SEED, enough=st.floats(0.0, 1.0))
def test_stops_where_it_is_enough(seed, enough):
    rng = np.random.default_rng(seed)
    one, other = random_hull(rng), random_hull(rng)
    hulls, pose = rounded_hulls([one, other]), random_pose(rng, 1.0)
    found = bound(hulls, pose, enough)
    assert found >= min(enough, (1.0 - ACCURACY) * distance(one, other, pose) - 1e-7)
    assert found <= max(distance(one, other, pose), 0.0) + 1e-8


@pytest.mark.parametrize("gap", [1e-6, 1e-3, 0.5])
@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_boxes_face_to_face(gap, slip):
    hulls = rounded_hulls([box_hull([1.0, 2.0, 3.0]), box_hull([1.0, 1.0, 1.0])])
    found = bound(hulls, pin.SE3(np.eye(3), np.array([1.0 + gap, slip, -slip])))
    assert (1.0 - ACCURACY) * gap <= found <= gap * (1.0 + 1e-9)


def test_zero_where_bodies_overlap():
    hulls = rounded_hulls([box_hull([1.0, 1.0, 1.0])] * 2)
    for depth in (0.0, 1e-3, 0.7, 1.0):
        assert bound(hulls, pin.SE3(np.eye(3), np.array([1.0 - depth, 0.1, 0.2]))) == 0.0


def test_spheres_and_capsules_are_points_and_segments_with_a_radius():
    hulls = rounded_hulls([coal.Capsule(0.1, 1.0), coal.Sphere(0.3)])
    np.testing.assert_array_equal(hulls.radius, [0.1, 0.3])
    found = bound(hulls, pin.SE3(np.eye(3), np.array([3.0, 0.0, 4.5])))
    assert 5.0 * (1.0 - ACCURACY) <= found <= 5.0


@given(seed=SEED, needed=st.floats(0.0, 1.0))
def test_stops_where_less_than_needed_is_left(seed, needed):
    rng = np.random.default_rng(seed)
    one, other = random_hull(rng), random_hull(rng)
    hulls, pose = rounded_hulls([one, other]), random_pose(rng, 1.0)
    exact = distance(one, other, pose)
    found = bound(hulls, pose, needed=needed)
    assert found <= max(exact, 0.0) + 1e-8
    if exact > needed + 1e-7:
        assert found >= (1.0 - ACCURACY) * exact - 1e-7


@given(seed=SEED)
def test_the_normal_is_of_a_plane_with_that_gap(seed):
    rng = np.random.default_rng(seed)
    one, other = random_hull(rng), random_hull(rng)
    hulls, pose = rounded_hulls([one, other]), random_pose(rng, 1.0)
    normals = np.zeros((1, 3))
    found = bound(hulls, pose, normal=normals)
    normal = normals[0]
    assume(found > 0.0)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    near = (hulls.points[: hulls.first[1]] @ pose.rotation.T + pose.translation) @ normal
    far = hulls.points[hulls.first[1] :] @ normal
    assert near.min() - far.max() == pytest.approx(found, abs=1e-9)
    poses = np.array([pose_row(pose), pose_row(pin.SE3.Identity())])
    gap = plane_gap(*hulls[:1], *hulls[2:4], poses, 0, 1, *hulls.first[:2], *normal)
    assert gap == pytest.approx(found, abs=1e-9)
