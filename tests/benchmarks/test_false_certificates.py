"""Tampering that is sure to break a run is refused by the part it breaks, or counted."""

import runpy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from densarm.simulation.run import Run

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
KINDS = [
    "one torque changed",
    "sample skipped",
    "goal moved",
    "torque limit lowered",
    "obstacle enlarged",
    "row missing",
    "tube widened",
    "reference late",
    "one reference changed",
    "run outside its tube",
    "reference or tube damaged",
]


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return SimpleNamespace(**runpy.run_path(str(BENCHMARKS / "false_certificates.py")))


@pytest.mark.parametrize("name", KINDS)
def test_tampering_is_refused_by_the_part_it_breaks(
    script: Any, swing_up_run: Run, name: str
) -> None:
    tally = script.Tally()
    script.judge(name, [swing_up_run], 1, tally)
    assert (tally.runs, tally.refused, tally.as_meant) == (1, 1, 1)
    assert tally.false_certificates == []


def test_a_false_certificate_is_counted(
    script: Any, swing_up_run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tampering that leaves the run as it was passes, and that is seen."""
    harmless = replace(script.KINDS["goal moved"], tamper=lambda run, _: run)
    monkeypatch.setitem(script.KINDS, "harmless", harmless)
    tally = script.Tally()
    script.judge("harmless", [swing_up_run], 1, tally)
    assert (tally.runs, tally.refused) == (1, 0)
    assert tally.false_certificates == ["swing_up, seed 1"]
