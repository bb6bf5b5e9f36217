"""FigureReport: what the script of a published figure writes beside its pictures."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from densarm.atomic_file import atomic_file

RESULT_FILE = "result.json"


@dataclass(frozen=True)
class FigureReport:
    """A figure's claim, whether it holds, and the numbers that tell so."""

    figure: str
    """Which figure, e.g. "Fig. 3"."""
    claim: str
    """The claim, in a sentence."""
    holds: bool
    """Whether the numbers bear the claim out."""
    numbers: dict[str, Any]
    """The numbers, by name with their unit; JSON values."""

    def write(self, folder: Path) -> None:
        """Write result.json into an existing folder and print the verdict.

        Raises:
            FileContentError: the file cannot be written.
        """
        text = json.dumps(asdict(self), indent=2, ensure_ascii=False)
        with atomic_file(folder / RESULT_FILE) as file:
            file.write((text + "\n").encode())
        verdict = "holds" if self.holds else "does not hold"
        print(f"{self.figure}: {self.claim}\n  {verdict}; see {folder / RESULT_FILE}")  # noqa: T201


@dataclass(frozen=True)
class FigureArguments:
    """Arguments of the script of a figure."""

    out: Path
    """Folder of its pictures and result.json; it exists."""
    starts: int
    """Number of starts or runs."""


def figure_arguments(
    description: str, starts: int, arguments: Sequence[str] | None = None
) -> FigureArguments:
    """Read the arguments of a figure's script and make its output folder.

    Args:
        description: what the script shows.
        starts: default number of starts.
        arguments: in place of the command line's.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="output folder")
    parser.add_argument("--starts", type=int, default=starts, help="starts (default %(default)s)")
    parsed = parser.parse_args(arguments)
    parsed.out.mkdir(parents=True, exist_ok=True)
    return FigureArguments(parsed.out, parsed.starts)
