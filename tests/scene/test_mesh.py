"""Meshes as obstacles: convex pieces of files, kept in the scenario's own form."""

import importlib.util
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.scene.mesh import Mesh
from densarm.scene.scene import Scene, obstacle_table, parse_obstacle
from densarm.values.arrays import Array, Vector

MESHES = Path(__file__).parents[1] / "data" / "meshes"
WEDGE = {(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.15)}

# Two boxes that share a face: an L, whose hull fills the corner.
CORNERS = np.array(
    [(x, y, z) for z in (0, 1) for x, y in [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]]
)
SIDES = [(k, (k + 1) % 6) for k in range(6)]
FACES = [
    *[face for a, b in SIDES for face in ((a, b, b + 6), (a, b + 6, a + 6))],
    *[(0, b, a) for a, b in [(1, 2), (2, 3), (3, 4), (4, 5)]],
    *[(6, a + 6, b + 6) for a, b in [(1, 2), (2, 3), (3, 4), (4, 5)]],
]


def obj_file(path: Path, vertices: Array, faces: Sequence[tuple[int, ...]]) -> Path:
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.write_text("\n".join(lines) + "\n")
    return path


def rounded(mesh: Mesh) -> set[tuple[float, ...]]:
    (corners,) = mesh.pieces
    return {tuple(np.round(corner, 6).tolist()) for corner in corners}


@pytest.mark.parametrize("name", ["wedge.stl", "wedge.obj", "wedge_cm.dae"])
def test_hull_of_a_file(name: str) -> None:
    assert rounded(Mesh(name="wedge", path=MESHES / name)) == WEDGE
    scaled = Mesh(name="wedge", path=str(MESHES / name), scale=(1, 2, 0.5))
    assert rounded(scaled) == {(x, 2 * y, 0.5 * z) for x, y, z in WEDGE}


def test_hull_fills_a_corner(tmp_path: Path) -> None:
    mesh = Mesh(name="ell", path=obj_file(tmp_path / "ell.obj", CORNERS, FACES))
    assert rounded(mesh) == {tuple(map(float, c)) for c in CORNERS if tuple(c[:2]) != (1, 1)}


@pytest.fixture(scope="module")
def ell(tmp_path_factory: pytest.TempPathFactory) -> Mesh:
    if importlib.util.find_spec("coacd") is None:
        pytest.skip("no CoACD: pip install 'densarm[meshes]'")
    path = obj_file(tmp_path_factory.mktemp("mesh") / "ell.obj", CORNERS, FACES)
    return Mesh(name="ell", path=path, convex="pieces")


def test_pieces_leave_a_corner_free(ell: Mesh) -> None:
    assert len(ell.pieces) == 2
    assert 3.0 < sum(shape.computeVolume() for shape in ell.convex_shapes()) < 3.1
    assert depth(ell, (1.5, 1.5, 0.5)) < -0.45


def test_pieces_enclose_the_mesh(ell: Mesh) -> None:
    random = np.random.default_rng(0)
    points = [
        random.dirichlet((1, 1, 1)) @ CORNERS[list(face)] for face in FACES for _ in range(50)
    ]
    assert min(depth(ell, point) for point in points) > 0.0


def test_pieces_are_the_same_every_time(ell: Mesh) -> None:
    assert Mesh(name="ell", path=ell.path, convex="pieces").pieces == ell.pieces


def test_faces_may_all_point_inwards(ell: Mesh, tmp_path: Path) -> None:
    path = obj_file(tmp_path / "ell.obj", CORNERS, [face[::-1] for face in FACES])
    inwards = Mesh(name="ell", path=path, convex="pieces")
    volumes = [sum(s.computeVolume() for s in it.convex_shapes()) for it in (ell, inwards)]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-3)


def test_a_negative_scale_mirrors(ell: Mesh) -> None:
    mirrored = Mesh(name="ell", path=ell.path, scale=(1, -1, 1), convex="pieces")
    assert depth(mirrored, (0.5, -1.5, 0.5)) == pytest.approx(depth(ell, (0.5, 1.5, 0.5)), abs=2e-3)
    assert depth(mirrored, (1.5, -1.5, 0.5)) < -0.45
    hull = Mesh(name="wedge", path=MESHES / "wedge.stl", scale=(1, 1, -2))
    assert rounded(hull) == {(x, y, -2 * z + 0.0) for x, y, z in WEDGE}
    (shape,) = hull.convex_shapes()
    assert shape.computeVolume() == pytest.approx(2 * 0.3 * 0.2 * 0.15 / 6)


