"""Pictures of a run, a still or an animation, without a display, a browser or a graphics card."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from densarm.errors import InvalidValueError
from densarm.simulation.run import Run
from densarm.values.arrays import Array
from densarm.values.files import atomic_file
from densarm.visualization import palette
from densarm.visualization.rasterizer import Rasterizer
from densarm.visualization.render_scene import RenderScene, SummaryLine
from densarm.visualization.triangle_mesh import TriangleMesh

_STILL_SIZE = (1280, 720)  # [pixels]
_ANIMATION_SIZE = (800, 450)  # [pixels]
_PERIOD = 0.04  # of an animation's frames [s]; GIF counts in hundredths
_MOST_FRAMES = 150
_HOLD = 1.5  # for which the last frame stays [s]
_COLORS, _SCALE_COLORS = 256, 16  # of an animation, and of them for the clearance scale
_NEARLY_WHITE = 247

_BEHIND = 0.998  # lift of the goal posture, so that the arm covers it once it is there
_EDGE_WIDTH, _FLOOR_WIDTH = 1.3, 1.0  # of lines in a picture 1280 pixels wide [pixels]
_EDGE_OPACITY = 0.8
_SHADOW, _SHADOW_OPACITY = (0.25, 0.30, 0.38), 0.16
_SUN = np.array([0.15, -0.1, 1.0])  # direction to the light that casts shadows

_INSET = 24  # from the rim of a picture at a width of 1280 [pixels]
_TITLE_SIZE = 23  # likewise
_TAG_DISTANCE = 40  # likewise, of the clearance from the contact, across and up
_BAR = (150, 8)  # width and height of the colour scale at a width of 1280 [pixels]


def save_picture(run: Run, path: str | Path) -> None:
    """Write a still of a run where it is closest to a collision.

    It shows the arm, its goal, its way and the obstacles, and needs neither display nor browser.

    Args:
        run: what to show.
        path: the file, ending in .png; its folder must exist.

    Raises:
        InvalidValueError: another ending.
        FileContentError: the file cannot be written.
    """
    with _picture_file(path, ".png") as file:
        still(run, *_STILL_SIZE).save(file, format="PNG")


def still(run: Run, width: int, height: int) -> Image.Image:
    """Return a picture of a width and height [pixels] of a run where it is closest to collision."""
    scene = RenderScene(run)
    k = int(np.argmin(scene.clearance)) if scene.closest else len(scene.time) // 2
    return Picture(scene, width, height).frame(k)


def save_animation(run: Run, path: str | Path) -> None:
    """Write an animation of a run, in real time, that plays again and again.

    Args:
        run: what to show.
        path: the file, ending in .gif; its folder must exist.

    Raises:
        InvalidValueError: another ending.
        FileContentError: the file cannot be written.
    """
    with _picture_file(path, ".gif") as file:
        scene = RenderScene(run)
        duration = float(scene.time[-1])
        period = 0.01 * np.ceil(100.0 * max(_PERIOD, duration / _MOST_FRAMES) - 1e-9)
        rows = np.searchsorted(scene.time, np.arange(0.0, duration, period))
        picture = Picture(scene, *_ANIMATION_SIZE)
        images = [picture.frame(int(k)) for k in [*rows, len(scene.time) - 1]]
        colors = _palette(images[len(images) // 2], scene)
        frames = [image.quantize(palette=colors, dither=Image.Dither.NONE) for image in images]
        shown = [round(1e3 * period)] * len(rows) + [round(1e3 * _HOLD)]  # [ms]
        frames[0].save(
            file, format="GIF", save_all=True, append_images=frames[1:], duration=shown, loop=0
        )


def _palette(image: Image.Image, scene: RenderScene) -> Image.Image:
    """Return an image of the colours to draw in: those of a frame, and the clearance scale."""
    kept = [*scene.scale.steps(_SCALE_COLORS), palette.CLOSEST]
    swatches = np.round(255.0 * np.array(kept)).astype(np.uint8)
    few = np.array(image.quantize(_COLORS - len(swatches)).getpalette()).reshape(-1, 3)
    few[few.min(axis=1) > _NEARLY_WHITE] = 255  # Pillow takes any of them for white
    colors = Image.new("P", (1, 1))
    colors.putpalette(np.vstack([few, swatches]).ravel().tolist())
    return colors


@contextmanager
def _picture_file(path: str | Path, ending: str) -> Iterator[BinaryIO]:
    if Path(path).suffix.lower() != ending:
        raise InvalidValueError("picture", str(path), f"a file ending in {ending}")
    with atomic_file(Path(path)) as file:
        yield file


class Picture:
    """Renders the frames of a render scene, in pictures of a width and height [pixels]."""

    def __init__(self, scene: RenderScene, width: int, height: int) -> None:
        self._scene = scene
        self._raster = Rasterizer(scene.camera, width, height)
        self._line_scale = width / 1280.0
        self._caption = Caption(scene, width, height)
        self._standing = {
            body.name: _painted(body.mesh, body.placement.homogeneous, body.color)
            for body in scene.obstacles
        }
        goal = scene.run.task.goal
        self._goal = None if goal is None else self._posed(goal, palette.GOAL)

    def frame(self, k: int) -> Image.Image:
        """Return the picture of frame k."""
        scene, raster = self._scene, self._raster
        raster.clear()
        robot, obstacles = self._posed(scene.q[k]), self._obstacles(k)
        raster.lines(scene.floor, palette.FLOOR, _FLOOR_WIDTH * self._line_scale, 1.0)
        shadow = _shadow([robot, *obstacles], scene.ground)
        raster.fill(shadow, _SHADOW_OPACITY)
        raster.fill(robot)
        if scene.path is not None:
            raster.fill(_unlit(scene.path))
        for mesh, transforms in scene.closest_line.values():
            raster.fill(_unlit(_painted(mesh, transforms[k], palette.CLOSEST)))
        self._draw_translucent(obstacles)
        image = Image.fromarray(raster.pixels())
        label = raster.position(scene.closest[k].points[1]) if scene.closest else None
        self._caption.write(image, k, label)
        return image

    def _posed(self, q: Array, color: palette.Color | None = None) -> TriangleMesh:
        """Return the arm at q (nq,), in its own colours or in one."""
        poses = self._scene.joint_poses(q)
        return _joined(
            [
                _painted(body.mesh, placement.homogeneous, color or body.color)
                for body in self._scene.robot
                for placement in [poses[body.joint] * body.placement]
            ]
        )

    def _obstacles(self, k: int) -> list[TriangleMesh]:
        """Return the obstacles where they are at frame k."""
        now = {
            body.name: _painted(body.mesh, poses[k].homogeneous, body.color)
            for body in self._scene.obstacles
            if (poses := self._scene.obstacle_poses.get(body.name))
        }
        return list((self._standing | now).values())

    def _draw_translucent(self, obstacles: list[TriangleMesh]) -> None:
        """Draw goal and obstacles from the farthest to the nearest."""
        eye = self._scene.camera.target + self._scene.camera.offset
        meshes = [mesh for mesh in (*obstacles, self._goal) if mesh is not None]
        away = [np.linalg.norm(mesh.vertices.mean(axis=0) - eye) for mesh in meshes]
        for k in np.argsort(away)[::-1]:
            if meshes[k] is self._goal:
                self._raster.fill(meshes[k], palette.GOAL_OPACITY, _BEHIND)
                continue
            mesh, width = meshes[k], _EDGE_WIDTH * self._line_scale
            self._raster.fill(mesh, palette.OBSTACLE_OPACITY)
            self._raster.lines(mesh.edges, palette.EDGE, width, _EDGE_OPACITY)


def _painted(mesh: TriangleMesh, transform: Array, color: palette.Color) -> TriangleMesh:
    """Return a mesh of one colour, moved by a transform (4, 4)."""
    turn = transform[:3, :3].T
    return replace(
        mesh,
        vertices=mesh.vertices @ turn + transform[:3, 3],
        normals=mesh.normals @ turn,
        edges=mesh.edges @ turn + transform[:3, 3],
        colors=np.tile(color, (len(mesh.vertices), 1)),
    )


def _joined(meshes: list[TriangleMesh]) -> TriangleMesh:
    before = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + first for mesh, first in zip(meshes, before, strict=True)]
    return TriangleMesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.normals for mesh in meshes]),
        np.vstack(faces),
        np.concatenate([mesh.edges for mesh in meshes]),
        colors=np.vstack([mesh.colors for mesh in meshes if mesh.colors is not None]),
    )


def _unlit(mesh: TriangleMesh) -> TriangleMesh:
    return replace(mesh, normals=np.zeros_like(mesh.normals))


def _shadow(meshes: list[TriangleMesh], height: float) -> TriangleMesh:
    """Return the shadows on the floor at a height [m]."""
    mesh = _unlit(_joined(meshes))
    fallen = mesh.vertices - (mesh.vertices[:, 2:] - height) * _SUN / _SUN[2]
    return replace(mesh, vertices=fallen, colors=np.tile(_SHADOW, (len(fallen), 1)))


class Caption:
    """Writes title, verdicts, legend and time on pictures of a width and height [pixels]."""

    def __init__(self, scene: RenderScene, width: int, height: int) -> None:
        self._scene, self._summary = scene, SummaryLine.of(scene.run)
        self._unit = max(width / 1280.0, 0.6)  # small pictures need larger words
        self._width, self._height = width, height
        title = self._font("DejaVuSans-Bold.ttf", _TITLE_SIZE)
        room = width - 2 * self._at(_INSET)
        share = min(1.0, room / max(title.getlength(self._summary.title), 1.0))
        self._title_font = self._font("DejaVuSans-Bold.ttf", share * _TITLE_SIZE)
        self._text_font = self._font("DejaVuSans.ttf", 16)

    def write(self, image: Image.Image, k: int, end: tuple[float, float] | None) -> None:
        """Write on the picture of frame k; the closest pair's line, if any, ends at `end`."""
        pen = ImageDraw.Draw(image)
        left, top = self._at(_INSET), self._at(20)
        pen.text((left, top), self._summary.title, palette.css(palette.TEXT), self._title_font)
        self._write_verdicts(pen, left, top + self._at(38))
        if self._scene.path is not None and end is not None:
            self._write_scale(pen, left, self._height - self._at(54))
        self._write_time(pen, k)
        if end is not None:
            self._write_distance(pen, k, end)

    def _write_verdicts(self, pen: ImageDraw.ImageDraw, x: float, y: float) -> None:
        """Write each word of the summary on a round field."""
        fields = {True: palette.GOOD, False: palette.BAD, None: palette.QUIET}
        height, inset = self._at(26), self._at(11)
        for text, is_good in self._summary.words:
            end = x + pen.textlength(text, self._text_font) + 2 * inset
            field = (x, y, end, y + height)
            pen.rounded_rectangle(field, height / 2, palette.css(fields[is_good]))
            ink = palette.css(palette.TEXT) if is_good is None else "white"
            middle = (x + inset, y + height / 2)
            pen.text(middle, text, ink, self._text_font, anchor="lm")
            x = end + self._at(8)

    def _write_scale(self, pen: ImageDraw.ImageDraw, x: float, y: float) -> None:
        scale, (width, height) = self._scene.scale, (self._at(size) for size in _BAR)
        for step, color in enumerate(scale.steps(width)):
            pen.line((x + step, y, x + step, y + height), palette.css(color))
        ink = palette.css(palette.TEXT)
        below = y + height + self._at(14)
        pen.text((x, below), "0", ink, self._text_font, anchor="lm")
        text = f"≥ {scale.top * 1e3:g} mm"
        pen.text((x + width, below), text, ink, self._text_font, anchor="rm")
        words = "clearance, along the end effector's path"
        pen.text(
            (x + width + self._at(12), y + height / 2), words, ink, self._text_font, anchor="lm"
        )

    def _write_time(self, pen: ImageDraw.ImageDraw, k: int) -> None:
        time = self._scene.time
        words = f"t = {time[k]:.2f} s"
        at = (self._width - self._at(_INSET), self._height - self._at(40))
        pen.text(at, words, palette.css(palette.TEXT), self._text_font, anchor="rm")
        share = time[k] / time[-1] if time[-1] > 0.0 else 1.0
        bar = (0, self._height - self._at(5), self._width, self._height)
        pen.rectangle(bar, palette.css(palette.QUIET))
        pen.rectangle((*bar[:2], share * self._width, bar[3]), palette.css(palette.GOOD))

    def _write_distance(self, pen: ImageDraw.ImageDraw, k: int, end: tuple[float, float]) -> None:
        words, ink = f"{self._scene.clearance[k] * 1e3:.1f} mm", palette.css(palette.CLOSEST)
        inset, away = self._at(4), self._at(_TAG_DISTANCE)
        needs = away + pen.textlength(words, self._text_font) + 2 * inset
        side = 1 if end[0] + needs < self._width else -1  # beside the contact, inside the picture
        at = (end[0] + side * away, end[1] - away)
        anchor = "lm" if side > 0 else "rm"
        box = pen.textbbox(at, words, self._text_font, anchor=anchor)
        around = (box[0] - inset, box[1] - inset, box[2] + inset, box[3] + inset)
        pen.line((*end, *at), ink, self._at(1.3))
        pen.rounded_rectangle(around, inset, "white")
        pen.text(at, words, ink, self._text_font, anchor=anchor)

    def _font(self, name: str, size: float) -> ImageFont.FreeTypeFont:
        return ImageFont.truetype(str(_font_folder() / name), self._at(size))

    def _at(self, length: float) -> int:
        """Return a length of a picture 1280 pixels wide in pixels of this one, one at least."""
        return max(1, round(length * self._unit))


def _font_folder() -> Path:
    """Return the folder of the fonts that matplotlib brings, without importing all of it."""
    spec = find_spec("matplotlib")
    folder = Path(spec.origin).with_name("mpl-data") if spec and spec.origin else None
    if folder is None or not folder.is_dir():  # a distribution may keep data elsewhere
        from matplotlib import get_data_path

        folder = Path(get_data_path())
    return folder / "fonts" / "ttf"
