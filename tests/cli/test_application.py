"""The command and its subcommands: helps, usage, the list, and what is not imported."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import pytest

from densarm.arms.catalogue import robot_names, robots_folder, scenario_paths
from densarm.cli.application import application
from densarm.cli.run import run
from densarm.planning.plan import GUIDES

Command = Callable[..., Any]


def paths(group: click.Group, before: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    found = []
    for name, command in group.commands.items():
        found.append((*before, name))
        if isinstance(command, click.Group):
            found += paths(command, (*before, name))
    return found


@pytest.mark.parametrize("path", [(), *paths(application())])
def test_every_help_explains_itself_with_an_example(
    command: Command, path: tuple[str, ...]
) -> None:
    done = command(*path, "--help")
    assert done.status == 0
    assert done.err == ""
    assert f"Usage: {' '.join(['densarm', *path])}" in done.out
    assert "Example" in done.out
    assert f"    densarm {' '.join(path)}" in done.out


@pytest.mark.parametrize("path", paths(application()))
def test_every_option_and_argument_is_explained(path: tuple[str, ...]) -> None:
    command: click.Command = application()
    for name in path:
        assert isinstance(command, click.Group)
        command = command.commands[name]
    options = [param for param in command.params if isinstance(param, click.Option)]
    assert all(option.help for option in options)


def test_without_arguments_it_prints_the_help(command: Command) -> None:
    assert command() == command("--help")


def test_list_names_robots_and_scenarios_with_what_they_hold(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("two_link", "panda"):
        shutil.copytree(robots_folder() / name, tmp_path / name)
    monkeypatch.setattr("densarm.arms.catalogue.robots_folder", lambda: tmp_path)
    done = command("list")
    assert (done.status, done.err) == (0, "")
    rows = {cells[0]: cells[1:] for line in done.out.splitlines() if (cells := line.split())}
    assert {*robot_names(), *scenario_paths()} <= set(rows)
    assert rows["two_link"] == ["2", "0", "1"]
    assert rows["swing_up"][:4] == ["two_link", "2", "0", "4"]
    assert rows["panda_table"][:4] == ["panda", "7", rows["panda"][1], "48"]
    assert "Swing a two-link arm from hanging to upright between two obstacles" in done.out


def test_help_starts_without_heavy_libraries() -> None:
    script = (
        "import json, sys; from densarm.cli import main; main(['--help']);"
        "print(json.dumps(list(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    heavy = {"numpy", "pinocchio", "rich", "pydantic", "numba", "matplotlib", "meshcat"}
    assert heavy & set(json.loads(done.stdout.splitlines()[-1])) == set()


@pytest.mark.slow
def test_a_run_starts_without_what_it_does_not_need(scenario_file: Callable[..., Path]) -> None:
    script = (
        f"import json, sys; from densarm.cli import main; main(['run', {str(scenario_file())!r}]);"
        "print(json.dumps(list(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    needless = {"matplotlib", "meshcat", "PIL", "rich"}
    assert needless & set(json.loads(done.stdout.splitlines()[-1])) == set()


def test_guides_to_choose_from_are_those_that_exist() -> None:
    guide = next(param for param in run.params if param.name == "guide")
    assert isinstance(guide.type, click.Choice)
    assert set(guide.type.choices) == set(GUIDES)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["frobnicate"], "No such command 'frobnicate'"),
        (["run"], "Missing argument 'SCENARIO'"),
        (["run", "swing_up", "extra"], "extra"),
        (["run", "swing_up", "--frob"], "--frob"),
        (["run", "swing_up", "--guide", "sideways"], "'sideways' is not one of 'auto', 'density',"),
        (["run", "swing_up", "--seed", "-1"], "--seed"),
        (["run", "swing_up", "--seed", "a"], "--seed"),
        (["bench"], "Missing command"),
        (["bench", "step", "--pairs", "0"], "--pairs"),
    ],
)
def test_wrong_usage_is_one_line(command: Command, arguments: list[str], expected: str) -> None:
    done = command(*arguments)
    assert done.status == 2
    assert done.out == ""
    assert done.err.count("\n") == 1
    assert expected in done.err
