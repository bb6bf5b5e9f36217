"""Problems by the dozen: the same for the same seed, and no run is lost."""

import json

import pytest

from densarm.bench.problem import Problem
from densarm.bench.problem_result import ProblemResult
from densarm.bench.problem_results import MEASURES, ProblemResults, run_problems
from densarm.bench.random_problems import random_problems
from densarm.outcome import FAILED, RUN_ENDS
from densarm.scene import Scene, Sphere


def test_several_processes_give_what_one_does():
    """In a scene in which each start touches one more of the balls, so that nothing has to run."""
    balls = [Sphere(name=f"ball{k}", radius=0.1, position=[0.0, 0.0, -0.5 * k]) for k in range(3)]
    problems = [
        Problem("two_link", "balls", k, Scene(balls[:k]), (0.0, 0.0), (3.0, 0.0)) for k in (1, 2, 3)
    ]
    one, two = run_problems(problems), run_problems(problems, jobs=2)
    assert one == two
    assert [result.index for result in two.results] == [1, 2, 3]
    assert one.count("infeasible") == 3
    assert len({result.detail for result in two.results}) == 3


def test_figures_of_runs():
    results = run_problems(random_problems("two_link", 2, 0, "none"))
    assert (results.count("reached"), results.certified, results.total) == (2, 2, 2)
    data = json.loads(json.dumps(results.to_json(), allow_nan=False))
    assert (data["reached"], data["certified"], data["total"]) == (2, 2, 2)
    assert data["outcomes"] == {**dict.fromkeys(RUN_ENDS, 0), "reached": 2}
    assert {"scene", "index", "outcome", "certified"} <= set(data["problems"][0])
    assert data["duration_s"] == sorted(data["duration_s"])
    assert data["motion_s"][0] < data["duration_s"][0]
    assert data["optimal_ratio"] is None
    assert set(data["sets"]["empty"]) == set(data) - {"problems", "sets"}
    assert set(MEASURES) <= set(data)


def test_figures_of_a_set_are_of_its_own_problems():
    far, near = (
        ProblemResult(scene, 0, "reached", motion_s=motion, optimal_s=1.0, certified=True)
        for scene, motion in (("far", 3.0), ("near", 2.0))
    )
    results = ProblemResults((far, near))
    assert results.sets == ("far", "near")
    assert results.percentiles("optimal_ratio") == pytest.approx([2.5, 2.95, 2.98])
    assert results.of("near").percentiles("optimal_ratio") == [2.0, 2.0, 2.0]
    assert results.to_json()["sets"]["far"]["reached"] == 1


def test_a_run_that_fails_stops_no_other(monkeypatch):
    def fail(scenario):
        raise ArithmeticError(scenario.name)

    monkeypatch.setattr("densarm.bench.problem_results.simulate", fail)
    results = run_problems(random_problems("two_link", 2, 0, "none"))
    assert results.count(FAILED) == 2
    assert results.results[1].detail == "two_link_empty_1"
    assert (results.certified, results.min_clearance, results.percentiles("duration_s")) == (
        0,
        None,
        None,
    )
