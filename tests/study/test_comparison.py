"""A comparison: the same starts for all, every run counted, failures recorded."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from densarm.errors import InvalidValueError, UnknownNameError
from densarm.scenarios.run import Drive
from densarm.scenarios.scenario import Scenario
from densarm.study.baselines import BASELINES, MAIN_PARAMETERS
from densarm.study.comparison import (
    LIMIT_SHARE,
    MEASURES,
    SCALES,
    Comparison,
    TimedController,
    compare,
)
from densarm.values.arrays import Array
from densarm.values.outcome import RUN_ENDS, Outcome

NAMES = ("density_direct", "potential_field")


@pytest.fixture(scope="module")
def comparison(swing_up: Scenario) -> Comparison:
    return compare(swing_up, NAMES, starts=3, seed=4, tuning_starts=0)


@pytest.mark.slow
def test_json_holds_counts_medians_and_runs(comparison: Comparison) -> None:
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


@pytest.mark.slow
def test_all_start_alike_and_first_from_the_scenario(
    swing_up: Scenario, comparison: Comparison
) -> None:
    first, second = ([run.start for run in result.runs] for result in comparison.baselines)
    assert first == second
    assert len(set(first)) == 3
    np.testing.assert_allclose(first[0], swing_up.arm.angles(swing_up.start))


@pytest.mark.slow
def test_measures_are_those_of_the_record(swing_up: Scenario, comparison: Comparison) -> None:
    run = comparison.baselines[0].runs[-1]
    assert run.min_clearance_m is not None
    assert run.path_length_rad is not None
    assert run.effort is not None
    assert run.time_s is not None
    assert run.outcome == Outcome.REACHED
    straight = swing_up.arm.difference(swing_up.arm.configuration(run.start), swing_up.goal)
    assert np.linalg.norm(straight) - 0.01 < run.path_length_rad < 2.0 * np.linalg.norm(straight)
    assert 0.0 < run.min_clearance_m < 1.25
    assert 0.0 < run.effort < run.time_s * np.sum(swing_up.arm.limits.effort**2)


@pytest.mark.slow
def test_a_run_that_raises_is_recorded(swing_up: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    def raises(scenario: Scenario, scale: float) -> Drive:
        if (scenario.start == swing_up.start).all():
            raise InvalidValueError("gain", 0.0, "positive")
        return BASELINES["density_direct"](scenario, scale)

    monkeypatch.setattr("densarm.study.comparison.BASELINES", {"odd": raises})
    result = compare(swing_up, ["odd"], starts=2, seed=4, tuning_starts=0).baselines[0]
    assert result.runs[0].outcome == "failed"
    assert result.runs[0].detail == "gain = 0.0: must be positive"
    assert result.runs[1].outcome == Outcome.REACHED
    assert result.count("failed") == 1


def test_infeasible_for_all(swing_up: Scenario) -> None:
    contact = swing_up.arm.configuration([1.2, 0.0])
    comparison = compare(replace(swing_up, start=contact), NAMES, starts=1, tuning_starts=0)
    for result in comparison.baselines:
        assert result.count("infeasible") == 1
        assert result.median("time_s") is None
        assert result.median("step_us") is None


@pytest.mark.slow
def test_a_baseline_given_twice_runs_once(swing_up: Scenario) -> None:
    comparison = compare(swing_up, ["potential_field"] * 2, starts=1, tuning_starts=0)
    assert [result.baseline for result in comparison.baselines] == ["potential_field"]


@pytest.mark.slow
def test_progress_names_baseline_and_start(swing_up: Scenario) -> None:
    told: list[str] = []
    short = replace(swing_up, simulation=replace(swing_up.simulation, time_limit=0.2))
    compare(short, ["potential_field"], 1, tuning_starts=1, on_progress=told.append)
    tuning = ["potential_field from tuning start 1 of 1"] * len(SCALES)
    assert told == [*tuning, "potential_field from start 1 of 1"]


Odd = list[tuple[Any, float, Scenario]]


@pytest.fixture
def runs_of_odd(monkeypatch: pytest.MonkeyPatch) -> Odd:
    """Every (start, scale, scenario) that an odd baseline was run at; the last scale reaches."""
    seen: Odd = []

    def odd(scenario: Scenario, scale: float) -> Drive:
        seen.append((scenario.start.tolist(), scale, scenario))
        if scale != SCALES[-1]:
            raise InvalidValueError("gain", 0.0, "positive")
        return BASELINES["density_direct"](scenario)

    monkeypatch.setattr("densarm.study.comparison.BASELINES", {"odd": odd})
    return seen


@pytest.mark.slow
def test_tuning_takes_the_scale_that_reaches_on_other_starts(
    swing_up: Scenario, runs_of_odd: Odd
) -> None:
    result = compare(swing_up, ["odd"], starts=2, seed=4, tuning_starts=1).baselines[0]
    assert result.scale == SCALES[-1]
    tuned, counted = runs_of_odd[: len(SCALES)], runs_of_odd[len(SCALES) :]
    assert [scale for _, scale, _ in tuned] == list(SCALES)
    assert [scale for _, scale, _ in counted] == [SCALES[-1]] * 2
    assert not any(start == tuned[0][0] for start, _, _ in counted)


def test_all_plan_with_the_same_share_of_the_limits(swing_up: Scenario, runs_of_odd: Odd) -> None:
    compare(swing_up, ["odd"], starts=1, tuning_starts=0)
    scenario = runs_of_odd[0][2]
    assert {*vars(scenario.timing).values(), *vars(scenario.speed).values()} == {LIMIT_SHARE}


def test_every_baseline_has_a_main_parameter() -> None:
    assert list(MAIN_PARAMETERS) == list(BASELINES)


def test_wrong_input(swing_up: Scenario) -> None:
    with pytest.raises(UnknownNameError, match="unknown method 'densty'; did you mean 'density'"):
        compare(swing_up, ["densty"])
    with pytest.raises(InvalidValueError, match="starts = 0"):
        compare(swing_up, NAMES, starts=0)
    with pytest.raises(InvalidValueError, match="seed"):
        compare(swing_up, NAMES, starts=1, seed=-1)
    with pytest.raises(InvalidValueError, match="tuning_starts = -1"):
        compare(swing_up, NAMES, starts=1, tuning_starts=-1)


class Echo:
    tracking_error = 0.25

    def torque(self, t: float, q: ArrayLike, v: ArrayLike) -> Array:
        return np.asarray(t + np.asarray(q) + np.asarray(v), np.float64)


def test_a_timed_controller_passes_all_on_and_keeps_times() -> None:
    seconds: list[float] = []
    controller = TimedController(Echo(), seconds)
    np.testing.assert_array_equal(controller.torque(1.0, [2.0], [3.0]), [6.0])
    controller.torque(0.0, [0.0], [0.0])
    assert len(seconds) == 2
    assert min(seconds) >= 0.0
    assert controller.tracking_error == 0.25
    with pytest.raises(AttributeError):
        controller.motion  # noqa: B018
