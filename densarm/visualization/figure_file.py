"""Figures written to files, whole or not at all."""

from pathlib import Path

from matplotlib.figure import Figure

from densarm.atomic_file import atomic_file
from densarm.errors import InvalidValueError

FORMATS = ("png", "pdf", "svg")
"""Formats that `save_figure` writes, by the file's ending."""


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure to a file.

    Args:
        figure: what to write.
        path: the file, ending in .png, .pdf or .svg; its folder must exist.

    Raises:
        InvalidValueError: another ending.
        FileContentError: the file cannot be written.
    """
    path = Path(path)
    kind = path.suffix.removeprefix(".").lower()
    if kind not in FORMATS:
        raise InvalidValueError("plot", str(path), "a file ending in ." + ", .".join(FORMATS))
    with atomic_file(path) as file:
        figure.savefig(file, format=kind)
