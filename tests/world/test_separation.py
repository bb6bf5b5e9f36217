"""Lower bounds on distances are never above them, and close below."""

from typing import Any, NamedTuple

import coal
import numba
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from densarm.scene.shapes import box_hull, convex_hull
from densarm.values.arrays import Array
from densarm.world.separation import ACCURACY, climb, separation
from densarm.world.simplex import Integers

pytestmark = pytest.mark.slow  # a kernel of its own is compiled

SEED = st.integers(0, 2**32 - 1)
ANY = np.inf


class Hulls(NamedTuple):
    """Two hulls as `Bodies` has them."""

    points: Array
    edges: Integers
    first: Integers
    """First corner of each."""


class Bound(NamedTuple):
    """What `separation` answers, and the gap of its plane."""

    distance: float
    normal: Array
    gap: float


@numba.njit(error_model="numpy")  # type: ignore[misc, unused-ignore]
def _separated(
    hulls: Any, pose: Any, needed: float, enough: float, corners: Any, normal: Any
) -> Any:
    work, end = np.zeros((8, 4)), np.zeros(2, np.int64)
    distance = separation(hulls, pose, 0, 1, needed, enough, corners, work, normal)
    return distance, climb(hulls, pose, 0, 1, corners[0], normal, end)


def hulls_of(one: coal.ConvexBase, other: coal.ConvexBase) -> Hulls:
    corners = [np.array(hull.points()) for hull in (one, other)]
    begin = np.array([0, len(corners[0])])
    neighbours = [
        [first + near for near in hull.neighbors(corner)]
        for hull, first, points in zip((one, other), begin.tolist(), corners, strict=True)
        for corner in range(len(points))
    ]
    ends = np.cumsum([0, *map(len, neighbours)]) + len(neighbours) + 1
    return Hulls(np.vstack(corners), np.concatenate([ends, *neighbours]).astype(np.int64), begin)


def random_hull(rng: np.random.Generator) -> coal.ConvexBase:
    """From fat to thin as a sheet of paper."""
    return convex_hull(rng.normal(size=(rng.integers(4, 60), 3)) * 10.0 ** rng.uniform(-3, 0, 3))


def random_pose(rng: np.random.Generator, reach: float) -> pin.SE3:
    quaternion = rng.normal(size=4)
    return pin.SE3(
        pin.Quaternion(quaternion / np.linalg.norm(quaternion)).matrix(),
        rng.normal(size=3) * reach,
    )


def any_corners(hulls: Hulls) -> Integers:
    corners = np.full((4, 2), -1)
    corners[0] = hulls.first
    return corners


def pose_row(pose: pin.SE3) -> Array:
    return np.concatenate([pose.rotation.ravel(), pose.translation])


def bound(
    hulls: Hulls,
    pose: pin.SE3,
    enough: float = ANY,
    corners: Integers | None = None,
    needed: float = 0.0,
) -> Bound:
    corners = any_corners(hulls) if corners is None else corners
    poses, normal = np.array([pose_row(pose), pose_row(pin.SE3.Identity())]), np.zeros(3)
    found, gap = _separated(hulls, poses, needed, enough, corners, normal)
    return Bound(found, normal, gap)


def distance(one: coal.ConvexBase, other: coal.ConvexBase, pose: pin.SE3) -> float:
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    at, origin = (coal.Transform3s(p.rotation, p.translation) for p in (pose, pin.SE3.Identity()))
    return float(coal.distance(one, at, other, origin, request, result))


@given(seed=SEED)
def test_bounds_the_distance_from_close_below(seed: int) -> None:
    """From any guess: here the corners that were nearest at the pose before."""
    rng = np.random.default_rng(seed)
    one, other = random_hull(rng), random_hull(rng)
    hulls, pose = hulls_of(one, other), random_pose(rng, 1.0)
    corners = any_corners(hulls)
    for _ in range(4):
        exact = distance(one, other, pose)
        found = bound(hulls, pose, corners=corners).distance
        assert found <= max(exact, 0.0) + 1e-8
        assert found >= (1.0 - ACCURACY) * exact - 1e-7
        pose = pose * random_pose(rng, 0.02)


@given(seed=SEED, enough=st.floats(0.0, 1.0))
def test_stops_where_it_is_enough(seed: int, enough: float) -> None:
    rng = np.random.default_rng(seed)
    one, other = random_hull(rng), random_hull(rng)
    hulls, pose = hulls_of(one, other), random_pose(rng, 1.0)
    found, exact = bound(hulls, pose, enough).distance, distance(one, other, pose)
    assert found >= min(enough, (1.0 - ACCURACY) * exact - 1e-7)
    assert found <= max(exact, 0.0) + 1e-8


@pytest.mark.parametrize("gap", [1e-6, 1e-3, 0.5])
@pytest.mark.parametrize("slip", [0.0, 0.3])
def test_boxes_face_to_face(gap: float, slip: float) -> None:
    hulls = hulls_of(box_hull([1.0, 2.0, 3.0]), box_hull([1.0, 1.0, 1.0]))
    pose = pin.SE3(np.eye(3), np.array([1.0 + gap, slip, -slip]))
    assert (1.0 - ACCURACY) * gap <= bound(hulls, pose).distance <= gap * (1.0 + 1e-9)


@pytest.mark.parametrize("depth", [0.0, 1e-3, 0.7, 1.0])
def test_zero_where_bodies_overlap(depth: float) -> None:
    hulls = hulls_of(*[box_hull([1.0, 1.0, 1.0])] * 2)
    pose = pin.SE3(np.eye(3), np.array([1.0 - depth, 0.1, 0.2]))
    assert bound(hulls, pose).distance == 0.0


@given(seed=SEED, needed=st.floats(0.0, 1.0))
def test_stops_where_less_than_needed_is_left(seed: int, needed: float) -> None:
    rng = np.random.default_rng(seed)
    one, other = random_hull(rng), random_hull(rng)
    hulls, pose = hulls_of(one, other), random_pose(rng, 1.0)
    exact = distance(one, other, pose)
    found = bound(hulls, pose, needed=needed).distance
    assert found <= max(exact, 0.0) + 1e-8
    if exact > needed + 1e-7:
        assert found >= (1.0 - ACCURACY) * exact - 1e-7


@given(seed=SEED)
def test_the_normal_is_of_a_plane_with_that_gap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    hulls, pose = hulls_of(random_hull(rng), random_hull(rng)), random_pose(rng, 1.0)
    found = bound(hulls, pose)
    assume(found.distance > 0.0)
    assert np.linalg.norm(found.normal) == pytest.approx(1.0)
    one, other = np.split(hulls.points, hulls.first[1:])
    near = (one @ pose.rotation.T + pose.translation) @ found.normal
    far = other @ found.normal
    assert near.min() - far.max() == pytest.approx(found.distance, abs=1e-9)
    assert found.gap == pytest.approx(found.distance, abs=1e-9)
