"""A short run in real time tracks its goals, and what is kept of it is told."""

import json
import os
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return runpy.run_path(str(BENCHMARKS / "long_run.py"))


def test_a_short_run_is_told(
    script: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "long_run.json"
    script["main"](["--steps", "60", "--pairs", "16", "--json", str(file)])
    found = json.loads(file.read_text())
    assert found["steps"] == 60
    assert 0 <= found["missed"] <= 60
    assert max(found["largest_error_rad"]) < 1e-3
    assert "missed deadlines" in capsys.readouterr().out


def test_a_run_without_the_right_to_priority_says_so(
    script: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_arguments: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(SystemExit, match="not allowed"):
        script["main"](["--fifo", "--steps", "1"])


def test_late_steps_are_counted(script: Any) -> None:
    steps = script["Steps"](10)
    for kept in (steps.elapsed, steps.processor, steps.lateness, steps.error):
        kept[:] = 1e-4
    steps.lateness[3:6] = steps.processor[3] = 2e-3
    found = script["report"](steps, script["Memory"](1.0, 2.0))
    assert (found["missed"], found["missed_by_own_work"]) == (3, 1)
    assert found["memory_mb"] == [1.0, 2.0]


def test_motions_join_in_a_round(script: Any) -> None:
    from densarm.arms.arm import load_arm
    from densarm.study.step import swing

    motions = list(script["motions"](swing(load_arm("panda")), 0))
    first = motions[0]
    for one, next_one in zip(motions, [*motions[1:], first], strict=True):
        np.testing.assert_allclose(one.position[-1], next_one.position[0], atol=1e-15)
    assert np.abs(first.position[-1] - first.position[0]).max() > 0.01
    assert not first.velocity[[0, -1]].any()
