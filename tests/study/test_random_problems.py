"""Random problems: solvable, the same for the same seed, however many are drawn."""

from typing import Any

import numpy as np
import pytest

from densarm.errors import DensarmError, InvalidValueError, UnknownNameError
from densarm.scene.loading import MotionProblem
from densarm.study import random_problems as drawing
from densarm.study.problems import run_problem, scenario_of
from densarm.study.random_problems import random_problems
from densarm.values.arrays import Array
from densarm.values.outcome import Outcome
from densarm.world.world import World


def ends(problem: MotionProblem) -> tuple[Array, Array]:
    return scenario_of(problem).start, scenario_of(problem).goal


def test_problems_are_clear_and_more_of_them_begin_with_the_same() -> None:
    few, many = random_problems("two_link", 2, 3, "none"), random_problems("two_link", 4, 3, "none")
    assert few == many[:2]
    assert [problem.index for problem in many] == [0, 1, 2, 3]
    assert len({problem.start for problem in many} | {problem.goal for problem in many}) == 8
    assert (np.abs([problem.start for problem in many]) <= np.pi).all()


def test_scenes_take_turns_and_leave_the_ends_free() -> None:
    problems = random_problems("three_link", 4, 0)
    assert [problem.scene_name for problem in problems] == ["spheres", "boxes", "wall", "shelf"]
    for problem in problems:
        world = World(scenario_of(problem).arm, problem.scene)
        assert len(problem.scene) >= 3
        assert all((world.distances(q) > 0.005).all() for q in ends(problem))


def test_what_no_search_solves_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here the third search says that there is a path."""
    answers = iter([False, False, True])
    monkeypatch.setattr(drawing, "_has_path", lambda *_: next(answers))
    kept = random_problems("two_link", 1, 0, "spheres")[0]
    monkeypatch.setattr(drawing, "_has_path", lambda *_: True)
    assert kept.scene != random_problems("two_link", 1, 0, "spheres")[0].scene
    monkeypatch.setattr(drawing, "_has_path", lambda *_: False)
    monkeypatch.setattr(drawing, "_SCENES", 3)
    with pytest.raises(DensarmError, match="no problem with a solution in 3 random scenes"):
        random_problems("two_link", 1, 0, "spheres")


def test_the_path_of_a_problem_that_is_kept_has_a_margin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing keeps ten times the reach, whatever is drawn."""
    monkeypatch.setattr(drawing, "_PATH_MARGIN", 10.0)
    monkeypatch.setattr(drawing, "_SCENES", 3)
    with pytest.raises(DensarmError, match="no problem with a solution in 3 random scenes"):
        random_problems("two_link", 1, 0, "spheres")


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("two_link", 0, 0), InvalidValueError),
        (("two_link", 1, -1), InvalidValueError),
        (("two_link", 1, 0, "fog"), InvalidValueError),
        (("one_link", 1, 0), UnknownNameError),
    ],
)
def test_wrong_arguments(arguments: tuple[Any, ...], error: type[DensarmError]) -> None:
    with pytest.raises(error):
        random_problems(*arguments)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed"), [("three_link", 2), ("xarm7", 1), ("z1", 1), ("ur5", 2), ("kinova", 1)]
)
def test_arms_go_between_random_configurations(name: str, seed: int) -> None:
    result = run_problem(random_problems(name, 1, seed, "none")[0])
    assert (result.outcome, result.certified) == (Outcome.REACHED, True), result.detail
