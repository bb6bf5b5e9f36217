import json

import pytest

from densarm.bench.problem_results import ProblemResult


@pytest.mark.parametrize(("arm", "pairs"), [("two_link", 4), ("panda", 20)])
def test_step_reports_its_keys(command, tmp_path, arm, pairs):
    path = tmp_path / "step.json"
    done = command("bench", "step", "--arm", arm, "--pairs", pairs, "--json", path)
    assert done.status == 0
    assert done.err == ""
    data = json.loads(path.read_text(encoding="utf-8"))
    assert list(data) == ["step_us", "bare_us", "ratio", "pairs"]
    assert data["pairs"] == pairs
    assert data["step_us"] > data["bare_us"] > 0.0
    assert data["ratio"] == pytest.approx(data["step_us"] / data["bare_us"])
    assert f"{data['ratio']:.2f}" in done.out


def test_random_problems_are_counted_and_written(command, tmp_path):
    path = tmp_path / "random.json"
    done = command("bench", "random", "--arm", "two_link", "--problems", 1, "--json", path)
    assert (done.status, done.err) == (0, "")
    data = json.loads(path.read_text(encoding="utf-8"))
    assert (data["reached"], data["certified"], data["total"]) == (1, 1, 1)
    lines = {tuple(line.split()) for line in done.out.splitlines()}
    assert {("reached", "1", "of", "1"), ("certified", "1", "of", "1")} <= lines


def test_problems_that_were_not_solved_are_named(command, monkeypatch):
    monkeypatch.setattr(
        "densarm.bench.problem_results.run_problem",
        lambda problem: ProblemResult("empty", problem.index, "no_path", "walls all round"),
    )
    done = command("bench", "random", "--arm", "two_link", "--problems", 1)
    assert done.status == 0
    assert "empty 0 no_path: walls all round" in done.out
    assert "reached           0 of 1" in done.out
