"""Mesh files: units and nodes of Collada as RViz has them, capitals in STL, and what is refused."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from densarm.errors import FileContentError
from densarm.scene.mesh_file import read_mesh
from densarm.values.arrays import Array

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype=float)
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
GEOMETRY = '<instance_geometry url="#g"/>'
NODE = f"<node>{GEOMETRY}</node>"


def collada(nodes: str = NODE, asset: str = "", library: str = "") -> str:
    """Return a Collada file of a tetrahedron, placed by nodes."""
    numbers = " ".join(map(str, CORNERS.ravel()))
    faces = " ".join(str(k) for face in FACES for k in face)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
 <asset>{asset}</asset>
 <library_geometries><geometry id="g"><mesh>
  <source id="p"><float_array id="a" count="12">{numbers}</float_array><technique_common>
   <accessor source="#a" count="4" stride="3"><param name="X" type="float"/>
   <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
  </source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
 </mesh></geometry></library_geometries>
 <library_nodes>{library}</library_nodes>
 <library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
 <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


def unit(meter: object, up_axis: str = "Z_UP") -> str:
    return f'<unit name="it" meter="{meter}"/><up_axis>{up_axis}</up_axis>'


def ascii_stl(corners: Array = CORNERS) -> str:
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*corners[k]) for k in face)
        + "endloop\nendfacet\n"
        for face in FACES
    ]
    return f"solid it\n{''.join(facets)}endsolid it\n"


def read(folder: Path, content: str, name: str = "it.dae", scale: float = 1.0) -> Array:
    path = folder / name
    path.write_text(content)
    return np.array(read_mesh(path, (scale, scale, scale)).vertices())


def assert_points(found: Array, expected: Array, size: float = 1.0) -> None:
    """Assert that they are the same points, but for what single precision loses of a size."""
    apart = np.linalg.norm(found[:, np.newaxis] - expected, axis=2)
    assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-5 * size


NUMBER = st.floats(-3.0, 3.0).map(lambda x: round(x, 3))
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)


def written(values: Array) -> str:
    return " ".join(map(str, np.ravel(values)))


def translate(at: tuple[float, float, float]) -> tuple[str, Array]:
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return f"<translate>{written(np.array(at))}</translate>", matrix


def rotate(axis: int, degrees: float) -> tuple[str, Array]:
    unit_vector = np.eye(3)[axis]
    matrix = np.eye(4)
    matrix[:3, :3] = pin.exp3(np.radians(degrees) * unit_vector)
    return f"<rotate>{written(unit_vector)} {degrees}</rotate>", matrix


def stretch(factors: tuple[float, float, float]) -> tuple[str, Array]:
    return f"<scale>{written(np.array(factors))}</scale>", np.diag([*factors, 1.0])


def matrix(rows: tuple[tuple[float, float, float], ...], at: Array) -> tuple[str, Array]:
    values = np.eye(4)
    values[:3, :3], values[:3, 3] = rows, at
    return f"<matrix>{written(values)}</matrix>", values


TRANSFORM = st.one_of(
    st.builds(translate, VECTOR),
    st.builds(rotate, st.integers(0, 2), st.floats(-180.0, 180.0)),
    st.builds(stretch, VECTOR),
    st.builds(matrix, st.tuples(VECTOR, VECTOR, VECTOR), VECTOR),
)


@settings(max_examples=30)
@given(
    meter=st.sampled_from(["0.001", "0.01", "1e-2", "0.0254", "0.3048", "1", "10.0"]),
    up_axis=st.sampled_from(["X_UP", "Y_UP", "Z_UP"]),
    outer=st.lists(TRANSFORM, max_size=3),
    inner=st.lists(TRANSFORM, max_size=3),
    by_instance=st.booleans(),
)
def test_units_and_nested_nodes(
    tmp_path_factory: pytest.TempPathFactory,
    meter: str,
    up_axis: str,
    outer: list[tuple[str, Array]],
    inner: list[tuple[str, Array]],
    by_instance: bool,
) -> None:
    """The outer node has the tetrahedron, and the inner one has it again."""
    folder = tmp_path_factory.mktemp("collada")
    texts = ["".join(text for text, _ in steps) for steps in (outer, inner)]
    nested = f'<node id="n">{texts[1]}{GEOMETRY}</node>'
    inside = '<instance_node url="#n"/>' if by_instance else nested
    content = collada(
        f"<node>{texts[0]}{GEOMETRY}{inside}</node>",
        unit(meter, up_axis),
        nested if by_instance else "",
    )
    expected = []
    at = bound = np.eye(4)
    for steps in (outer, inner):
        for _, step in steps:
            at, bound = at @ step, bound @ np.abs(step)
        expected.append(float(meter) * (CORNERS @ at[:3, :3].T + at[:3, 3]))
    size = float(meter) * (3.0 + bound.sum())
    assert_points(read(folder, content), np.vstack(expected), size)


@pytest.mark.parametrize("asset", ["", "<up_axis>Y_UP</up_axis>", '<unit name="meter"/>'])
def test_without_a_unit_it_is_the_metre(tmp_path: Path, asset: str) -> None:
    assert_points(read(tmp_path, collada(asset=asset)), CORNERS)


def test_the_unit_is_read_again_once_the_file_has_changed(tmp_path: Path) -> None:
    read(tmp_path, collada(asset=unit(0.01)))
    assert_points(read(tmp_path, collada(asset=unit(0.0254)), scale=2.0), 0.0508 * CORNERS)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (collada(asset=unit("0,01")), "<unit meter='0,01'>: must be a finite number > 0"),
        (collada(asset=unit(0)), "<unit meter='0'>: must be"),
        (collada(asset=unit("-1")), "<unit meter='-1'>: must be"),
        (collada(asset=unit("nan")), "<unit meter='nan'>: must be"),
        (
            collada(f"<node><asset>{unit(0.01)}</asset>{GEOMETRY}</node>"),
            "more than one <unit>, 0.01, 1 metres",
        ),
        (collada(GEOMETRY), "<instance_geometry> in a <visual_scene>: it must be in a <node>"),
        (collada()[:-1], "not well-formed XML"),
        (collada().replace("?>", ' encoding="none"?>'), "not well-formed XML .*encoding"),
        (GEOMETRY, "not a mesh in STL, OBJ or DAE"),
        (collada(""), "not a mesh in STL, OBJ or DAE"),
    ],
)
def test_collada_that_is_refused(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(FileContentError, match=message) as caught:
        read(tmp_path, content)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["it.gltf", "it.ply", "it.zae", "it"])
def test_other_formats_are_refused_by_their_suffix(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileContentError, match="not a mesh in STL, OBJ or DAE, by its suffix"):
        read(tmp_path, collada(), name)


@pytest.mark.parametrize("change", [str.upper, str.title, str.lower])
def test_stl_in_capitals(tmp_path: Path, change: object) -> None:
    assert_points(read(tmp_path, change(ascii_stl()), "it.STL"), CORNERS)  # type: ignore[operator]


def test_no_facet_is_lost_to_its_capitals(tmp_path: Path) -> None:
    """assimp leaves out such facets without a word."""
    both = ascii_stl().replace("endsolid it", "") + ascii_stl(CORNERS + 9.0).upper()
    assert_points(read(tmp_path, both, "it.stl"), np.vstack([CORNERS, CORNERS + 9.0]))
