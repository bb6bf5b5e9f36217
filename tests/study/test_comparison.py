"""A comparison: the same starts for all, every run counted, failures recorded."""

import json
from dataclasses import replace

import numpy as np
import pytest

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.outcome import RUN_ENDS, Outcome
from densarm.scenario import load_scenario
from densarm.study.comparison import LIMIT_SHARE, MEASURES, SCALES, compare
from densarm.study.methods import MAIN_PARAMETERS, METHODS

NAMES = ("density_direct", "potential_field")


@pytest.fixture(scope="module")
def swing_up():
    return load_scenario("swing_up")


@pytest.fixture(scope="module")
def comparison(swing_up):
    return compare(swing_up, NAMES, starts=3, seed=4, tuning_starts=0)


def test_json_holds_counts_medians_and_runs(comparison):
    data = json.loads(json.dumps(comparison.to_json(), allow_nan=False))
    assert list(data) == [
        *("methods", "starts", "scenario", "seed", "tuning_starts", "limit_share"),
    ]
    assert (data["starts"], data["scenario"], data["seed"]) == (3, "swing_up", 4)
    assert [entry["method"] for entry in data["methods"]] == list(NAMES)
    for entry in data["methods"]:
        assert list(entry) == ["method", "parameter", "scale", *RUN_ENDS, *MEASURES, "runs"]
        assert sum(entry[outcome] for outcome in RUN_ENDS) == len(entry["runs"]) == 3
        reached = [run["time_s"] for run in entry["runs"] if run["outcome"] == "reached"]
        assert entry["time_s"] == pytest.approx(np.median(reached))
        assert all(run["step_us"] > 0.0 for run in entry["runs"])


def test_all_methods_start_alike_and_first_from_the_scenario(swing_up, comparison):
    first, second = ([run.start for run in result.runs] for result in comparison.methods)
    assert first == second
    assert len(set(first)) == 3
    np.testing.assert_allclose(first[0], swing_up.arm.angles(swing_up.start))


def test_measures_are_those_of_the_record(swing_up, comparison):
    run = comparison.methods[0].runs[-1]
    assert run.outcome == Outcome.REACHED
    straight = swing_up.arm.difference(swing_up.arm.configuration(run.start), swing_up.goal)
    assert np.linalg.norm(straight) - 0.01 < run.path_length_rad < 2.0 * np.linalg.norm(straight)
    assert 0.0 < run.min_clearance_m < 1.25
    assert 0.0 < run.effort < run.time_s * np.sum(swing_up.arm.limits.effort**2)


def test_a_run_that_raises_is_recorded(swing_up, monkeypatch):
    def raises(scenario, clearance, scale):
        if (scenario.start == swing_up.start).all():
            raise InvalidValueError("gain", 0.0, "positive")
        return METHODS["density_direct"](scenario, clearance, scale)

    monkeypatch.setattr("densarm.study.comparison.METHODS", {"odd": raises})
    result = compare(swing_up, ["odd"], starts=2, seed=4, tuning_starts=0).methods[0]
    assert result.runs[0].outcome == "failed"
    assert result.runs[0].detail == "gain = 0.0: must be positive"
    assert result.runs[1].outcome in list(Outcome)
    assert result.count("failed") == 1


def test_infeasible_for_all(swing_up):
    contact = swing_up.arm.configuration([1.2, 0.0])
    comparison = compare(replace(swing_up, start=contact), NAMES, starts=1, tuning_starts=0)
    for result in comparison.methods:
        assert result.count("infeasible") == 1
        assert result.median("time_s") is None
        assert result.median("step_us") is None


def test_a_method_given_twice_runs_once(swing_up):
    comparison = compare(swing_up, ["potential_field"] * 2, starts=1, tuning_starts=0)
    assert [result.method for result in comparison.methods] == ["potential_field"]


def test_progress_names_method_and_start(swing_up):
    told = []
    short = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=0.2))
    compare(short, ["potential_field"], 1, tuning_starts=1, on_progress=told.append)
    tuning = ["potential_field from tuning start 1 of 1"] * len(SCALES)
    assert told == [*tuning, "potential_field from start 1 of 1"]


@pytest.fixture
def runs_of_odd(monkeypatch):
    """Every (start, scale, scenario) that an odd method was run at, and which scale reaches."""
    seen = []

    def odd(scenario, clearance, scale):
        seen.append((scenario.start.tolist(), scale, scenario))
        if scale != SCALES[-1]:
            raise InvalidValueError("gain", 0.0, "positive")
        return METHODS["density_direct"](scenario, clearance)

    monkeypatch.setattr("densarm.study.comparison.METHODS", {"odd": odd})
    return seen


def test_tuning_takes_the_scale_that_reaches_on_other_starts(swing_up, runs_of_odd):
    result = compare(swing_up, ["odd"], starts=2, seed=4, tuning_starts=1).methods[0]
    assert result.scale == SCALES[-1]
    tuned, counted = runs_of_odd[: len(SCALES)], runs_of_odd[len(SCALES) :]
    assert [scale for _, scale, _ in tuned] == list(SCALES)
    assert [scale for _, scale, _ in counted] == [SCALES[-1]] * 2
    assert not any(start == tuned[0][0] for start, _, _ in counted)


def test_all_plan_with_the_same_share_of_the_limits(swing_up, runs_of_odd):
    compare(swing_up, ["odd"], starts=1, tuning_starts=0)
    scenario = runs_of_odd[0][2]
    assert {*vars(scenario.timing).values(), *vars(scenario.speed).values()} == {LIMIT_SHARE}


def test_every_method_has_a_main_parameter():
    assert list(MAIN_PARAMETERS) == list(METHODS)


def test_wrong_input(swing_up):
    with pytest.raises(UnknownNameError, match="unknown method 'densty'; did you mean 'density'"):
        compare(swing_up, ["densty"])
    with pytest.raises(InvalidValueError, match="starts = 0"):
        compare(swing_up, NAMES, starts=0)
    with pytest.raises(InvalidValueError, match="seed"):
        compare(swing_up, NAMES, starts=1, seed=-1)
    with pytest.raises(InvalidValueError, match="tuning_starts = -1"):
        compare(swing_up, NAMES, starts=1, tuning_starts=-1)
