"""Pictures of runs as files: a still, or an animation."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image

from densarm.atomic_file import atomic_file
from densarm.errors import InvalidValueError
from densarm.trajectory import Trajectory
from densarm.visualization import palette
from densarm.visualization.picture import Picture
from densarm.visualization.stage import Stage

_STILL_SIZE = (1280, 720)  # [pixels]
_ANIMATION_SIZE = (800, 450)  # [pixels]
_PERIOD = 0.04  # of an animation's frames [s]; GIF counts in hundredths
_MOST_FRAMES = 150
_HOLD = 1.5  # for which the last frame stays [s]
_COLORS, _SCALE_COLORS = 256, 16  # of an animation, and of them for the clearance scale

_NEARLY_WHITE = 247


def save_picture(run: Trajectory, path: str | Path) -> None:
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
        stage = Stage(run)
        closest = stage.closest.distance
        k = int(np.argmin(closest)) if len(closest) else len(stage.time) // 2
        Picture(stage, *_STILL_SIZE).frame(k).save(file, format="PNG")


def save_animation(run: Trajectory, path: str | Path) -> None:
    """Write an animation of a run, in real time, that plays again and again.

    Args:
        run: what to show.
        path: the file, ending in .gif; its folder must exist.

    Raises:
        InvalidValueError: another ending.
        FileContentError: the file cannot be written.
    """
    with _picture_file(path, ".gif") as file:
        stage = Stage(run)
        duration = float(stage.time[-1])
        period = 0.01 * np.ceil(100.0 * max(_PERIOD, duration / _MOST_FRAMES) - 1e-9)
        rows = np.searchsorted(stage.time, np.arange(0.0, duration, period))
        picture = Picture(stage, *_ANIMATION_SIZE)
        images = [picture.frame(int(k)) for k in [*rows, len(stage.time) - 1]]
        colors = _palette(images[len(images) // 2], stage)
        frames = [image.quantize(palette=colors, dither=Image.Dither.NONE) for image in images]
        shown = [round(1e3 * period)] * len(rows) + [round(1e3 * _HOLD)]  # [ms]
        others = frames[1:]
        frames[0].save(
            file, format="GIF", save_all=True, append_images=others, duration=shown, loop=0
        )


def _palette(image: Image.Image, stage: Stage) -> Image.Image:
    """Return an image of the colours to draw in: those of a frame, and the clearance scale."""
    scale = stage.scale.colors(np.linspace(0.0, stage.scale.top, _SCALE_COLORS))
    swatches = np.round(255.0 * np.vstack([scale, palette.CLOSEST])).astype(np.uint8)
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
