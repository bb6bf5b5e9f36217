"""Random problems: solvable, the same for the same seed, however many are drawn."""

import numpy as np
import pytest

from densarm.bench import random_problems as drawing
from densarm.bench.random_problems import random_problems
from densarm.clearance import Clearance
from densarm.errors import DensarmError, InvalidValueError, UnknownNameError


def ends(problem):
    return problem.scenario().start, problem.scenario().goal


def test_problems_are_clear_and_more_of_them_begin_with_the_same():
    few, many = random_problems("two_link", 2, 3, "none"), random_problems("two_link", 4, 3, "none")
    assert few == many[:2]
    assert [problem.index for problem in many] == [0, 1, 2, 3]
    assert len({problem.start for problem in many} | {problem.goal for problem in many}) == 8
    assert (np.abs([problem.start for problem in many]) <= np.pi).all()


def test_scenes_take_turns_and_leave_the_ends_free():
    problems = random_problems("three_link", 4, 0)
    assert [problem.scene_name for problem in problems] == ["spheres", "boxes", "wall", "shelf"]
    for problem in problems:
        clearance = Clearance(problem.scenario().arm, problem.scene)
        assert len(problem.scene) >= 3
        assert all((clearance.distances(q) > 0.005).all() for q in ends(problem))


def test_what_no_search_solves_is_not_kept(monkeypatch):
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


def test_the_path_of_a_problem_that_is_kept_has_room(monkeypatch):
    """Nothing keeps ten times the reach, whatever is drawn."""
    monkeypatch.setattr(drawing, "_PATH_ROOM", 10.0)
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
def test_wrong_arguments(arguments, error):
    with pytest.raises(error):
        random_problems(*arguments)
