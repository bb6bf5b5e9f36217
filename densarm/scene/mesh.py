"""Mesh: an obstacle from a mesh file, as one convex hull or as convex pieces."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path

import coal
import numpy as np
from numpy.typing import NDArray

from densarm.errors import DensarmError, FileContentError, InvalidValueError
from densarm.scene.mesh_file import read_mesh
from densarm.scene.obstacles import Obstacle
from densarm.scene.shapes import convex_hull
from densarm.values.arrays import Array, Vector
from densarm.values.checks import finite_tuple, one_of
from densarm.values.documented import documented

_CONCAVITY = 0.05  # CoACD's threshold, as a part of the mesh's extent; its own default
_GROWTH = 1e-3  # of pieces, as a part of the mesh's extent; CoACD's fall short by up to 5e-5

_SIGNS = list(product((-1.0, 1.0), repeat=3))

Pieces = tuple[tuple[tuple[float, ...], ...], ...]


@documented
@dataclass(frozen=True, kw_only=True)
class Mesh(Obstacle):
    """The convex hull of a mesh, or convex pieces that together follow it.

    The corners of the hulls are read once and kept, so that a scenario's JSON form holds them
    and does not depend on the file.

    The pieces are by CoACD, an approximate decomposition [Wei, Liu, Ling, Su, "Approximate
    Convex Decomposition for 3D Meshes with Collision-Aware Concavity and Tree Search", SIGGRAPH
    2022], which is deterministic for its fixed seed. The hull encloses the mesh. The pieces are
    grown by a thousandth of the mesh's extent to enclose it too: as CoACD returns them they leave
    out some of its surface.

    Raises:
        InvalidValueError: neither path nor pieces, a scale of zero, pieces that span no volume or
            reach beyond 1 km, or pieces of a file are asked for and CoACD is not installed.
        FileContentError: no such file, not a mesh, too large, without volume, or, for pieces, not
            closed.
    """

    path: str | Path = ""
    """STL, OBJ or DAE file; read unless the pieces are given."""
    scale: Vector = (1.0, 1.0, 1.0)
    """Factors x y z from the file's unit to metres, a DAE's own unit applied; below 0 mirrors."""
    convex: str = "hull"
    """``"hull"``: the convex hull of all, which fills holes. ``"pieces"``: a decomposition."""
    pieces: Sequence[Sequence[Vector] | Array] | Array = ()
    """Corners of each convex piece [m]; from the file where not given."""

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of(f"{self.name}.convex", self.convex, ["hull", "pieces"])
        scale = finite_tuple(f"{self.name}.scale", self.scale, 3)
        if 0.0 in scale:
            raise InvalidValueError(f"{self.name}.scale", scale, "three numbers other than 0")
        self._store(path=str(self.path), scale=scale)
        given = self.pieces.tolist() if isinstance(self.pieces, np.ndarray) else self.pieces
        if given:
            self._keep(given)
        elif self.path:
            self._store(pieces=self._pieces_of_file(scale))
        else:
            raise InvalidValueError(f"{self.name}.path", self.path, "the path of a mesh file")

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the convex hull of each piece, the same objects at every call."""
        return self._hulls

    @cached_property
    def _hulls(self) -> tuple[coal.CollisionGeometry, ...]:
        return tuple(convex_hull(np.array(piece).reshape(-1, 3)) for piece in self.pieces)

    def _keep(self, pieces: Sequence[Sequence[Vector] | Array]) -> None:
        """Store pieces as tuples, once each is known to have a hull."""
        name = f"{self.name}.pieces"
        try:
            corners = tuple(tuple(finite_tuple(name, x, 3) for x in piece) for piece in pieces)
            self._store(pieces=corners)
            self.convex_shapes()
        except InvalidValueError:
            raise
        except (TypeError, DensarmError):
            allowed = "corners x y z of pieces with a volume, within 1 km of their origin"
            raise InvalidValueError(name, pieces, allowed) from None

    def _pieces_of_file(self, scale: tuple[float, ...]) -> Pieces:
        """Return the corners of the convex hulls that stand for the mesh of the file."""
        mesh = read_mesh(Path(self.path), scale)
        try:
            whole = hull_corners(np.array(mesh.vertices()), f"the mesh of obstacle {self.name!r}")
            return (whole,) if self.convex == "hull" else _enclosing_pieces(mesh)
        except InvalidValueError:
            raise
        except DensarmError as error:
            raise FileContentError(self.path, str(error)) from None


def indexed_triangles(mesh: coal.BVHModelBase) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices (V, 3) [m] and the indices of the three of each triangle (N, 3)."""
    corners = map(mesh.tri_indices, range(mesh.num_tris))
    triangles = np.array([[corner[i] for i in range(3)] for corner in corners], dtype=np.int64)
    return np.array(mesh.vertices()), triangles


def hull_corners(points: Array, name: str = "a piece") -> tuple[tuple[float, ...], ...]:
    """Return the corners of the convex hull of points (N, 3) [m], which must span a volume."""
    return tuple(map(tuple, np.array(convex_hull(points, name).points()).tolist()))


def _enclosing_pieces(mesh: coal.BVHModelBase) -> Pieces:
    vertices, triangles = indexed_triangles(mesh)
    if not _is_closed(triangles):
        reason = "the mesh is not closed, or its faces point in and out: mend it, or use 'hull'"
        raise DensarmError(reason)
    inwards = mesh.computeVolume() < 0.0
    found = _decomposition(vertices, triangles[:, ::-1] if inwards else triangles)
    grow = _GROWTH * float(np.ptp(vertices, axis=0).max()) * np.array(_SIGNS)
    grown = [(piece[:, None] + grow).reshape(-1, 3) for piece in found]
    if sum(convex_hull(piece).computeVolume() for piece in grown) < abs(mesh.computeVolume()):
        raise DensarmError("the mesh cannot be cut into convex pieces: use 'hull'")
    return tuple(map(hull_corners, grown))


def _is_closed(triangles: NDArray[np.int64]) -> bool:
    """Return whether each edge of a triangle is one edge, run the other way, of another."""
    edges = np.vstack([triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    forth, times = np.unique(edges, axis=0, return_counts=True)
    return bool((times == 1).all()) and np.array_equal(forth, np.unique(edges[:, ::-1], axis=0))


def _decomposition(vertices: Array, triangles: NDArray[np.int64]) -> list[Array]:
    try:
        import coacd
    except ImportError:
        allowed = "'hull', or install the decomposition: pip install 'densarm[meshes]'"
        raise InvalidValueError("convex", "pieces", allowed) from None
    coacd.set_log_level("off")
    mesh = coacd.Mesh(vertices, triangles)
    pieces = coacd.run_coacd(mesh, threshold=_CONCAVITY, preprocess_mode="off", seed=0)
    return [np.asarray(corners, dtype=np.float64) for corners, _ in pieces]
