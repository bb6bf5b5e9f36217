"""``densarm bench``: what each benchmark prints, writes and keeps."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from densarm.scene.loading import MotionProblem
from densarm.simulation.run import Run
from densarm.study.problems import ProblemResult
from densarm.study.step import FirstCall

Command = Callable[..., Any]
GOAL = [np.cos(0.5), np.sin(0.5)]  # of the shoulder


@pytest.mark.parametrize(("arm", "pairs"), [("two_link", 4), ("panda", 20)])
def test_step_reports_its_keys(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arm: str, pairs: int
) -> None:
    first = FirstCall(9.0, 300.0), FirstCall(0.4, 200.0)
    monkeypatch.setattr("densarm.study.step.time_first_calls", lambda *_: first)
    path = tmp_path / "step.json"
    done = command("bench", "step", "--arm", arm, "--pairs", pairs, "--steps", 250, "--json", path)
    assert done.status == 0
    assert done.err == ""
    data = json.loads(path.read_text(encoding="utf-8"))
    assert list(data)[:5] == ["step_us", "bare_us", "ratio", "pairs", "steps"]
    assert (data["pairs"], data["steps"]) == (pairs, 250)
    for key in ("step_percentiles_us", "bare_percentiles_us", "undisturbed_percentiles_us"):
        assert 0.0 < data[key][0] <= data[key][1] <= data[key][2]
    assert min(data["step_us"], data["bare_us"], data["resumed_us"]) > 0.0
    assert min(data["memory_growth_kb"], data["collections"], data["switches"]) >= 0
    steady = data["steady_percentiles_us"]
    assert steady is None or 0.0 < steady[0] <= steady[1] <= steady[2]
    assert data["ratio"] == pytest.approx(data["step_us"] / data["bare_us"])
    assert f"{data['ratio']:.2f}" in done.out
    assert data["first_calls"]["loaded"] == {"preparation_s": 0.4, "torque_us": 200.0}
    assert "300 µs, all pairs queried; 9.00 s before it, kernels compiled" in done.out


RANDOM = ("bench", "random", "--arm", "two_link", "--problems", 1, "--scenes", "none")


@pytest.mark.slow
def test_random_problems_are_counted_and_written(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "random.json"
    done = command(*RANDOM, "--guide", "both", "--time-optimal", "--json", path)
    assert (done.status, done.err) == (0, "")
    data = json.loads(path.read_text(encoding="utf-8"))
    assert (data["reached"], data["certified"], data["total"]) == (1, 1, 1)
    assert data["direct"]["total"] == 1
    assert data["optimal_ratio"][0] > 1.0
    assert f"{data['optimal_ratio'][0]:.2f}" in done.out
    rows = [line.split()[:2] for line in done.out.splitlines()]
    assert ["empty", "1"] in rows
    assert ["all", "1"] in rows


def test_problems_that_were_not_solved_are_named(
    command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(problem: MotionProblem, **_: object) -> ProblemResult:
        return ProblemResult("empty", problem.index, "no_path", "walls all round")

    monkeypatch.setattr("densarm.study.problems.run_problem", run)
    done = command(*RANDOM)
    assert done.status == 0
    assert "empty 0 no_path: walls all round" in done.out
    assert ["all", "0", "0", "0", "0", "1"] in [line.split()[:6] for line in done.out.splitlines()]


def test_scenes_that_do_not_exist(command: Command) -> None:
    done = command("bench", "random", "--scenes", "fog")
    assert done.status == 2
    assert "shelf" in done.err


@pytest.fixture
def collection(tmp_path: Path) -> Path:
    """One problem without obstacles, one whose start touches a ball."""
    ball = {"type": "sphere", "name": "ball", "radius": 0.1, "position": [0.0, 0.0, -1.0]}
    ends = {"index": 3, "start": [0.0, 0.0], "goal": [-0.3, 0.5]}
    data = {
        "metadata": {"robot": "two_link", "joints": ["elbow", "shoulder"]},
        "problems": [
            {"scene": "empty", "obstacles": [], **ends},
            {"scene": "ball", "obstacles": [ball], **ends},
        ],
    }
    path = tmp_path / "problems.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    return path


def test_collection_is_run_and_kept(
    command: Command, collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, runs = tmp_path / "results.json", tmp_path / "runs"
    arguments = ["--problems", collection, "--save-dir", runs, "--json", path]
    done = command("bench", "motionbenchmaker", *arguments)
    assert (done.status, done.err) == (0, "")
    data = json.loads(path.read_text(encoding="utf-8"))
    assert (data["reached"], data["certified"], data["total"]) == (1, 1, 2)
    assert [entry["outcome"] for entry in data["problems"]] == ["reached", "infeasible"]
    assert sorted(file.name for file in runs.iterdir()) == ["ball_3.npz", "empty_3.npz"]
    # The joints are those that the file names, in its order.
    goal = Run.load(runs / "empty_3.npz").task.goal
    assert goal is not None
    np.testing.assert_array_equal(goal[:2], GOAL)

    monkeypatch.setattr("densarm.study.problems.run_scenario", None)
    again = command("bench", "motionbenchmaker", *arguments)
    assert (again.status, again.out) == (0, done.out)


def test_poses_may_be_the_goals(
    command: Command, collection: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = tmp_path / "runs"
    arguments = ["bench", "motionbenchmaker", "--problems", collection, "--save-dir", runs]
    done = command(*arguments, "--goals", "pose")
    assert (done.status, done.err) == (0, "")
    run = Run.load(runs / "empty_3.npz")
    assert run.outcome == "reached"
    pose, reached = run.task.settings["goals"][0], run.task.arm.pose(run.q[-1])
    np.testing.assert_allclose(reached.position, pose["position"], atol=0.01)
    monkeypatch.setattr("densarm.study.problems.run_scenario", None)
    assert command(*arguments, "--goals", "pose").out == done.out
    assert "another problem" in command(*arguments).out


def test_record_of_another_problem_is_not_taken(
    command: Command, collection: Path, tmp_path: Path
) -> None:
    runs = tmp_path / "runs"
    arguments = ["bench", "motionbenchmaker", "--problems", collection, "--save-dir", runs]
    command(*arguments, "--guide", "direct")
    done = command(*arguments)
    assert done.status == 0
    assert "empty 3 failed" in done.out
    assert "another problem" in done.out


def test_one_of_so_many(command: Command, collection: Path) -> None:
    done = command("bench", "motionbenchmaker", "--problems", collection, "--every", 2)
    assert "empty" in done.out
    assert "ball" not in done.out


def test_robot_of_other_joints(command: Command, collection: Path) -> None:
    collection.write_text(collection.read_text().replace("elbow", "wrist"), encoding="utf-8")
    done = command("bench", "motionbenchmaker", "--problems", collection)
    assert done.status == 2
    assert "wrist" in done.err
    assert len(done.err.splitlines()) == 1


@pytest.mark.slow
def test_moving_reports_its_keys(command: Command, tmp_path: Path) -> None:
    path, methods = tmp_path / "moving.json", "density,stop_and_go"
    done = command("bench", "moving", "--trials", 2, "--methods", methods, "--json", path)
    assert (done.status, done.err) == (0, "")
    told = json.loads(path.read_text(encoding="utf-8"))["methods"]
    assert list(told) == methods.split(",")
    for found in told.values():
        assert list(found) == ["trials", "contacts", "reached", "moving_contacts", "step_us"]
        assert found["trials"] == 2
        assert found["contacts"] + found["reached"] <= 2
        assert found["step_us"] > 0.0
    assert told["density"]["contacts"] == 0


def test_moving_refuses_an_unknown_method(command: Command) -> None:
    done = command("bench", "moving", "--methods", "hope")
    assert done.status == 2
    assert done.err.count("\n") == 1
    assert "density" in done.err


def test_inverse_kinematics_reports_its_keys(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "ik.json"
    done = command("bench", "ik", "two_link", "swing_up", "--poses", 4, "--json", path)
    assert (done.status, done.err) == (0, "")
    results = json.loads(path.read_text(encoding="utf-8"))["results"]
    assert [result["asked"] for result in results][:2] == ["position", "free about x"]
    assert all(result["found"] == result["total"] == 4 for result in results)
    assert all(0.0 < result["median_ms"] <= result["longest_ms"] for result in results)
    assert "swing_up" in done.out
    refused = command("bench", "ik", "pandda")
    assert refused.status == 2
    assert "did you mean 'panda'?" in refused.err
