"""The command line in this process, and what the swing-up left, in a process of its own too."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from densarm.cli import main
from densarm.simulation.run import Run

PROGRAM = [sys.executable, "-c", "import sys; from densarm.cli import main; sys.exit(main())"]


@dataclass(frozen=True)
class Done:
    """What a command left behind."""

    status: int
    out: str
    err: str


Command = Callable[..., Done]


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    """Run the command line in this process."""

    def run(*arguments: object) -> Done:
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        return Done(status, *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def saved(swing_up_run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a certified run."""
    path = tmp_path_factory.mktemp("saved") / "swing_up.npz"
    swing_up_run.save(path)
    return path


@dataclass(frozen=True)
class Recorded:
    """The swing-up, as a process of its own ran it and wrote it."""

    done: Done
    npz: Path
    html: Path
    png: Path
    json: Path


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    folder = tmp_path_factory.mktemp("swing_up")
    npz, html, png, json = (folder / f"run.{kind}" for kind in ("npz", "html", "png", "json"))
    options: list[str | Path] = ["--save", npz, "--html", html, "--plot", png, "--json", json]
    done = subprocess.run(
        [*PROGRAM, "run", "swing_up", *options], capture_output=True, text=True, check=False
    )
    return Recorded(Done(done.returncode, done.stdout, done.stderr), npz, html, png, json)


@pytest.fixture
def scenario_file(tmp_path: Path) -> Callable[..., Path]:
    """Write a scenario of the two-link arm that changes a little from one that is right."""

    def write(
        robot: str = 'name = "two_link"',
        task: str = "start = [0.0, 0.0]\ngoal = [0.05, 0.0]",
        rest: str = "",
    ) -> Path:
        path = tmp_path / "scenario.toml"
        path.write_text(f"[robot]\n{robot}\n[task]\n{task}\n{rest}\n", encoding="utf-8")
        return path

    return write
