"""Ctrl-C: status 130, one line, and no file half written."""

import os
import pty
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest

from densarm.simulation.plants import PinocchioPlant

Command = Callable[..., Any]

# A process started in the background inherits that Ctrl-C is ignored. A whole run takes a tenth of
# a second, which may pass between two drawings of the terminal: here planning and steps are slow.
PROGRAM = """
import signal, sys, time
from densarm.cli import main
from densarm.planning.path_guide import PathGuide
from densarm.simulation.plants import PinocchioPlant
plan, step = PathGuide.plan, PinocchioPlant.step
PathGuide.plan = lambda *problem: time.sleep(0.5) or plan(*problem)
PinocchioPlant.step = lambda *state: time.sleep(0.01) or step(*state)
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main())
"""


def interrupt(*_arguments: object, **_options: object) -> None:
    signal.raise_signal(signal.SIGINT)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads a pseudo-terminal as Linux has them")
def test_ctrl_c_on_a_terminal_while_running(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "run", "swing_up", "--save", tmp_path / "run.npz"],
        stdin=theirs,
        stdout=theirs,
        stderr=subprocess.PIPE,
        env={**os.environ, "TERM": "xterm"},
    )
    shown = b""
    while b"running" not in shown:
        shown += os.read(ours, 4096)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    os.close(theirs)
    os.close(ours)
    assert b"planning" in shown
    assert process.returncode == 130
    assert b"Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_running(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PinocchioPlant, "step", interrupt)
    done = command("run", "swing_up", "--save", tmp_path / "run.npz")
    assert done.status == 130
    assert done.out == ""
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_saving(
    command: Command,
    scenario_file: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def begin(file: BinaryIO, **_arrays: object) -> None:
        file.write(b"PK")
        interrupt()

    monkeypatch.setattr(np, "savez_compressed", begin)
    path = scenario_file()
    done = command("run", path, "--save", tmp_path / "run.npz", "--json", tmp_path / "run.json")
    assert done.status == 130
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "name", "writer"),
    [
        ("--html", "run.html", "densarm.visualization.html_page.draw"),
        ("--plot", "run.png", "matplotlib.figure.Figure.savefig"),
        ("--png", "run.png", "densarm.visualization.picture.Picture.frame"),
        ("--gif", "run.gif", "densarm.visualization.picture.Picture.frame"),
        ("--json", "run.json", "densarm.simulation.run.Run.summary"),
    ],
)
def test_ctrl_c_while_writing(
    command: Command,
    scenario_file: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    option: str,
    name: str,
    writer: str,
) -> None:
    monkeypatch.setattr(writer, interrupt)
    path = scenario_file()
    assert command("run", path, option, tmp_path / name).status == 130
    assert list(tmp_path.iterdir()) == [path]


def test_ctrl_c_ends_the_view(
    command: Command, saved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("webbrowser.open", bool)
    monkeypatch.setattr("densarm.visualization.html_page.PageServer.serve_forever", interrupt)
    assert command("view", saved).status == 130
