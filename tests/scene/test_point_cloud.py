"""Point clouds: from arrays, files and depth images, kept by a scene, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densarm.errors import FileContentError, InvalidValueError
from densarm.scene.cloud_file import read_points
from densarm.scene.depth_camera import depth_image, depth_points, seen_points
from densarm.scene.obstacles import Box, Capsule, HalfSpace, Sphere
from densarm.scene.point_cloud import PointCloud, voxel_filter
from densarm.scene.scene import Attachment, Scene, parse_obstacle
from densarm.values.arrays import Array

POINTS = np.array([[0.5, 0.25, 1.0], [-0.75, 0.0, 0.125], [0.0, 2.0, -1.0]])
INTRINSICS = np.array([[90.0, 0.0, 32.0], [0.0, 80.0, 24.0], [0.0, 0.0, 1.0]])


def ply(points: Array) -> str:
    head = "ply\nformat ascii 1.0\nelement vertex {}\n{}end_header\n"
    fields = "".join(f"property float {axis}\n" for axis in "xyz")
    return head.format(len(points), fields) + rows(points)


def pcd(points: Array) -> str:
    count = len(points)
    return (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {count}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA ascii\n{rows(points)}"
    )


def rows(points: Array) -> str:
    return "".join("{} {} {}\n".format(*row) for row in points.tolist())


def test_every_kind_of_file_has_the_same_points(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    pytest.importorskip("pypcd4")
    for name, text in (("a.ply", ply(POINTS)), ("a.pcd", pcd(POINTS)), ("a.xyz", rows(POINTS))):
        (tmp_path / name).write_text(text)
    np.save(tmp_path / "a.npy", POINTS)
    for suffix in ("ply", "pcd", "xyz", "npy"):
        found = read_points(tmp_path / f"a.{suffix}")
        np.testing.assert_allclose(found, POINTS, atol=1e-6)
        scaled = PointCloud(name="a", path=tmp_path / f"a.{suffix}", radius=0.01, scale=0.5)
        np.testing.assert_array_equal(scaled.points, 0.5 * POINTS)


def test_files_that_are_none_are_refused_by_one_line(tmp_path: Path) -> None:
    (tmp_path / "words.xyz").write_text("no numbers here\n")
    np.save(tmp_path / "flat.npy", np.zeros((4, 2)))
    for name, reason in (
        ("nowhere.npy", "No such file"),
        ("cloud.las", "must end in .ply"),
        ("words.xyz", "cannot be read as xyz"),
        ("flat.npy", r"shape \(4, 2\)"),
    ):
        with pytest.raises(FileContentError, match=reason) as caught:
            read_points(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_a_scene_keeps_the_points_and_not_the_file(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(500, 3))
    np.save(tmp_path / "a.npy", points)
    table = {"type": "point_cloud", "name": "a", "path": "a.npy", "radius": 0.01, "voxel": 0.2}
    cloud = parse_obstacle(table, tmp_path)
    assert isinstance(cloud, PointCloud)
    text = json.dumps(Scene([cloud]).to_json())
    (tmp_path / "a.npy").unlink()
    (again,) = Scene.from_json(json.loads(text))
    assert again == cloud
    assert hash(again) == hash(cloud)
    assert len(text) < 20 * len(cloud.points) + 500
    assert again != PointCloud(name="a", points=cloud.points[:-1], radius=0.01, voxel=0.2)


def test_rows_that_are_not_finite_are_dropped_and_counted() -> None:
    given_rows = np.vstack([POINTS, [[np.nan, 0, 0], [0, np.inf, 0]], POINTS])
    cloud = PointCloud(name="a", points=given_rows, radius=0.01)
    assert cloud.dropped == 2
    np.testing.assert_array_equal(cloud.points, np.vstack([POINTS, POINTS]))


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        ((), "must be at least one, of 0 given"),
        (np.full((3, 3), np.nan), "must be at least one, of 3 given"),
        (800.0 * POINTS, "are they millimetres"),
        (np.zeros((4, 2)), r"must be of shape \(N, 3\)"),
        ([["x", 1, 2]], "must be numbers"),
        ("no such text", "packed_points"),
    ],
)
def test_bad_points_are_refused_by_one_line(points: object, reason: str) -> None:
    with pytest.raises(InvalidValueError, match=reason) as caught:
        PointCloud(name="a", points=points, radius=0.01)
    assert "\n" not in str(caught.value)


def test_no_link_holds_a_cloud() -> None:
    with pytest.raises(InvalidValueError, match="attached body"):
        Attachment(PointCloud(name="a", points=POINTS, radius=0.01), "hand")


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.01, 1.0))
def test_a_voxel_filter_leaves_one_point_near_each(seed: int, size: float) -> None:
    points = np.random.default_rng(seed).normal(size=(80, 3))
    kept = voxel_filter(points, size)
    far = np.linalg.norm(points[:, np.newaxis] - kept, axis=2).min(axis=1)
    assert far.max() <= size * np.sqrt(3.0)
    np.testing.assert_array_equal(voxel_filter(kept, size), kept)


def test_a_depth_image_of_bodies_becomes_points_on_them() -> None:
    bodies = (
        Box(name="box", size=(0.4, 0.3, 0.2), position=(0.0, 0.1, 1.5)),
        Sphere(name="ball", radius=0.2, position=(0.3, -0.3, 1.2)),
        Capsule(name="rod", radius=0.05, length=0.4, position=(-0.4, 0.0, 1.0)),
        HalfSpace(name="wall", normal=(0, 0, -1), offset=-2.0),
    )
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(0.1, -0.2, 0.05))
    depth = depth_image(bodies, INTRINSICS, (48, 64), (0.05, 0.0, -0.1), turn.coeffs())
    assert (depth > 0.0).all()  # the wall is behind all
    points = depth_points(depth, INTRINSICS) @ turn.matrix().T + [0.05, 0.0, -0.1]
    off_ball = np.abs(np.linalg.norm(points - [0.3, -0.3, 1.2], axis=1) - 0.2)
    off_box = np.abs(np.abs(points - [0.0, 0.1, 1.5]) - [0.2, 0.15, 0.1]).min(axis=1)
    along = np.clip(points[:, 2] - 1.0, -0.2, 0.2)
    axis = np.column_stack([np.full(len(along), -0.4), 0.0 * along, 1.0 + along])
    off_rod = np.abs(np.linalg.norm(points - axis, axis=1) - 0.05)
    off = np.min([off_ball, off_box, off_rod, np.abs(points[:, 2] - 2.0)], axis=0)
    assert off.max() < 5e-3  # of the polyhedra that balls are
    for near in (off_ball, off_box, off_rod):
        assert np.count_nonzero(near < 5e-3) > 20


@pytest.mark.parametrize("position", [(1.0, 0.4, 0.3), (0.0, 0.0, 2.0), (-0.2, -1.0, -0.5)])
def test_a_camera_sees_what_it_looks_at_from_its_own_side(position: tuple[float, ...]) -> None:
    place, target = np.array(position), np.array([0.0, 0.05, 0.1])
    ball = Sphere(name="ball", radius=0.15, position=target)
    points = seen_points([ball], INTRINSICS, (48, 64), place, target)
    assert len(points) > 20
    assert np.abs(np.linalg.norm(points - target, axis=1) - 0.15).max() < 5e-3
    assert ((points - target) @ (place - target) > 0.0).all()
    with pytest.raises(InvalidValueError, match="target"):
        seen_points([ball], INTRINSICS, (48, 64), place, place)


def test_pixels_without_depth_are_no_points() -> None:
    depth = np.array([[1.0, 0.0], [np.nan, 2.0]])
    points = depth_points(depth, np.eye(3))
    np.testing.assert_array_equal(np.isfinite(points).all(axis=1), [True, False, False, True])
    np.testing.assert_array_equal(points[3], [2.0, 2.0, 2.0])
    with pytest.raises(InvalidValueError, match="intrinsics"):
        depth_points(depth, np.ones((3, 3)))
    with pytest.raises(InvalidValueError, match="depth"):
        depth_points(np.zeros(3), np.eye(3))
