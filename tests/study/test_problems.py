"""Problems by the dozen: the same for the same seed, and no run is lost."""

import json
from pathlib import Path

import pytest

from densarm.errors import InvalidValueError
from densarm.scenarios.scenario import Scenario
from densarm.scene.loading import MotionProblem
from densarm.scene.obstacles import Sphere
from densarm.scene.scene import Scene
from densarm.simulation.run import Run
from densarm.study.problems import (
    MEASURES,
    ProblemResult,
    ProblemResults,
    run_problems,
    scenario_of,
)
from densarm.study.random_problems import random_problems
from densarm.values.outcome import FAILED, RUN_ENDS


@pytest.mark.slow
def test_several_processes_give_what_one_does() -> None:
    """In a scene in which each start touches one more of the balls, so that nothing has to run."""
    balls = [Sphere(name=f"ball{k}", radius=0.1, position=(0.0, 0.0, -0.5 * k)) for k in range(3)]
    joints = ("shoulder", "elbow")
    problems = [
        MotionProblem("two_link", "balls", k, joints, (0.0, 0.0), (3.0, 0.0), {}, Scene(balls[:k]))
        for k in (1, 2, 3)
    ]
    one, two = run_problems(problems), run_problems(problems, jobs=2)
    assert one == two
    assert [result.index for result in two.results] == [1, 2, 3]
    assert one.count("infeasible") == 3
    assert len({result.detail for result in two.results}) == 3


def test_figures_of_runs() -> None:
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


def test_problems_of_disturbed_arms_in_mujoco(tmp_path: Path) -> None:
    problems, draw = random_problems("two_link", 2, 0, "none"), {"mass_scale": 0.1, "coulomb": 0.2}
    noise = {"encoder_noise": 1e-5}
    results = run_problems(problems, save_dir=tmp_path, plant="mujoco", disturb=noise, draw=draw)
    told = [result.disturbances for result in results.results]
    assert {result.plant for result in results.results} == {"mujoco"}
    assert told[0] != told[1]
    for one in told:
        assert one["encoder_noise"] == 1e-5
        assert all(0.9 < x < 1.1 for x in one["mass_scale"])
        assert all(0.0 < x < 0.2 for x in one["coulomb"])
    told_again = run_problems(problems, save_dir=tmp_path, plant="mujoco", disturb=noise, draw=draw)
    assert told_again.figures() == results.figures()
    again = run_problems(problems[1:], plant="mujoco", disturb=noise, draw=draw)
    assert again.results[0].disturbances == told[1]
    assert again.results[0].duration_s == results.results[1].duration_s


def test_figures_of_a_set_are_of_its_own_problems() -> None:
    far, near = (
        ProblemResult(scene, 0, "reached", motion_s=motion, optimal_s=1.0, certified=True)
        for scene, motion in (("far", 3.0), ("near", 2.0))
    )
    results = ProblemResults((far, near))
    assert results.sets == ("far", "near")
    assert results.percentiles("optimal_ratio") == pytest.approx([2.5, 2.95, 2.98])
    assert results.of("near").percentiles("optimal_ratio") == [2.0, 2.0, 2.0]
    assert results.to_json()["sets"]["far"]["reached"] == 1


def test_a_run_that_fails_stops_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(scenario: Scenario) -> Run:
        raise ArithmeticError(scenario.name)

    monkeypatch.setattr("densarm.study.problems.run_scenario", fail)
    results = run_problems(random_problems("two_link", 2, 0, "none"))
    assert results.count(FAILED) == 2
    assert results.results[1].detail == "two_link_empty_1"
    assert (results.certified, results.min_clearance, results.percentiles("duration_s")) == (
        0,
        None,
        None,
    )


def test_limits_of_every_joint_may_be_others_than_the_arms() -> None:
    problems = random_problems("two_link", 1, 0, "none")
    limits = scenario_of(problems[0], acceleration=7.0, jerk=50.0).arm.limits
    assert (limits.acceleration.tolist(), limits.jerk.tolist()) == ([7.0, 7.0], [50.0, 50.0])
    slow = run_problems(problems, acceleration=1.0, jerk=20.0).results[0]
    assert slow.certified
    assert (slow.duration_s or 0.0) > (run_problems(problems).results[0].duration_s or 9.0)
    with pytest.raises(InvalidValueError, match=r"acceleration = -1.0: must be"):
        run_problems(problems, acceleration=-1.0)
