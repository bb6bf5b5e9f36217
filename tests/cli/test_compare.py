"""``densarm compare``: its table, plot and JSON, and wrong input."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from densarm.study.baselines import BASELINES

Command = Callable[..., Any]
UNTUNED = ("--tuning-starts", 0)


@pytest.mark.slow
def test_table_plot_and_json(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    path, plot = tmp_path / "compare.json", tmp_path / "compare.png"
    options = ["--starts", 2, "--seed", 4, "--tuning-starts", 1, "--json", path, "--plot", plot]
    options += ["--budget", 2, "--push", 0.5]
    coarse = scenario_file(rest="[simulation]\ndt = 0.005")
    done = command("compare", coarse, "--methods", "density_direct,cbf_qp", *options)
    assert done.status == 0
    assert done.err == ""
    data = json.loads(path.read_text(encoding="utf-8"))
    assert (data["starts"], data["seed"], data["tuning_starts"], data["budget"]) == (2, 4, 1, 2)
    assert [entry["method"] for entry in data["methods"]] == ["density_direct", "cbf_qp"] * 2
    assert [entry["condition"]["push"] for entry in data["methods"]] == [0.0, 0.0, 0.5, 0.5]
    assert all(entry["reached"] >= 1 for entry in data["methods"])
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert "2 starts, seed 4: undisturbed" in done.out
    assert "2 starts, seed 4: push 0.5 rad/s" in done.out
    assert done.out.count("density_direct against cbf_qp: better in ") == 2
    assert "Tuned on 1 other starts, 2 values each:" in done.out
    assert f"sensing distance {data['methods'][0]['value']:.3g} m" in done.out
    assert max(len(line.rstrip()) for line in done.out.splitlines()) <= 80
    words = done.out.replace("*", "").splitlines()
    lines = [line for line in words if line.startswith(("density_direct  ", "cbf_qp  "))]
    for entry, row in zip(data["methods"], map(str.split, lines), strict=True):
        assert row[:2] == [entry["method"], str(entry["reached"])]
        assert row[5] == f"{entry['time_s']:.2f}"
        assert row[-1] == f"{entry['step_us']:.0f}"


def test_status_is_zero_whatever_was_reached(command: Command) -> None:
    done = command("compare", "swing_up", "--methods", "potential_field", "--starts", 1, *UNTUNED)
    assert done.status == 0
    row = next(line for line in done.out.splitlines() if "potential_field" in line)
    assert row.split()[1:5] == ["0*", "0*", "1", "0"]
    assert "No parameter was tuned:" in done.out


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--methods", "density,rrt"], ["'rrt'", "cbf_qp", "plan_then_track"]),
        (["--methods", ""], ["unknown method ''"]),
        (["--starts", "0"], ["--starts"]),
        (["--seed", "-1"], ["--seed"]),
        (["--tuning-starts", "-1"], ["--tuning-starts"]),
        (["--budget", "0"], ["--budget"]),
        (["--push", "0"], ["--push", "0.0<x"]),
        (["--payload", "-1"], ["--payload", "0.0<x"]),
        (["--moving", "nan"], ["moving = nan"]),
        (["--moving", "fast"], ["--moving", "'fast'"]),
        (["--plot", "compare.gif"], ["--plot", ".png"]),
    ],
)
def test_wrong_input_is_one_line(command: Command, options: list[str], expected: list[str]) -> None:
    done = command("compare", "swing_up", *options)
    assert done.status == 2
    assert done.out == ""
    assert done.err.count("\n") == 1
    assert all(part in done.err for part in expected), done.err


def test_help_names_every_baseline(command: Command) -> None:
    words = command("compare", "--help").out.replace(",", " ").split()
    assert set(BASELINES) <= set(words)
