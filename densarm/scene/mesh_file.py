"""Mesh files: their triangles in metres, for links and obstacles, for distances and pictures."""

import re
from functools import lru_cache
from pathlib import Path
from tempfile import NamedTemporaryFile
from xml.parsers import expat

import coal
import numpy as np

from densarm.errors import FileContentError
from densarm.values.arrays import Array, Vector
from densarm.values.files import captured_stderr

_MAX_BYTES = 100_000_000  # of the largest mesh file that is read
_SUFFIXES = (".stl", ".obj", ".dae")
_INSTANCES = ("instance_geometry", "instance_controller")

_COAL_MESSAGES = rb"(?:eigen:|BVH ).*\n"  # on standard error

_STL_WORDS = rb"solid|facet|normal|outer|loop|vertex|endloop|endfacet|endsolid"
_STL_CAPITALS = re.compile(rb"\b(?=[a-zA-Z]*[A-Z])(?i:" + _STL_WORDS + rb")\b")
_STL_HEADER, _STL_FACET = 84, 50  # [bytes], of a binary file

_LOADER = coal.MeshLoader(coal.BV_OBB)  # the cheapest tree whose vertices Python can read


def read_mesh(path: Path, scale: Vector) -> coal.BVHModelBase:
    """Return the triangles of a mesh file [m].

    The unit of a DAE file (Collada) is applied, and its ``up_axis`` is not: RViz has it so, and
    robots are made to look right there. Many say Y_UP of what is in the frame of its link. coal
    applies neither, as assimp puts both into the transform of the root node, which coal leaves
    out. That is why other formats are refused: glTF has sizes of its own there.

    Args:
        path: an STL, OBJ or DAE file.
        scale: factors x y z from the file's unit to metres; a negative one mirrors.

    Raises:
        FileContentError: no such file, another format, too large, no mesh, or a unit that is none.

    Source: RViz, mesh_loader.cpp, `getMeshUnitRescale` and `buildMesh`; Collada 1.4.1, `<unit>`.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise FileContentError(path, getattr(error, "strerror", None) or "no such file") from None
    if not path.is_file() or status.st_size > _MAX_BYTES:
        raise FileContentError(path, f"not a mesh file of at most {_MAX_BYTES / 1e6:g} MB")
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise FileContentError(path, "not a mesh in STL, OBJ or DAE, by its suffix: convert it")
    factors = np.array(scale, dtype=np.float64)
    try:
        if suffix == ".dae":
            factors *= _metres(path, status.st_mtime_ns, status.st_size)
        capitals = suffix == ".stl" and _stl_in_capitals(path)
        with captured_stderr(_COAL_MESSAGES):
            if capitals:
                return _in_small_letters(capitals, factors)
            return _LOADER.load(str(path), factors)
    except FileContentError:
        raise
    except (ValueError, RuntimeError, OSError):
        raise FileContentError(path, "not a mesh in STL, OBJ or DAE") from None


@lru_cache(maxsize=512)
def _metres(path: Path, _changed: int, _size: int) -> float:
    """Return the length of a Collada file's unit [m]; read again once the file has changed."""
    above: list[str] = []
    units: dict[bool, set[str]] = {True: set(), False: set()}  # the document's, and those in it
    bare: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag == "unit" and above[-1:] == ["asset"]:
            units[len(above) == 2].add(attributes.get("meter", "1"))
        if tag in _INSTANCES and above[-1:] == ["visual_scene"]:
            bare.append(tag)
        above.append(tag)

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: above.pop()
    try:
        parser.Parse(path.read_bytes(), True)
    except (expat.ExpatError, LookupError) as error:  # or an encoding that nobody knows
        raise FileContentError(path, f"not well-formed XML ({error})") from None
    own = units[True] or {"1"}
    if bare:  # assimp would put it into the root node, unit and all
        raise FileContentError(path, f"<{bare[0]}> in a <visual_scene>: it must be in a <node>")
    if len(own | units[False]) > 1:
        found = ", ".join(sorted(own | units[False]))
        raise FileContentError(path, f"more than one <unit>, {found} metres: it must be the same")
    (text,) = own
    try:
        length = float(text)
    except ValueError:
        length = np.nan
    if not 0.0 < length < np.inf:
        raise FileContentError(path, f"<unit meter={text!r}>: must be a finite number > 0")
    return length


def _stl_in_capitals(path: Path) -> bytes:
    """Return an ASCII STL file's content if a word of it has capitals, else nothing.

    assimp refuses those files, or leaves out the facets that are written so.
    """
    content = path.read_bytes()
    count = int.from_bytes(content[_STL_HEADER - 4 : _STL_HEADER], "little")
    is_binary = len(content) == _STL_HEADER + count * _STL_FACET
    if is_binary or content.lstrip()[:5].lower() != b"solid":
        return b""
    return content if _STL_CAPITALS.search(content) else b""


def _in_small_letters(content: bytes, factors: Array) -> coal.BVHModelBase:
    with NamedTemporaryFile(suffix=".stl") as file:
        file.write(content.lower())
        file.flush()
        return _LOADER.load(file.name, factors)
