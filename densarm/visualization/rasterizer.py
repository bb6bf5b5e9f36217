"""Rasterizer: triangles to pixels without a graphics card, by a depth buffer."""

import numpy as np
from numpy.typing import NDArray

from densarm.arrays import Array
from densarm.compiled import compiled
from densarm.errors import InvalidValueError
from densarm.visualization.camera import FIELD_OF_VIEW, Camera
from densarm.visualization.triangle_mesh import TriangleMesh

_SAMPLES = 2  # along each side of a pixel
_NEAREST = 1e-3  # [m] before the camera, from where on a triangle is drawn
_LIGHTS = np.array([[-0.45, 0.75, 0.85, 0.62], [0.75, 0.25, 0.6, 0.28]])  # camera axes, strength
_AMBIENT = 0.34
_SHINE, _GLOSS = 0.22, 24.0  # strength and exponent of highlights
_UNLIT = 1e-6  # length of a normal below which no light falls
_LINE_LIFT = 1.003  # lines on a surface are drawn this much nearer


class Rasterizer:
    """A picture in the making.

    Args:
        camera: where to look from.
        width: of the picture [pixels].
        height: of the picture [pixels].
    """

    def __init__(self, camera: Camera, width: int, height: int) -> None:
        self._camera = camera
        shape = (_SAMPLES * height, _SAMPLES * width)
        self._focus = shape[0] / 2.0 / np.tan(np.radians(FIELD_OF_VIEW) / 2.0)
        self._image = np.ones((*shape, 3), dtype=np.float32)
        self._nearness = np.zeros(shape, dtype=np.float32)
        self._layer_nearness = np.zeros(shape, dtype=np.float32)
        self._layer = np.zeros((*shape, 3), dtype=np.float32)
        lights = _LIGHTS[:, :3] / np.linalg.norm(_LIGHTS[:, :3], axis=1, keepdims=True)
        self._lights = np.column_stack([lights @ camera.axes, _LIGHTS[:, 3]])

    def clear(self) -> None:
        """Begin anew, on white."""
        self._image.fill(1.0)
        self._nearness.fill(0.0)

    def fill(self, mesh: TriangleMesh, opacity: float = 1.0, lift: float = 1.0) -> None:
        """Draw triangles, of which each pixel shows the nearest.

        Args:
            mesh: in the world frame, with colours; where normals are zero, no light falls.
            opacity: 0 to 1; below 1 they hide nothing that is drawn later.
            lift: how many times nearer they count than they are, against what else is there.
        """
        corners = self._project(mesh.vertices)
        corners[:, 2] *= lift
        colors = _colors(mesh)
        if mesh.normals.any():
            light, shine = _reflected(mesh.normals, self._lights, self._camera.axes[2])
            colors = np.minimum(colors * light + shine, 1.0)
        self._draw(corners, mesh.faces, colors, opacity)

    def lines(
        self, ends: Array, color: tuple[float, float, float], width: float, opacity: float
    ) -> None:
        """Draw straight lines.

        Args:
            ends: (K, 2, 3) in the world frame [m].
            color: red, green and blue, 0 to 1.
            width: [pixels].
            opacity: 0 to 1.
        """
        if len(ends) == 0:
            return
        seen = self._project(ends)
        along = seen[:, 1, :2] - seen[:, 0, :2]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        aside = np.zeros_like(seen)
        aside[:, :, :2] = (along[:, ::-1] * [1.0, -1.0] * _SAMPLES * width / 2.0)[:, np.newaxis]
        left, right = seen + aside, seen - aside
        corners = np.concatenate([left, right], axis=1).reshape(-1, 3)
        corners[:, 2] *= _LINE_LIFT
        halves = np.array([[0, 1, 2], [2, 1, 3]], dtype=np.int64)
        faces = (4 * np.arange(len(ends))[:, np.newaxis, np.newaxis] + halves).reshape(-1, 3)
        self._draw(corners, faces, np.tile(color, (len(corners), 1)), opacity)

    def pixels(self) -> NDArray[np.uint8]:
        """Return the picture (height, width, 3)."""
        every = [slice(first, None, _SAMPLES) for first in range(_SAMPLES)]
        total = sum(self._image[rows, columns] for rows in every for columns in every)
        return np.asarray(np.round(total * (255.0 / _SAMPLES**2)), dtype=np.uint8)

    def position(self, point: Array) -> tuple[float, float]:
        """Return column and row of a point (3,) of the world [m], from the top left [pixels]."""
        x, y, _ = self._project(point[np.newaxis])[0] / _SAMPLES
        return float(x), float(y)

    def _project(self, points: Array) -> Array:
        """Return column, row and nearness (..., 3) of points (..., 3), nearness = 1 / depth."""
        camera = self._camera
        seen = (points - camera.target - camera.offset) @ camera.axes.T
        nearness = 1.0 / np.where(seen[..., 2] < -_NEAREST, -seen[..., 2], np.nan)
        rows, columns = self._nearness.shape
        x = columns / 2.0 + self._focus * seen[..., 0] * nearness
        y = rows / 2.0 - self._focus * seen[..., 1] * nearness
        return np.stack([x, y, nearness], axis=-1)

    def _draw(
        self, corners: Array, faces: NDArray[np.int64], colors: Array, opacity: float
    ) -> None:
        if opacity == 1.0:
            _fill(corners, faces, colors, self._nearness, self._image)
            return
        part = tuple(map(_reach, (corners[:, 1], corners[:, 0]), self._nearness.shape))
        self._layer_nearness[part] = self._nearness[part]
        self._layer[part] = self._image[part]
        _fill(corners, faces, colors, self._layer_nearness, self._layer)
        self._image[part] += opacity * (self._layer[part] - self._image[part])


