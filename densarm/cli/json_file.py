"""JSON results, written whole or not at all."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from densarm.atomic_file import atomic_file


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write JSON data to a file.

    Args:
        path: the file.
        data: without infinities and NaN.

    Raises:
        FileContentError: the file cannot be written.
    """
    text = json.dumps(data, indent=2, allow_nan=False)
    with atomic_file(path) as file:
        file.write(f"{text}\n".encode())
