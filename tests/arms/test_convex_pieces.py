"""Convex pieces enclose their mesh, its surface and its solid, and follow it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from densarm.arms.convex_pieces import LEAST_GAIN, convex_tree, winding_number
from densarm.scene.shapes import convex_hull
from densarm.values.arrays import Array

# A staircase: its outline in the plane, anticlockwise, and how that is cut into triangles.
OUTLINE = np.array([(0, 0), (3, 0), (3, 1), (2, 1), (2, 2), (1, 2), (1, 3), (0, 3)], dtype=float)
INSIDE = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 6), (0, 6, 7)]


def staircase(depth: float = 1.0) -> Array:
    """A closed staircase of triangles (N, 3, 3)."""
    low, high = (np.column_stack([OUTLINE, np.full(8, z)]) for z in (0.0, depth))
    caps = [[low[c], low[b], low[a]] for a, b, c in INSIDE]
    caps += [[high[a], high[b], high[c]] for a, b, c in INSIDE]
    ends = [(k, (k + 1) % 8) for k in range(8)]
    sides = [[low[a], low[b], high[b]] for a, b in ends]
    sides += [[low[a], high[b], high[a]] for a, b in ends]
    return np.array([*caps, *sides])


def ball() -> Array:
    """A round mesh, closed."""
    points = np.random.default_rng(0).normal(size=(200, 3))
    points /= np.linalg.norm(points, axis=1)[:, np.newaxis]
    hull = ConvexHull(points)
    out = np.einsum("ij,ij->i", hull.equations[:, :3], points[hull.simplices].mean(axis=1)) > 0
    assert out.all()
    corners = points[hull.simplices]
    turn = np.einsum(
        "ij,ij->i", np.cross(*(corners[:, k] - corners[:, 0] for k in (1, 2))), corners[:, 0]
    )
    corners[turn < 0] = corners[turn < 0][:, ::-1]
    return np.asarray(corners)


def pieces_of(mesh: Array, least_gain: float = LEAST_GAIN) -> list[Array]:
    tree = convex_tree(mesh, least_gain=least_gain)
    return [tree.corners[k] for k in tree.pieces]


def outside(points: Array, pieces: list[Array]) -> float:
    """How far the farthest point is from the nearest piece's inside, about [m]."""
    faces = [ConvexHull(piece).equations for piece in pieces]
    heights = [(points @ face[:, :3].T + face[:, 3]).max(axis=1) for face in faces]
    return float(np.min(heights, axis=0).max())


def on_surface(triangles: Array, count: int = 2000) -> Array:
    random = np.random.default_rng(0)
    shares = random.dirichlet([1.0, 1.0, 1.0], count)
    return np.asarray(
        np.einsum("ij,ijk->ik", shares, triangles[random.integers(len(triangles), size=count)])
    )


def in_solid(triangles: Array, count: int = 500) -> Array:
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    points = np.random.default_rng(0).uniform(low, high, (count, 3))
    return points[[abs(winding_number(triangles, point)) > 0.5 for point in points]]


def turned(triangles: Array, angles: tuple[float, float, float]) -> Array:
    for axis, angle in enumerate(angles):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        c, s = np.cos(angle), np.sin(angle)
        result = triangles.copy()
        result[..., i] = c * triangles[..., i] - s * triangles[..., j]
        result[..., j] = s * triangles[..., i] + c * triangles[..., j]
        triangles = result
    return triangles


def test_a_staircase_is_cut_at_its_steps() -> None:
    pieces = pieces_of(staircase())
    assert 3 <= len(pieces) <= 8
    assert sum(convex_hull(piece).computeVolume() for piece in pieces) < 6.1
    assert convex_hull(staircase().reshape(-1, 3)).computeVolume() > 6.9


@pytest.mark.slow
@settings(max_examples=5)
@given(angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3), size=st.sampled_from([1e-3, 1.0, 1e3]))
def test_pieces_enclose_surface_and_solid(angles: tuple[float, float, float], size: float) -> None:
    mesh = size * turned(staircase(), angles)
    pieces = pieces_of(mesh)
    points = np.vstack([on_surface(mesh), in_solid(mesh)])
    assert outside(points, pieces) < 1e-12 * size
    assert outside(points, pieces[1:]) > 1e-3 * size


@pytest.mark.slow
def test_solid_between_planes_that_meet_inside_is_enclosed() -> None:
    mesh = ball()
    pieces = pieces_of(mesh, least_gain=-1.0)
    assert len(pieces) == 8
    points = np.vstack([on_surface(mesh), in_solid(mesh), np.zeros((1, 3))])
    assert outside(points, pieces) < 1e-12


def test_of_a_mesh_with_holes_every_triangle_is_enclosed() -> None:
    mesh = np.delete(staircase(), [0, 3, 17, 20], axis=0)
    assert outside(on_surface(mesh), pieces_of(mesh)) < 1e-12


def test_a_part_encloses_its_halves() -> None:
    tree = convex_tree(staircase())
    assert tree.pieces == [k for k, (half, _) in enumerate(tree.halves.tolist()) if half == 0]
    for k, halves in enumerate(tree.halves.tolist()):
        if halves[0] > 0:
            assert outside(np.vstack([tree.corners[i] for i in halves]), [tree.corners[k]]) < 1e-12


def test_a_convex_mesh_is_one_piece() -> None:
    assert len(pieces_of(ball())) == 1


def test_a_sheet_is_no_piece_of_its_own() -> None:
    sheet = np.array([[[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 1.0, 0.0]]])
    mesh = np.vstack([staircase(), sheet])
    pieces = pieces_of(mesh)
    assert all(convex_hull(piece).computeVolume() > 0.0 for piece in pieces)
    assert outside(on_surface(mesh), pieces) < 1e-12


def test_the_same_mesh_gives_the_same_pieces() -> None:
    for one, other in zip(*(pieces_of(staircase()) for _ in range(2)), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("point", "times"), [((0.5, 0.5, 0.5), 1.0), ((2.5, 2.5, 0.5), 0.0)])
def test_winding_number(point: tuple[float, ...], times: float) -> None:
    assert winding_number(staircase(), np.array(point)) == pytest.approx(times, abs=1e-12)
