"""Contacts over speed are drawn, with intervals that hold the share."""

import json
import runpy
from pathlib import Path

import pytest

SCRIPT = runpy.run_path(str(Path(__file__).parents[2] / "benchmarks" / "moving_figure.py"))


@pytest.mark.parametrize(
    ("count", "total", "low", "high"), [(0, 200, 0.0, 0.0188), (2, 16, 0.0350, 0.3602)]
)
def test_intervals_are_wilsons(count: int, total: int, low: float, high: float) -> None:
    assert SCRIPT["wilson"](count, total) == pytest.approx((low, high), abs=1e-4)


def test_cells_are_drawn(tmp_path: Path) -> None:
    files = []
    for speed in (1.0, 0.5):
        cell = {"arm": "panda", "obstacles": 4, "speed": speed, "resting": False, "estimated": True}
        methods = {name: {"contacts": 1, "trials": 20} for name in ("density", "mink")}
        files.append(tmp_path / f"{speed}.json")
        files[-1].write_text(json.dumps({"cell": cell, "methods": methods}), encoding="utf-8")
    SCRIPT["main"]([*map(str, files), "--figure", str(tmp_path / "moving.png")])
    assert (tmp_path / "moving.png").stat().st_size > 5000
