"""Rasterizer: triangles to pixels without a graphics card, by a depth buffer."""

import math

import numpy as np
from numpy.typing import NDArray

from densarm.errors import InvalidValueError
from densarm.values.arrays import Array
from densarm.values.kernels import compiled, compiled_part
from densarm.visualization.camera import FIELD_OF_VIEW, Camera
from densarm.visualization.palette import Color
from densarm.visualization.triangle_mesh import TriangleMesh

_SAMPLES = 2  # along each side of a pixel
_NEAREST = 1e-3  # [m] before the camera, from where on a triangle is drawn
_LIGHTS = np.array([[-0.45, 0.75, 0.85, 0.62], [0.75, 0.25, 0.6, 0.28]])  # camera axes, strength
_AMBIENT = 0.34
_SHINE, _GLOSS = 0.22, 24.0  # strength and exponent of highlights
_UNLIT = 1e-6  # length of a normal below which no light falls
_LINE_LIFT = 1.003  # lines on a surface are drawn this much nearer
_PIECES = 16  # of a line


class Rasterizer:
    """A picture in the making, of a width and height [pixels]."""

    def __init__(self, camera: Camera, width: int, height: int) -> None:
        self._camera = camera
        rows, columns = _SAMPLES * height, _SAMPLES * width
        self._focus = rows / 2.0 / np.tan(np.radians(FIELD_OF_VIEW) / 2.0)
        # Nearness, 1 / depth [1/m], and then red, green and blue of each sample.
        self._image = np.empty((4, rows, columns), dtype=np.float32)
        self._layer = np.zeros_like(self._image)
        lights = _LIGHTS[:, :3] / np.linalg.norm(_LIGHTS[:, :3], axis=1, keepdims=True)
        self._lights = np.column_stack([lights @ camera.axes, _LIGHTS[:, 3]])
        self.clear()

    def clear(self) -> None:
        """Begin anew, on white."""
        self._image[0].fill(0.0)
        self._image[1:].fill(1.0)

    def fill(self, mesh: TriangleMesh, opacity: float = 1.0, lift: float = 1.0) -> None:
        """Draw triangles, of which each pixel shows the nearest.

        Args:
            mesh: in the world frame, with colours; where normals are zero, no light falls.
            opacity: 0 to 1; below 1 they hide nothing that is drawn later.
            lift: how many times nearer they count than they are, against what else is there.
        """
        if mesh.colors is None:
            raise InvalidValueError("colors of the mesh", None, "given")
        corners, colors = self._project(mesh.vertices), mesh.colors
        corners[:, 2] *= lift
        if mesh.normals.any():
            light, shine = _reflected(mesh.normals, self._lights, self._camera.axes[2])
            colors = np.minimum(colors * light + shine, 1.0)
        self._draw(corners, mesh.faces, colors, opacity)

    def lines(self, ends: Array, color: Color, width: float, opacity: float) -> None:
        """Draw straight lines with ends (K, 2, 3) in the world [m], of a width [pixels]."""
        # A long slanting line fills little of its rectangle, all of which is looked at.
        share = np.linspace(0.0, 1.0, _PIECES + 1)[:, np.newaxis]
        first, last = np.split(self._project(ends), 2, axis=1)
        cuts = first + share * (last - first)
        seen = np.stack([cuts[:, :-1], cuts[:, 1:]], axis=2).reshape(-1, 2, 3)
        along = seen[:, 1, :2] - seen[:, 0, :2]
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        aside = np.zeros_like(seen)
        aside[:, :, :2] = (along[:, ::-1] * [1.0, -1.0] * _SAMPLES * width / 2.0)[:, np.newaxis]
        left, right = seen + aside, seen - aside
        corners = np.concatenate([left, right], axis=1).reshape(-1, 3)
        corners[:, 2] *= _LINE_LIFT
        halves = np.array([[0, 1, 2], [2, 1, 3]], dtype=np.int64)
        faces = (4 * np.arange(len(seen))[:, np.newaxis, np.newaxis] + halves).reshape(-1, 3)
        self._draw(corners, faces, np.tile(color, (len(corners), 1)), opacity)

    def pixels(self) -> NDArray[np.uint8]:
        """Return the picture (height, width, 3)."""
        pairs = self._image[1:, ::_SAMPLES] + self._image[1:, 1::_SAMPLES]
        mean = (pairs[..., ::_SAMPLES] + pairs[..., 1::_SAMPLES]) / _SAMPLES**2
        return np.round(255.0 * mean).astype(np.uint8).transpose(1, 2, 0)

    def position(self, point: Array) -> tuple[float, float]:
        """Return column and row of a point (3,) of the world [m], from the top left [pixels]."""
        x, y, _ = self._project(point[np.newaxis])[0] / _SAMPLES
        return float(x), float(y)

    def _project(self, points: Array) -> Array:
        """Return column, row and nearness (..., 3) of points (..., 3), nearness = 1 / depth."""
        camera = self._camera
        seen = (points - camera.target - camera.offset) @ camera.axes.T
        nearness = 1.0 / np.where(seen[..., 2] < -_NEAREST, -seen[..., 2], np.nan)
        rows, columns = self._image.shape[1:]
        x = columns / 2.0 + self._focus * seen[..., 0] * nearness
        y = rows / 2.0 - self._focus * seen[..., 1] * nearness
        return np.stack([x, y, nearness], axis=-1)

    def _draw(
        self, corners: Array, faces: NDArray[np.int64], colors: Array, opacity: float
    ) -> None:
        values = np.column_stack([corners, colors])
        is_seen = np.isfinite(corners[:, 2])  # a corner behind the camera is NaN
        if not is_seen.all():
            faces, corners = faces[is_seen[faces].all(axis=1)], corners[is_seen]
        if len(faces) == 0:
            return
        if opacity == 1.0:
            _fill(values, faces, self._image)
            return
        reach = tuple(
            slice(int(np.clip(places.min(), 0, count)), int(np.clip(places.max() + 1, 0, count)))
            for places, count in zip(corners.T[1::-1], self._image.shape[1:], strict=True)
        )
        below, layer = self._image[:, *reach], self._layer[:, *reach]
        layer[0] = below[0]
        _fill(values, faces, self._layer)
        _blend(below, layer, opacity)