def depth(mesh: Mesh, point: Vector) -> float:
    """How far a point lies inside the piece that it is deepest in [m]."""
    request = coal.DistanceRequest(True, True)
    request.gjk_tolerance = request.epa_tolerance = 1e-10
    tiny, at = coal.Sphere(1e-9), coal.Transform3s(np.eye(3), np.array(point, dtype=float))
    distances: list[float] = [
        coal.distance(shape, coal.Transform3s(), tiny, at, request, coal.DistanceResult())
        for shape in mesh.convex_shapes()
    ]
    return -min(distances)


@pytest.mark.parametrize("faces", [FACES[:-1], [*FACES, FACES[0]], [FACES[0][::-1], *FACES[1:]]])
def test_pieces_need_a_closed_mesh(tmp_path: Path, faces: Sequence[tuple[int, ...]]) -> None:
    path = obj_file(tmp_path / "open.obj", CORNERS, faces)
    with pytest.raises(FileContentError, match=r"open.obj: the mesh is not closed"):
        Mesh(name="ell", path=path, convex="pieces")
    assert len(Mesh(name="ell", path=path).pieces) == 1


def test_scenario_form_does_without_the_file(tmp_path: Path) -> None:
    path = obj_file(tmp_path / "ell.obj", CORNERS, FACES)
    scene = Scene([Mesh(name="ell", path=path)])
    path.unlink()
    assert Scene.from_json(scene.to_json()) == scene


def test_relative_path_starts_from_the_given_folder() -> None:
    table = {"type": "mesh", "name": "wedge", "path": "wedge.stl"}
    wedge = parse_obstacle(table, MESHES)
    assert isinstance(wedge, Mesh)
    assert rounded(wedge) == WEDGE
    with pytest.raises(FileContentError, match=r"wedge.stl: No such file"):
        parse_obstacle(table, MESHES.parent)
    assert obstacle_table(wedge)["path"] == str(MESHES / "wedge.stl")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "m.path = '': must be the path of a mesh file"),
        ({"path": "x.stl", "convex": "both"}, "m.convex = 'both': must be one of hull, pieces"),
        ({"path": "x.stl", "scale": (1, 0, 1)}, "m.scale = .*must be three numbers other than 0"),
        ({"path": "x.stl", "scale": 2.0}, r"m.scale = 2.0: must be of shape \(3,\)"),
        ({"pieces": [[[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]]}, "m.pieces = .*with a volume"),
        ({"pieces": [[]]}, "m.pieces = .*with a volume"),
        ({"pieces": 3}, "m.pieces = 3: must be corners"),
        ({"pieces": [[[0, 0]]]}, r"m.pieces = .*\(3,\), got \(2,\)"),
    ],
)
def test_wrong_meshes(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message) as caught:
        Mesh(name="m", **fields)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.stl", None, "No such file"),
        ("text.stl", b"no mesh\n", "not a mesh in STL, OBJ or DAE"),
        ("text.glb", b"no mesh\n", "not a mesh in STL, OBJ or DAE, by its suffix"),
        (
            "flat.obj",
            b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
            "mesh of obstacle 'm' has no convex hull",
        ),
        ("far.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1e9\nf 1 2 3\nf 1 2 4\n", "beyond 1 km"),
        ("no\0name.stl", None, "no such file"),
    ],
)
def test_wrong_files(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileContentError, match=message) as caught:
        Mesh(name="m", path=path)
    assert "\n" not in str(caught.value)


def test_folder_is_no_mesh(tmp_path: Path) -> None:
    with pytest.raises(FileContentError, match="not a mesh file of at most"):
        Mesh(name="m", path=tmp_path)


@settings(max_examples=30)
@given(cut=st.integers(0, 200), junk=st.binary(max_size=40), suffix=st.sampled_from(["stl", "obj"]))
def test_damaged_files_raise_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, cut: int, junk: bytes, suffix: str
) -> None:
    path = tmp_path_factory.mktemp("mesh") / f"damaged.{suffix}"
    path.write_bytes((MESHES / f"wedge.{suffix}").read_bytes()[:cut] + junk)
    with suppress(DensarmError):
        Mesh(name="m", path=path)


def test_hulls_are_made_once() -> None:
    mesh = Mesh(name="wedge", path=MESHES / "wedge.stl")
    first, second = mesh.convex_shapes(), mesh.convex_shapes()
    assert all(a is b for a, b in zip(first, second, strict=True))
    again = replace(mesh, position=(0, 0, 1))
    assert again.pieces == mesh.pieces
    assert obstacle_table(again).keys() == {"type", *(item.name for item in fields(Mesh))} - {
        "motion"
    }
