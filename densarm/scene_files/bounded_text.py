"""The text of a scene file, of a size that a reader takes."""

from pathlib import Path

from densarm.errors import FileContentError
from densarm.robot_description import read_text

MAX_BYTES = 20_000_000
"""Size of the largest scene file that is read."""


def bounded_text(path: Path) -> str:
    """Return a scene file's content.

    Raises:
        FileContentError: there is no such file, it is not text, or it is too large.
    """
    try:
        size = path.stat().st_size
    except (OSError, ValueError):
        size = 0  # the reader says why
    if size > MAX_BYTES:
        raise FileContentError(path, f"larger than the {MAX_BYTES / 1e6:g} MB of a scene file")
    return read_text(path)
