"""``densarm view`` and ``densarm verify``: what is shown and proved of a recorded run."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.scenarios.scenario import Scenario
from densarm.simulation.run import Run

Command = Callable[..., Any]
CHECKS = ["swept", "start", "goal", "limits", "replay", "stopping", "tube"]


def altered(saved: Path, path: Path, **changes: Callable[..., Any]) -> Path:
    """Copy the run with some of its arrays changed."""
    with np.load(saved, allow_pickle=False) as data:
        arrays = {name: data[name] for name in data}
    np.savez(path, **{**arrays, **{key: change(arrays[key]) for key, change in changes.items()}})
    return path


def test_run_is_certified(command: Command, saved: Path, tmp_path: Path) -> None:
    done = command("verify", saved, "--json", tmp_path / "verify.json")
    assert done.status == 0
    assert done.err == ""
    assert all(f"{name} " in done.out for name in CHECKS)
    data = json.loads((tmp_path / "verify.json").read_text(encoding="utf-8"))
    assert data["certified"] is True
    assert [check["name"] for check in data["checks"]] == CHECKS
    assert all(check["holds"] and check["detail"] for check in data["checks"])
    energy, rantzer = data["recorded"]["energy"], data["recorded"]["rantzer"]
    assert energy["verdict"] == "not applicable"
    assert f"energy          not applicable: {energy['detail']}" in done.out
    assert 0.0 <= rantzer["share"] <= 1.0
    assert f"holds at {rantzer['share']:.0%} of {rantzer['samples']} samples" in done.out


@pytest.mark.parametrize(
    ("changes", "name"),
    [({"tau": lambda tau: tau + 1e-3}, "replay"), ({"q": lambda q: q[:, [0, 1, 0, 1]]}, "swept")],
)
def test_altered_run_is_not_certified(
    command: Command, saved: Path, tmp_path: Path, changes: dict[str, Any], name: str
) -> None:
    path = altered(saved, tmp_path / "altered.npz", **changes)
    done = command("verify", path, "--json", tmp_path / "verify.json")
    assert done.status == 1
    assert done.err == ""
    data = json.loads((tmp_path / "verify.json").read_text(encoding="utf-8"))
    assert data["certified"] is False
    assert name in [check["name"] for check in data["checks"] if not check["holds"]]


def test_run_of_wrong_shape_is_refused(command: Command, saved: Path, tmp_path: Path) -> None:
    path = altered(saved, tmp_path / "altered.npz", v=lambda v: v[:-1])
    done = command("verify", path)
    assert done.status == 2
    assert "v has shape" in done.err


def test_view_shows_the_run_and_tells_the_address(
    command: Command, saved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[Run] = []

    def view(run: Run, on_url: Callable[[str], object]) -> None:
        shown.append(run)
        on_url("http://127.0.0.1:7000/")

    monkeypatch.setattr("densarm.visualization.html_page.view", view)
    done = command("view", saved)
    assert done.status == 0
    assert "http://127.0.0.1:7000/" in done.out
    run = Run.load(saved)
    assert (shown[0].q == run.q).all()


@pytest.mark.slow
def test_with_options_it_writes_files_and_ends(
    command: Command, saved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("densarm.visualization.html_page.view", pytest.fail)
    monkeypatch.setattr("densarm.visualization.picture._ANIMATION_SIZE", (96, 54))
    monkeypatch.setattr("densarm.visualization.picture._STILL_SIZE", (96, 54))
    options = {"html": b"<!DOCTYPE", "png": b"\x89PNG", "gif": b"GIF"}
    arguments = [word for key in options for word in (f"--{key}", tmp_path / f"run.{key}")]
    done = command("view", saved, *arguments)
    assert (done.status, done.out, done.err) == (0, "", "")
    for key, begins in options.items():
        assert (tmp_path / f"run.{key}").read_bytes().startswith(begins)
    assert len(list(tmp_path.iterdir())) == len(options)


def test_a_run_without_a_goal_is_not_certified_and_says_why(
    command: Command, swing_up_run: Run, tmp_path: Path
) -> None:
    task = replace(swing_up_run.task, goal=None)
    replace(swing_up_run, task=task).save(tmp_path / "run.npz")
    done = command("verify", tmp_path / "run.npz", "--json", tmp_path / "verify.json")
    assert (done.status, done.err) == (1, "")
    assert "no goal was given" in done.out
    data = json.loads((tmp_path / "verify.json").read_text(encoding="utf-8"))
    assert [check["name"] for check in data["checks"] if not check["holds"]] == ["goal"]
    assert data["recorded"]["energy"]["verdict"] == "not applicable"
    assert data["recorded"]["rantzer"]["share"] is None


OLD = Path(__file__).parents[1] / "data" / "run_of_version_0_1.npz"


def test_a_run_of_version_0_1_is_proved_and_shown_as_it_was_then(
    command: Command, tmp_path: Path
) -> None:
    done = command("verify", OLD, "--json", tmp_path / "verify.json")
    assert (done.status, done.err) == (0, "")
    data = json.loads((tmp_path / "verify.json").read_text(encoding="utf-8"))
    assert [check["name"] for check in data["checks"]] == CHECKS[:-1]
    assert data["certified"] is True
    recorded = data["recorded"]
    assert recorded["energy"]["detail"].startswith("limits or the speed law shaped the torque at 1")
    assert (recorded["rantzer"]["samples"], recorded["rantzer"]["share"]) == (6, 1.0)
    assert command("view", OLD, "--html", tmp_path / "run.html").status == 0


def test_a_run_of_version_0_1_keeps_all_that_it_was_made_with() -> None:
    run = Run.load(OLD)
    assert (run.outcome, run.task.name, run.task.margin) == ("reached", "old", 0.01)
    scenario = Scenario.of_task(run.task)
    assert (scenario.seed, scenario.control.form, scenario.control.guide) == (
        7,
        "regulation",
        "direct",
    )
    assert (scenario.law_gains.position, scenario.law_gains.velocity) == (100.0, 25.0)
    assert (scenario.control.kappa, scenario.speed.braking_share) == (2.0, 0.9)
    assert [body.name for body in scenario.scene] == ["crate", "ball"]
    assert run.task.simulation.control_divisor == 2
    again = Run.load(OLD).task.to_json()
    assert (again["format"], again["seed"]) == (2, 7)