def _reflected(normals: Array, lights: Array, to_camera: Array) -> tuple[Array, Array]:
    """Return how bright surfaces' own colours are, and the highlights, by Blinn and Phong (N, 1).

    Lights are directions and strength (K, 4); where a normal is zero, the colour is left as it is.
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
def _fill(corners: Array, faces: NDArray[np.int64], image: NDArray[np.float32]) -> None:
    """Write nearness and colour of the nearest triangles into the image (4, rows, columns).

    Corners are column, row, nearness, red, green and blue (N, 6).
    """
    rows, columns = image.shape[1], image.shape[2]
    for t in range(faces.shape[0]):
        a, b, c = corners[faces[t, 0]], corners[faces[t, 1]], corners[faces[t, 2]]
        bx, by = b[0] - a[0], b[1] - a[1]
        cx, cy = c[0] - a[0], c[1] - a[1]
        inverse = 1.0 / (bx * cy - by * cx)
        first, last = _samples(a[0], b[0], c[0], columns)
        top, bottom = _samples(a[1], b[1], c[1], rows)
        for row in range(top, bottom):
            y = row + 0.5 - a[1]
            for column in range(first, last):
                x = column + 0.5 - a[0]
                v = (x * cy - y * cx) * inverse
                w = (bx * y - by * x) * inverse
                u = 1.0 - v - w
                if u >= 0.0 and v >= 0.0 and w >= 0.0:  # nowhere if the area is zero
                    near = u * a[2] + v * b[2] + w * c[2]
                    if near > image[0, row, column]:
                        for k in range(4):
                            image[k, row, column] = u * a[2 + k] + v * b[2 + k] + w * c[2 + k]


@compiled_part
def _samples(a: float, b: float, c: float, count: int) -> tuple[int, int]:
    """Return the first sample, of a count, between three places, and that after the last."""
    low, high = a if a < b else b, b if a < b else a
    low, high = c if c < low else low, c if c > high else high
    return _sample(low, count), _sample(high, count)


@compiled_part
def _sample(x: float, count: int) -> int:
    """Return the first sample whose middle is not before x, at most their count."""
    return 0 if x <= 0.5 else count if x > count - 0.5 else math.ceil(x - 0.5)


@compiled
def _blend(below: NDArray[np.float32], layer: NDArray[np.float32], opacity: float) -> None:
    """Mix the colours of a layer (4, rows, columns), where it is nearer, into those below it."""
    for row in range(below.shape[1]):
        for column in range(below.shape[2]):
            if layer[0, row, column] > below[0, row, column]:
                for k in range(1, 4):
                    color = below[k, row, column]
                    below[k, row, column] = color + opacity * (layer[k, row, column] - color)
