"""``densarm plan``: the trajectory that it writes, what it proves of it, and what it refuses."""

import csv
import json
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import densarm
from densarm.scenarios.run import plan
from densarm.world.swept_check import SweptCheck

Command = Callable[..., Any]
BALL = '[[obstacles]]\ntype = "sphere"\nname = "ball"\nradius = 0.2\nposition = [{}, 0.0, -1.9]\n'


def test_both_files_are_the_planned_motion(command: Command, tmp_path: Path) -> None:
    table, trajectory = tmp_path / "plan.csv", tmp_path / "plan.json"
    done = command("plan", "swing_up", "--csv", table, "--json", trajectory, "--period", 0.02)
    assert (done.status, done.err) == (0, "")
    assert "planned: The motion is proved clear" in done.out
    assert "may be off by" in done.out
    scenario = densarm.load_scenario("swing_up")
    samples, joints = plan(scenario).samples(0.02), scenario.arm.joint_names
    with table.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    kinds = ("position", "velocity", "acceleration")
    assert header == ["time", *(f"{kind}_{joint}" for kind in kinds for joint in joints)]
    np.testing.assert_array_equal(np.array(rows, dtype=float), np.column_stack(samples))
    data = json.loads(trajectory.read_text(encoding="utf-8"))
    assert data["joint_names"] == list(joints)
    assert len(data["points"]) == len(rows)
    for k, point in enumerate(data["points"]):
        since = point.pop("time_from_start")
        assert 0 <= since["nsecs"] < 10**9
        assert since["secs"] + 1e-9 * since["nsecs"] == pytest.approx(samples.time[k], abs=1e-9)
        for kind, key in zip(kinds, ("positions", "velocities", "accelerations"), strict=True):
            np.testing.assert_array_equal(point[key], getattr(samples, kind)[k])
    assert set(data["points"][-1]["velocities"]) == {0.0}
    assert set(tmp_path.iterdir()) == {table, trajectory}


def test_straight_lines_between_samples_must_be_clear(command: Command, tmp_path: Path) -> None:
    """A period at which a robot that goes straight would touch something is refused."""
    scenario = densarm.load_scenario("swing_up")
    samples, check = plan(scenario).samples(3.0), SweptCheck(scenario.world)
    q = scenario.arm.configurations(samples.position)
    is_clear = all(check.segment_is_clear(a, b) for a, b in pairwise(q))
    done = command("plan", "swing_up", "--csv", tmp_path / "plan.csv", "--period", 3.0)
    assert not is_clear
    assert (done.status, done.out, done.err.count("\n")) == (2, "", 1)
    assert "period = 3.0: must be shorter: a straight line between" in done.err
    assert list(tmp_path.iterdir()) == []


def test_no_path_is_status_one_with_its_sentence(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    path = scenario_file(rest=BALL.format(0.0))
    done = command("plan", path, "--csv", folder / "plan.csv", "--json", folder / "plan.json")
    assert (done.status, done.err) == (1, "")
    assert f"infeasible: {densarm.Outcome.INFEASIBLE.description}\n" in done.out
    assert "start: lower_link_0 and ball overlap by" in done.out
    assert list(folder.iterdir()) == []


def test_what_is_not_checked_is_told(command: Command, scenario_file: Callable[..., Path]) -> None:
    table = 'type = "box"\nname = "table"\nsize = [2.0, 2.0, 0.1]\nposition = [0.0, 0.0, 0.0]'
    posture = "[0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]"
    task = f"start = {posture}\ngoal = {posture}"
    path = scenario_file('name = "panda"', task, f"[[obstacles]]\n{table}")
    done = command("plan", path)
    assert "not checked       'panda_link0_0' is in 'table' by " in done.out


def test_an_arm_at_its_goal_stays_there(
    command: Command, scenario_file: Callable[..., Path], tmp_path: Path
) -> None:
    path = scenario_file(task="start = [0.05, 0.0]\ngoal = [0.05, 0.0]")
    done = command("plan", path, "--csv", tmp_path / "plan.csv")
    assert done.status == 0
    rows = np.loadtxt(tmp_path / "plan.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 1:], [[0.05, 0.0, 0.0, 0.0, 0.0, 0.0]] * 2, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["swing"], "did you mean 'swing_up'"),
        (["swing_up_moving"], "'left', 'right': must stand"),
        (["swing_up", "--period", "0"], "period = 0.0: must be a finite number > 0"),
        (["swing_up", "--period", "nan"], "period = nan: must be a finite number > 0"),
        (["swing_up", "--period", "1e-9"], "for 10⁶ samples"),
        (["swing_up", "--goal", "{frame"], "not as in TOML"),
        (["swing_up", "--csv", "missing/plan.csv"], "the folder missing does not exist"),
        (["swing_up", "--json", "missing/plan.json"], "the folder missing does not exist"),
    ],
)
def test_wrong_input_is_one_line(command: Command, arguments: list[str], expected: str) -> None:
    done = command("plan", *arguments)
    assert (done.status, done.out, done.err.count("\n")) == (2, "", 1)
    assert expected in done.err
