"""A short run in real time tracks its goals, and what is kept of it is told."""

import json
import os
import runpy
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return runpy.run_path(str(BENCHMARKS / "long_run.py"))


def test_a_short_run_is_told(script, tmp_path, capsys):
    file = tmp_path / "long_run.json"
    script["main"](["--steps", "60", "--pairs", "16", "--json", str(file)])
    found = json.loads(file.read_text())
    assert found["steps"] == 60
    assert 0 <= found["missed"] <= 60
    assert max(found["largest_error_rad"]) < 1e-3
    assert "missed deadlines" in capsys.readouterr().out


def test_a_run_without_the_right_to_priority_says_so(script, monkeypatch):
    def refuse(*_arguments):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(SystemExit, match="not allowed"):
        script["main"](["--fifo", "--steps", "1"])


def test_late_steps_are_counted(script):
    steps = script["Steps"](10)
    for kept in (steps.elapsed, steps.processor, steps.lateness, steps.error):
        kept[:] = 1e-4
    steps.lateness[3:6] = steps.processor[3] = 2e-3
    found = script["report"](steps, script["Memory"](1.0, 2.0))
    assert (found["missed"], found["missed_by_own_work"]) == (3, 1)
    assert found["memory_mb"] == [1.0, 2.0]


def test_references_join(script):
    from densarm.arm import load_arm
    from densarm.bench.swing_among_spheres import swing

    motions = script["references"](swing(load_arm("panda")), 0)
    first, second = next(motions), next(motions)
    np.testing.assert_array_equal(first.position[-1], second.position[0])
    assert np.abs(first.position[-1] - first.position[0]).max() > 0.01
    assert not first.velocity[[0, -1]].any()
