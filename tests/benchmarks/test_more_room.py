"""Room is made beside a loop, and what that costs is told."""

import json
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Any]]:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    interval = sys.getswitchinterval()
    yield runpy.run_path(str(BENCHMARKS / "more_room.py"))
    sys.setswitchinterval(interval)


def test_making_and_swapping_are_timed(
    script: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "room.json"
    script["main"](["--pairs", "32", "--intervals", "0.001", "--rounds", "1", "--json", str(file)])
    (row,) = json.loads(file.read_text())["rows"]
    assert (row["pairs"], row["switch_interval_ms"]) == (32, 1.0)
    assert min(row[key]["median"] for key in script["KEYS"]) > 0.0
    assert "32 pairs, switch 1.0 ms" in capsys.readouterr().out