def _reach(coordinates: Array, size: int) -> slice:
    """Return the rows or columns that points reach, of which NaN is behind the camera."""
    seen = coordinates[np.isfinite(coordinates)]
    low, high = (seen.min(), seen.max()) if len(seen) else (0.0, 0.0)
    return slice(int(np.clip(low - 1.0, 0, size)), int(np.clip(high + 1.0, 0, size)))


def _colors(mesh: TriangleMesh) -> Array:
    if mesh.colors is None:
        raise InvalidValueError("colors of the mesh", None, "given")
    return mesh.colors


def _reflected(normals: Array, lights: Array, to_camera: Array) -> tuple[Array, Array]:
    """Return how bright surfaces' own colours are and the highlights on them, by Blinn and Phong.

    Args:
        normals: (N, 3); where one is zero, the colour is left as it is.
        lights: directions and strength (K, 4).
        to_camera: direction (3,).

    Returns:
        Both (N, 1).
    """
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    facing = np.where(normals @ to_camera >= 0.0, 1.0, -1.0)[:, np.newaxis]
    unit = normals * (facing / np.maximum(length, _UNLIT))
    middle = lights[:, :3] + to_camera
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    strength = lights[:, 3:]
    light = _AMBIENT + np.maximum(unit @ lights[:, :3].T, 0.0) @ strength
    shine = _SHINE * np.maximum(unit @ middle.T, 0.0) ** _GLOSS @ strength
    lit = length >= _UNLIT
    return np.where(lit, light, 1.0), np.where(lit, shine, 0.0)


@compiled
def _fill(
    corners: Array,
    faces: NDArray[np.int64],
    colors: Array,
    nearness: NDArray[np.float32],
    image: NDArray[np.float32],
) -> None:
    """Write the colour of the nearest triangle of each pixel, and how near it is."""
    height, width = nearness.shape
    for t in range(faces.shape[0]):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ax, ay, az = corners[a, 0], corners[a, 1], corners[a, 2]
        bx, by, bz = corners[b, 0], corners[b, 1], corners[b, 2]
        cx, cy, cz = corners[c, 0], corners[c, 1], corners[c, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if not abs(area) > 0.0:  # a corner behind the camera is NaN
            continue
        # The pixels whose centres are inside the triangle's rectangle and the picture.
        left = int(np.ceil(max(min(ax, bx, cx), 0.0) - 0.5))
        right = int(np.floor(min(max(ax, bx, cx), width) - 0.5)) + 1
        first = int(np.ceil(max(min(ay, by, cy), 0.0) - 0.5))
        last = int(np.floor(min(max(ay, by, cy), height) - 0.5)) + 1
        for row in range(first, last):
            y = row + 0.5
            for column in range(left, right):
                x = column + 0.5
                u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
                v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
                w = 1.0 - u - v
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                near = u * az + v * bz + w * cz
                if near > nearness[row, column]:
                    nearness[row, column] = near
                    for k in range(3):
                        image[row, column, k] = (
                            u * colors[a, k] + v * colors[b, k] + w * colors[c, k]
                        )
