"""``densarm study``: what it prints and writes, and what it refuses."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Command = Callable[..., Any]


@pytest.mark.slow
def test_study_is_printed_kept_and_drawn(
    command: Command,
    scenario_file: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kept, plot = tmp_path / "study.npz", tmp_path / "study.png"
    asked = ("study", scenario_file(), "--starts", 2, "--disturb", "coulomb=0.01")
    options = ("--vary", "disturbances.payload=0:0.1", "--save", kept, "--plot", plot)
    done = command(*asked, *options)
    assert (done.status, done.err) == (0, "")
    assert "reached           2, 100.0 % [34.2, 100.0]" in done.out
    assert kept.is_file()
    assert plot.stat().st_size > 5000
    monkeypatch.setattr("densarm.study.monte_carlo.run", None)
    assert command(*asked, *options).out == done.out
    other = command(*asked, "--save", kept)
    assert other.status == 2
    assert 'vary {"disturbances.payload": [0.0, 0.1]} and not {}' in other.err


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--vary", "control.margin=1"), "must be KEY=LOW:HIGH"),
        (("--vary", "control.margn=0:1"), "did you mean 'control.margin'"),
        (("--jobs", 2, "--scheduler", "tcp://127.0.0.1:9"), "left out where there is a scheduler"),
        (("--scheduler", "nonsense"), "must be the address of a Dask scheduler"),
    ],
)
def test_wrong_input_is_refused_in_a_line(
    command: Command, options: tuple[object, ...], told: str
) -> None:
    done = command("study", "swing_up", *options)
    assert done.status == 2
    assert told in done.err
    assert done.err.count("\n") == 1
