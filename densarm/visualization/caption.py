"""Caption: the words on a picture."""

from pathlib import Path

import numpy as np
from matplotlib import get_data_path
from PIL import Image, ImageDraw, ImageFont

from densarm.visualization import palette
from densarm.visualization.stage import Stage
from densarm.visualization.summary_line import SummaryLine

_FONTS = Path(get_data_path()) / "fonts" / "ttf"
_INSET = 24  # from the rim of a picture at a width of 1280 [pixels]
_TITLE_SIZE = 23  # likewise
_BAR = (150, 8)  # width and height of the colour scale at a width of 1280 [pixels]


class Caption:
    """Writes title, verdicts, legend and time on pictures of a stage.

    Args:
        stage: what they show.
        width: of the pictures [pixels].
        height: of the pictures [pixels].
    """

    def __init__(self, stage: Stage, width: int, height: int) -> None:
        self._stage, self._summary = stage, SummaryLine.of(stage.run)
        self._unit = max(width / 1280.0, 0.6)  # small pictures need larger words
        self._width, self._height = width, height
        title = self._font("DejaVuSans-Bold.ttf", _TITLE_SIZE)
        room = width - 2 * self._at(_INSET)
        share = min(1.0, room / max(title.getlength(self._summary.title), 1.0))
        self._title_font = self._font("DejaVuSans-Bold.ttf", share * _TITLE_SIZE)
        self._text_font = self._font("DejaVuSans.ttf", 16)

    def write(self, image: Image.Image, k: int, end: tuple[float, float] | None) -> None:
        """Write on the picture of frame k.

        Args:
            image: the picture.
            k: index of the frame.
            end: where the closest pair's line ends on it [pixels]; None without pairs.
        """
        pen = ImageDraw.Draw(image)
        left, top = self._at(_INSET), self._at(20)
        pen.text((left, top), self._summary.title, palette.css(palette.TEXT), self._title_font)
        self._write_verdicts(pen, left, top + self._at(38))
        if self._stage.path is not None and end is not None:
            self._write_scale(pen, left, self._height - self._at(54))
        self._write_time(pen, k)
        if end is not None:
            self._write_distance(pen, k, end)

    def _write_verdicts(self, pen: ImageDraw.ImageDraw, x: float, y: float) -> None:
        summary = self._summary
        colors = {True: palette.GOOD, False: palette.BAD}
        chips = [
            (summary.outcome, colors[summary.is_reached]),
            *((fact, palette.QUIET) for fact in summary.facts),
            (summary.certificate, colors[summary.is_certified]),
        ]
        for text, color in chips:
            ink = palette.TEXT if color == palette.QUIET else (1.0, 1.0, 1.0)
            x = self._write_chip(pen, x, y, text, color, ink) + self._at(8)

    def _write_chip(
        self, pen: ImageDraw.ImageDraw, x: float, y: float, text: str,
        fill: palette.Color, ink: palette.Color,
    ) -> float:  # fmt: skip
        """Write a word on a round field and return where the field ends."""
        height, inset = self._at(26), self._at(11)
        end = x + pen.textlength(text, self._text_font) + 2 * inset
        pen.rounded_rectangle((x, y, end, y + height), height / 2, palette.css(fill))
        middle = (x + inset, y + height / 2)
        pen.text(middle, text, palette.css(ink), self._text_font, anchor="lm")
        return end

    def _write_scale(self, pen: ImageDraw.ImageDraw, x: float, y: float) -> None:
        scale, (width, height) = self._stage.scale, (self._at(size) for size in _BAR)
        colors = scale.colors(np.linspace(0.0, scale.top, round(width)))
        for step, (red, green, blue) in enumerate(colors):
            color = palette.css((float(red), float(green), float(blue)))
            pen.line((x + step, y, x + step, y + height), color)
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
        time = self._stage.time
        words = f"t = {time[k]:.2f} s"
        at = (self._width - self._at(_INSET), self._height - self._at(40))
        pen.text(at, words, palette.css(palette.TEXT), self._text_font, anchor="rm")
        share = time[k] / time[-1] if time[-1] > 0.0 else 1.0
        bar = (0, self._height - self._at(5), self._width, self._height)
        pen.rectangle(bar, palette.css(palette.QUIET))
        pen.rectangle((*bar[:2], share * self._width, bar[3]), palette.css(palette.GOOD))

    def _write_distance(self, pen: ImageDraw.ImageDraw, k: int, end: tuple[float, float]) -> None:
        words = f"{self._stage.closest.distance[k] * 1e3:.1f} mm"
        at = (end[0] + self._at(12), end[1] - self._at(18))
        box = pen.textbbox(at, words, self._text_font, anchor="lm")
        inset = self._at(4)
        around = (box[0] - inset, box[1] - inset, box[2] + inset, box[3] + inset)
        pen.rounded_rectangle(around, inset, "white")
        pen.text(at, words, palette.css(palette.CLOSEST), self._text_font, anchor="lm")

    def _font(self, name: str, size: float) -> ImageFont.FreeTypeFont:
        return ImageFont.truetype(str(_FONTS / name), self._at(size))

    def _at(self, length: float) -> int:
        """Return a length of a picture 1280 pixels wide in pixels of this one."""
        return round(length * self._unit)
