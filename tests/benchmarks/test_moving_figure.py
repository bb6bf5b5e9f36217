"""Contacts over speed are drawn."""

import json
import runpy
from pathlib import Path

SCRIPT = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "moving_figure.py"))


def test_cells_are_drawn(tmp_path: Path) -> None:
    files = []
    for speed in (1.0, 0.5):
        cell = {"arm": "panda", "obstacles": 4, "speed": speed, "resting": False, "estimated": True}
        methods = {name: {"contacts": 1, "trials": 20} for name in ("density", "mink")}
        files.append(tmp_path / f"{speed}.json")
        files[-1].write_text(json.dumps({"cell": cell, "methods": methods}), encoding="utf-8")
    SCRIPT["main"]([*map(str, files), "--figure", str(tmp_path / "moving.png")])
    assert (tmp_path / "moving.png").stat().st_size > 5000
