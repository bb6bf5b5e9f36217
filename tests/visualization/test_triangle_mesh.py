from pathlib import Path

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.scene.mesh_file import read_mesh
from densarm.scene.shapes import box_hull
from densarm.visualization.triangle_mesh import TriangleMesh, mesh_of, sphere_swept_hull, tube

SIZES = st.floats(0.05, 3.0)


def volume(mesh: TriangleMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.sum(a * np.cross(b, c))) / 6.0


@settings(max_examples=25)
@given(size=st.tuples(SIZES, SIZES, SIZES))
def test_box_is_flat_with_twelve_edges(size: tuple[float, float, float]) -> None:
    mesh = mesh_of(box_hull(size))
    assert volume(mesh) == pytest.approx(np.prod(size))
    assert len(mesh.edges) == 12
    np.testing.assert_allclose(np.sort(np.abs(mesh.normals)), [[0.0, 0.0, 1.0]] * 36, atol=1e-12)
    assert np.all(np.sum(mesh.normals * mesh.vertices, axis=1) > 0.0)


@pytest.mark.parametrize(
    ("shape", "expected", "edges"),
    [
        (coal.Sphere(0.5), np.pi / 6.0, 0),
        (coal.Capsule(0.5, 2.0), np.pi * (1.0 / 6.0 + 0.5), 0),
        (coal.Cylinder(0.5, 2.0), np.pi / 2.0, 128),
        (coal.Box(1.0, 2.0, 3.0), 6.0, 12),
    ],
)
def test_shapes_have_their_volume_and_their_edges(
    shape: coal.CollisionGeometry, expected: float, edges: int
) -> None:
    mesh = mesh_of(shape)
    assert volume(mesh) == pytest.approx(expected, rel=0.03)
    assert len(mesh.edges) == edges
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0)


def test_meshes_keep_their_triangles() -> None:
    builder = coal.BVHModelOBBRSS()
    builder.beginModel(2, 4)
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    builder.addVertices(corners)
    builder.addTriangle(*corners[[0, 2, 1]])
    builder.addTriangle(*corners[[0, 1, 3]])
    builder.endModel()
    mesh = mesh_of(builder)
    assert len(mesh.faces) == 2
    first = mesh.vertices[mesh.faces[0]]
    np.testing.assert_allclose(first, corners[[0, 2, 1]])


def test_a_mirrored_mesh_is_not_inside_out() -> None:
    file = Path(__file__).parents[1] / "data" / "meshes" / "wedge.stl"
    scales = (1.0, 1.0, 1.0), (1.0, -1.0, 1.0)
    volumes = [volume(mesh_of(read_mesh(file, scale))) for scale in scales]
    assert volumes[1] == pytest.approx(volumes[0]) == pytest.approx(0.3 * 0.2 * 0.15 / 6.0)


@pytest.mark.parametrize(("seed", "radius"), [(0, 0.05), (1, 0.5)])
def test_sphere_swept_hull_is_the_rim_of_what_is_near(seed: int, radius: float) -> None:
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (4, 3))
    mesh = sphere_swept_hull(points, radius)
    used = np.unique(mesh.faces)
    apart = np.linalg.norm(mesh.vertices[used][:, np.newaxis] - points, axis=2)
    np.testing.assert_allclose(apart.min(axis=1), radius, rtol=1e-3)
    support = mesh.vertices[used] @ mesh.normals[used].T
    assert np.all(np.diag(support) >= support.max(axis=0) - 0.02 * radius)


@settings(max_examples=15)
@given(bend=st.floats(0.0, 6.0), radius=st.floats(1e-3, 0.05))
def test_tube_follows_its_curve(bend: float, radius: float) -> None:
    s = np.linspace(0.0, 1.0, 40)
    curve = np.column_stack([np.cos(bend * s), np.sin(bend * s), s])
    mesh = tube(curve, radius, np.column_stack([s, s, s]))
    away = np.linalg.norm(mesh.vertices[:, np.newaxis] - curve, axis=2)
    np.testing.assert_allclose(away.min(axis=1), radius, rtol=1e-6)
    assert mesh.colors is not None
    np.testing.assert_allclose(mesh.colors[:, 0], s[away.argmin(axis=1)])
    assert volume_of_tube(mesh) > 0.0


def volume_of_tube(mesh: TriangleMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    outward = np.cross(b - a, c - a) * mesh.normals[mesh.faces[:, 0]]
    return float(outward.sum(axis=1).min())
