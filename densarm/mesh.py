"""Mesh: an obstacle from a mesh file, as one convex hull or as convex pieces."""

from dataclasses import dataclass
from pathlib import Path

import coal
import numpy as np

from densarm.errors import DensarmError, InvalidValueError
from densarm.mesh_file import convex_pieces
from densarm.obstacles import Body, Vector3, store
from densarm.shapes import convex_hull
from densarm.validation import finite_tuple, one_of, positive


@dataclass(frozen=True, kw_only=True)
class Mesh(Body):
    """The convex hull of a mesh, or convex pieces that together follow it.

    The corners of the hulls are read once and kept, so that a scenario's JSON form holds them
    and does not depend on the file.

    Raises:
        InvalidValueError: neither path nor pieces, a scale that is not positive, or pieces that
            span no volume.
        FileContentError: the file cannot be read as a mesh with volume.
    """

    path: str = ""
    """STL, OBJ or DAE file; read unless the pieces are given."""
    scale: Vector3 = (1.0, 1.0, 1.0)
    """Factors x y z from the file's unit to metres."""
    convex: str = "hull"
    """``"hull"``: the convex hull of all, which fills holes. ``"pieces"``: a decomposition."""
    pieces: tuple[tuple[Vector3, ...], ...] = ()
    """Corners of each convex piece [m]; from the file where not given."""

    def __post_init__(self) -> None:
        super().__post_init__()
        name = self.name
        one_of(f"{name}.convex", self.convex, ["hull", "pieces"])
        scale = finite_tuple(f"{name}.scale", self.scale, 3)
        store(self, path=str(self.path), scale=tuple(positive(f"{name}.scale", s) for s in scale))
        if self.pieces:
            store(self, pieces=_checked(f"{name}.pieces", self.pieces))
        elif self.path:
            store(self, pieces=convex_pieces(Path(self.path), self.scale, self.convex))
        else:
            raise InvalidValueError(f"{name}.path", self.path, "the path of a mesh file")

    def convex_shapes(self) -> tuple[coal.CollisionGeometry, ...]:
        """Return the convex hull of each piece."""
        return tuple(convex_hull(np.array(piece)) for piece in self.pieces)


def _checked(name: str, pieces: tuple[tuple[Vector3, ...], ...]) -> tuple[tuple[Vector3, ...], ...]:
    """Return the pieces as tuples, once each is known to have a hull."""
    try:
        corners = tuple(tuple(finite_tuple(name, point, 3) for point in piece) for piece in pieces)
        for piece in corners:
            convex_hull(np.array(piece).reshape(-1, 3))
    except InvalidValueError:
        raise
    except (TypeError, DensarmError):
        raise InvalidValueError(name, pieces, "corners x y z of pieces with a volume") from None
    return corners
