"""Both pipelines solve an easy problem, and contacts are counted."""

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return runpy.run_path(str(BENCHMARKS / "planners.py"))


PROBLEM = {
    "scene": "box",
    "index": 1,
    "start": [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785],
    "goal": [0.4, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785],
    "obstacles": [
        {
            "name": "block",
            "type": "box",
            "size": [0.1, 0.1, 0.1],
            "position": [-0.6, 0.0, 0.1],
            "orientation_xyzw": [0.0, 0.0, 0.0, 1.0],
        }
    ],
}
METADATA = {
    "robot": "panda",
    "joints": [f"panda_joint{k}" for k in range(1, 8)],
    "locked_joints": {"panda_finger_joint1": 0.04, "panda_finger_joint2": 0.04},
}


def test_both_pipelines_solve_an_easy_problem(
    script: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, kept = tmp_path / "problems.json", tmp_path / "planners.json"
    file.write_text(json.dumps({"metadata": METADATA, "problems": [PROBLEM]}))
    script["main"](["--problems", str(file), "--json", str(kept)])
    found = json.loads(kept.read_text())
    assert [s["reached"] for s in found["summaries"].values()] == [1, 1]
    assert found["ratios"]["duration_s"] > 0.0
    assert "computed torque" in capsys.readouterr().out


def test_contacts_are_counted(script: Any) -> None:
    runs = [
        {"outcome": o, "preparation_time_s": 1.0, "duration_s": 2.0, "min_clearance_m": c}
        for o, c in (("reached", 0.01), ("collided", -0.001), ("reached", 0.03))
    ]
    found = script["summary"](runs)
    assert (found["reached"], found["contacts"]) == (2, 1)
    assert found["min_clearance_m"][1] == pytest.approx(0.02)
    assert found["smallest_clearance_m"] == -0.001
