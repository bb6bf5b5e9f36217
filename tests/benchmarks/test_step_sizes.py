"""Every size is measured, kept and drawn."""

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return runpy.run_path(str(BENCHMARKS / "step_sizes.py"))


@pytest.mark.slow
def test_sizes_are_measured_kept_and_drawn(
    script: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, picture = tmp_path / "sizes.json", tmp_path / "sizes.png"
    sizes = ["--shapes", "capsule", "--pairs", "8", "--steps", "200"]
    script["main"]([*sizes, "--json", str(file), "--figure", str(picture)])
    (row,) = json.loads(file.read_text())["rows"]
    assert (row["shapes"], row["pairs"]) == ("capsule", 8)
    assert row["step_percentiles_us"][0] <= row["step_percentiles_us"][2]
    assert picture.stat().st_size > 0
    assert "capsule" in capsys.readouterr().out
