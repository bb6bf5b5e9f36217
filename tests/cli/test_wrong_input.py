"""Wrong input: one line that says what is wrong and what is allowed, and nothing left behind."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Command = Callable[..., Any]
URDF = """<robot name="bare">
  <link name="base"/>
  <link name="rod"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
</robot>"""


def refused(done: Any, folder: Path, *expected: str) -> None:
    """Status 2, one line that says what is wrong, and nothing left behind but the inputs."""
    assert done.status == 2
    assert done.out == ""
    assert done.err.count("\n") == 1
    assert done.err.startswith("densarm: ")
    assert all(part in done.err for part in expected), done.err
    inputs = {"scenario.toml", "robot.urdf", "not_a_run.npz", "other.npz"}
    assert {path.name for path in folder.iterdir()} <= inputs


def sphere(**changes: object) -> str:
    values = {"type": '"sphere"', "name": '"ball"', "radius": 0.1, "position": [1.0, 0.0, 1.0]}
    given = {key: value for key, value in (values | changes).items() if value is not None}
    return "[[obstacles]]\n" + "\n".join(f"{key} = {value}" for key, value in given.items())


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"robot": 'name = "pandda"'}, ["'pandda'", "did you mean 'panda'", "two_link"]),
        ({"robot": ""}, ["robot", "name", "urdf"]),
        ({"robot": 'name = "two_link"\ncolour = 1'}, ["'colour'"]),
        ({"task": "start = [0.0]\ngoal = [0.0, 0.0]"}, ["start", "2", "1"]),
        ({"task": "start = [0.0, 0.0, 0.0]\ngoal = [0.0, 0.0]"}, ["start", "2", "3"]),
        ({"task": "start = [0.0, 0.0]\ngoal = [nan, 0.0]"}, ["goal", "finite"]),
        ({"task": "start = [0.0, 0.0]\ngoal = [inf, 0.0]"}, ["goal", "finite"]),
        ({"task": 'start = [0.0, 0.0]\ngoal = "upside"'}, ["'upside'", "upright", "hanging"]),
        ({"task": "start = [0.0, 0.0]"}, ["goal"]),
        ({"task": 'start = [0.0, "a"]\ngoal = [0.0, 0.0]'}, ["start"]),
        ({"rest": "[simulation]\ndt = -0.001"}, ["simulation.dt", "-0.001", "> 0"]),
        ({"rest": "[simulation]\ndt = nan"}, ["simulation.dt"]),
        ({"rest": "[simulation]\nstep = 0.1"}, ["'step'", "dt"]),
        ({"rest": '[simulation]\nintegrator = "euler"'}, ["simulation.integrator", "rk4"]),
        ({"rest": '[control]\nform = "pid"'}, ["control.form", "tracking"]),
        ({"rest": "[controls]"}, ["'controls'", "did you mean 'control'"]),
        ({"rest": sphere(radius=-0.1)}, ["ball.radius", "-0.1", "> 0"]),
        ({"rest": sphere(radius=0)}, ["ball.radius", "> 0"]),
        ({"rest": sphere(radius="nan")}, ["ball.radius"]),
        ({"rest": sphere(radius=None)}, ["ball", "radius"]),
        ({"rest": sphere(position=[0.0, 0.0])}, ["ball.position", "3", "2"]),
        ({"rest": sphere(position='["a", 0.0, 0.0]')}, ["ball.position"]),
        ({"rest": sphere(type='"donut"')}, ["'donut'", "sphere", "box"]),
        ({"rest": sphere(size=1.0)}, ["'size'"]),
        ({"rest": f"{sphere()}\n{sphere()}"}, ["ball"]),
        ({"rest": sphere(orientation_xyzw=[0.0, 0.0, 0.0, 0.0])}, ["ball.orientation_xyzw"]),
        ({"rest": "[task"}, ["TOML"]),
    ],
)
def test_scenario_file(
    command: Command,
    scenario_file: Callable[..., Path],
    tmp_path: Path,
    changes: dict[str, str],
    expected: list[str],
) -> None:
    path = scenario_file(**changes)
    done = command("run", path, "--save", tmp_path / "run.npz", "--json", tmp_path / "run.json")
    refused(done, tmp_path, str(path), *expected)


def test_robot_without_collision_geometry(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    (tmp_path / "robot.urdf").write_text(URDF, encoding="utf-8")
    path = scenario_file('urdf = "robot.urdf"', "start = [0.0]\ngoal = [0.5]")
    refused(command("run", path, "--save", tmp_path / "run.npz"), tmp_path, "'robot'", "collision")


def test_robot_file_that_is_not_there(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    path = scenario_file('urdf = "missing.urdf"')
    refused(command("run", path), tmp_path, str(tmp_path / "missing.urdf"), "No such file")


def test_scenario_that_is_not_there(command: Command, tmp_path: Path) -> None:
    refused(command("run", "swing"), tmp_path, "'swing'", "did you mean 'swing_up'", "panda_shelf")
    missing = tmp_path / "missing.toml"
    refused(command("run", missing), tmp_path, str(missing), "No such file")
    refused(command("run", tmp_path), tmp_path, str(tmp_path))


def test_outputs_are_checked_before_the_run(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("densarm.scenarios.run.run", pytest.fail)
    missing = tmp_path / "missing" / "run.npz"
    for option in ("--save", "--html", "--json", "--plot", "--png", "--gif"):
        done = command("run", "swing_up", option, missing)
        refused(done, tmp_path, option, str(missing), "does not exist")
        refused(command("run", "swing_up", option, tmp_path), tmp_path, option, "folder")
    refused(command("run", "swing_up", "--plot", tmp_path / "run.gif"), tmp_path, ".png")
    refused(command("run", "swing_up", "--png", tmp_path / "run.jpg"), tmp_path, ".png")
    refused(command("run", "swing_up", "--gif", tmp_path / "run.mp4"), tmp_path, ".gif")
    refused(command("view", "any.npz", "--gif", missing), tmp_path, "--gif", str(missing))
    refused(command("verify", "any.npz", "--json", missing), tmp_path, "--json", str(missing))
    refused(command("bench", "step", "--json", missing), tmp_path, "--json", str(missing))


@pytest.mark.parametrize("verb", ["verify", "view"])
def test_file_that_is_not_a_run(command: Command, tmp_path: Path, verb: str) -> None:
    (tmp_path / "not_a_run.npz").write_text("not a run", encoding="utf-8")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    options = ["--json", tmp_path / "verify.json"] if verb == "verify" else []
    for name in ("missing.npz", "not_a_run.npz", "other.npz", "."):
        path = tmp_path / name
        refused(command(verb, path, *options), tmp_path, str(path))


def test_arm_to_time(command: Command, tmp_path: Path) -> None:
    refused(command("bench", "step", "--arm", "atlas"), tmp_path, "'atlas'", "panda")
    refused(command("bench", "step", "--arm", "two_link", "--pairs", 3), tmp_path, "pairs = 3")


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("friction=1", "unknown key of [disturbances] 'friction'"),
        ("coulomb=-0.5", "disturbances.coulomb = -0.5: must be a finite number >= 0"),
        ("payload=heavy", "disturbances.payload = 'heavy'"),
        ("payload", "'payload': must be NAME=VALUE, as in payload=1"),
        ("viscous=[1, 2, 3]", "one per joint of 'two_link'"),
    ],
)
def test_disturbances(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path, option: str, expected: str
) -> None:
    refused(command("run", scenario_file(), "--disturb", option), tmp_path, expected)
    if option.startswith("friction"):
        done = command("run", scenario_file(), "--disturb", option)
        assert "armature" in done.err
        assert "viscous" in done.err


def test_mujoco_is_not_installed(
    command: Command,
    scenario_file: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    done = command("run", scenario_file(), "--plant", "mujoco")
    refused(done, tmp_path, "plant 'mujoco' needs MuJoCo", "pip install 'densarm[mujoco]'")
